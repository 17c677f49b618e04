# SPDX-License-Identifier: GPL-3.0-or-later
"""Split planes, leaf cells and ray paths as geometry that a viewport draws."""

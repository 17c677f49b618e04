# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice of a structure for a picture."""

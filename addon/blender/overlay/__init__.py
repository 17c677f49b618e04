# SPDX-License-Identifier: GPL-3.0-or-later
"""The structure drawn in the 3D viewport, and the picked ray."""

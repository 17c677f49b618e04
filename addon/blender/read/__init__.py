# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender data as the arrays of `core.scene`."""

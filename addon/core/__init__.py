# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender-independent part of the add-on: catalogue, validated scene arrays, settings and sessions."""

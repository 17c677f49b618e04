# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of scenes and view layers, and presets."""

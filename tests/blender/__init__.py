# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests with Blender as a module; skipped where it is not installed."""

import importlib.util

import pytest

bpy = pytest.importorskip("bpy", reason="Blender's module bpy is not installed in this environment")

if importlib.util.find_spec("OpenImageIO") is None:
    bpy.utils.expose_bundled_modules()

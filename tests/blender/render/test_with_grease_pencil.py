# SPDX-License-Identifier: GPL-3.0-or-later
"""Grease pencil, which Blender draws over the picture of an engine.

The last file of this folder by its name: such a render ends the context in which other tests draw without a window.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from exr_files import render
from shapes import cube

from addon.blender.render import engine
from addon.blender.session import reports

WIDTH, HEIGHT = 48, 32


def test_grease_pencil_is_drawn_by_blender_and_not_reported(add: Any, scene: Any, tmp_path: Path) -> None:
    scene.render.engine = engine.ENGINE
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.halfspace.samples = 4
    add("Cube", cube())
    add("Sun", bpy.data.lights.new("Sun", "SUN"), rotation_euler=(0.5, 0.3, 0))
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, -8, 0), rotation_euler=(np.pi / 2, 0, 0))
    without = render(scene, tmp_path)["Combined.R"]
    bpy.ops.object.grease_pencil_add(type="MONKEY", location=(0, -3, 0))
    bpy.context.object.scale = (2, 2, 2)
    picture = render(scene, tmp_path)["Combined.R"]
    assert (np.abs(picture - without) > 0.1).mean() > 0.01
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings

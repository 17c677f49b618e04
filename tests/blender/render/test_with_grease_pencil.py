# SPDX-License-Identifier: GPL-3.0-or-later
"""Grease pencil, which Blender draws over the picture of an engine.

The last file of this folder by its name: such a render ends the context in which other tests draw without a window.
"""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from tests.blender import atlas
from tests.blender.exr_files import render
from tests.blender.shapes import cube, lamp, look, place


def test_grease_pencil_is_drawn_by_blender_and_not_reported(scene: Any, tmp_path: Path) -> None:
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", 4
    place("Cube", cube())
    lamp("SUN", rotation_euler=(0.5, 0.3, 0))
    look((48, 32), (0, -8, 0), np.pi / 2)
    without = render(scene, tmp_path)["Combined.R"]
    bpy.ops.object.grease_pencil_add(type="MONKEY", location=(0, -3, 0))
    bpy.context.object.scale = (2, 2, 2)
    picture = render(scene, tmp_path)["Combined.R"]
    assert (np.abs(picture - without) > 0.1).mean() > 0.01
    assert not atlas.warnings(scene)

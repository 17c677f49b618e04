# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's window, against Blender's own projection of points."""

import itertools
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from addon.blender.read.camera import read_camera
from addon.core.base.notes import Notes

ORIGIN = np.array([10.0, -5.0, 2.0])
SETTINGS = list(itertools.product(["PERSP", "ORTHO"], ["AUTO", "HORIZONTAL", "VERTICAL"], [(96, 54), (40, 90)]))


def camera_of(scene: Any, item: Any, size: tuple[int, int], aspect: tuple[float, float], notes: Notes) -> Any:
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = item.evaluated_get(depsgraph)
    return read_camera(evaluated, depsgraph, evaluated.matrix_world, ORIGIN, notes, size=size, pixel_aspect=aspect)


@pytest.mark.parametrize(("kind", "fit", "size"), SETTINGS)
def test_points_project_as_in_blender(add: Any, scene: Any, kind: str, fit: str, size: tuple[int, int]) -> None:
    data = bpy.data.cameras.new("Camera")
    data.type, data.sensor_fit, data.lens, data.ortho_scale = kind, fit, 35.0, 7.0
    data.sensor_width, data.sensor_height = 36.0, 20.0
    data.shift_x, data.shift_y = 0.15, -0.07
    item = add("Camera", data, location=(3, -8, 4), rotation_euler=(1.1, 0.2, 0.3), scale=(2, 2, 2))
    scene.camera = item
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.pixel_aspect_x, render.pixel_aspect_y = 1.0, 1.5
    notes = Notes()
    found = camera_of(scene, item, size, (1.0, 1.5), notes)
    assert not notes
    assert np.allclose(found.to_world[:3, :3] @ found.to_world[:3, :3].T, np.eye(3), atol=1e-6)

    left, right, bottom, top = found.window
    rng = np.random.default_rng(1)
    for x, y, distance in zip(rng.random(20), rng.random(20), 1 + 9 * rng.random(20), strict=True):
        reach = distance if kind == "PERSP" else 1.0
        seen = np.array([(left + x * (right - left)) * reach, (bottom + y * (top - bottom)) * reach, -distance, 1.0])
        point = (found.to_world @ seen)[:3] + ORIGIN
        # Blender's helper does not remove the camera's scale, so reset it first.
        expected = world_to_camera_view(scene, _unscaled(item), Vector(point))
        assert (expected.x, expected.y) == pytest.approx((x, y), abs=1e-4)


def _unscaled(item: Any) -> Any:
    """The same object with its scale set to 1."""
    item.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    return item


def test_unknown_kinds_fall_back_and_are_listed(add: Any, scene: Any) -> None:
    data = bpy.data.cameras.new("Dome")
    try:
        data.type = "CUSTOM"
    except TypeError:
        pytest.skip("this Blender has no cameras of custom shaders")
    notes = Notes()
    found = camera_of(scene, add("Dome", data), (32, 32), (1.0, 1.0), notes)
    assert found.kind == "perspective"
    assert len(notes.lines()) == 1
    assert "Dome" in notes.lines()[0]

# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in scene: number of triangles, only supported features, and equal geometry each time."""

from typing import Any

import bpy
import numpy as np

from addon.blender.samples import showcase
from tests.blender.shapes import read


def test_the_showcase_uses_supported_features_and_has_its_lights_and_materials(scene: Any) -> None:
    showcase.build(scene)
    bpy.context.view_layer.update()
    arrays, notes = read()
    assert notes == []
    assert 100_000 <= len(arrays.geometry.triangles) <= 200_000
    assert arrays.geometry.faulty_triangles() == {}
    assert {light.kind for light in arrays.lights} == {"area", "spot", "point", "sun"}
    inputs = [closure.inputs for m in arrays.materials for closure in m.closures]
    assert any(found["transmission"] == 1 for found in inputs)
    assert any(found["metallic"] == 1 and found["roughness"] == 0 for found in inputs)
    # The floor is a chessboard: both halves have equally many squares.
    numbers = [i for i, m in enumerate(arrays.materials) if "stone" in m.name]
    counts = [np.count_nonzero(arrays.geometry.material_index == i) for i in numbers]
    assert counts == [784, 784]


def test_the_showcase_is_the_same_each_time(scene: Any) -> None:
    showcase.build(scene)
    bpy.context.view_layer.update()
    first = read()[0].geometry
    for item in list(scene.objects):
        bpy.data.objects.remove(item)
    bpy.data.orphans_purge(do_recursive=True)
    showcase.build(scene)
    bpy.context.view_layer.update()
    again = read()[0].geometry
    assert np.array_equal(first.triangles, again.triangles)
    assert np.array_equal(first.vertices, again.vertices)


def test_the_operator_adds_a_scene_of_its_own() -> None:
    before = set(bpy.data.scenes)
    assert bpy.ops.halfspace.showcase() == {"FINISHED"}
    (new,) = set(bpy.data.scenes) - before
    assert new.camera is not None

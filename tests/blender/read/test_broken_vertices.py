# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices without a finite position drop the triangles of their own object, and change nothing else."""

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read import extract
from addon.blender.render import engine
from addon.core.base.notes import Notes
from addon.core.scene.instances import InstancedGeometry
from addon.core.scene.scene import Geometry
from tests.blender import atlas
from tests.blender.exr_files import colours, render
from tests.blender.shapes import cube, lamp, look, world

BROKEN = {"nan": math.nan, "infinite": math.inf, "negative": -math.inf}
"""Infinity assigned to a property becomes the largest float; written into an attribute it stays infinite."""


def broken_cube(value: float, *, smooth: bool, by_property: bool) -> Any:
    """A cube whose first vertex has this x."""
    mesh = cube("Broken", smooth=smooth)
    if by_property:
        mesh.vertices[0].co.x = value
        return mesh
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", positions)
    positions[0] = value
    mesh.attributes["position"].data.foreach_set("vector", positions)
    mesh.update()
    return mesh


@pytest.mark.parametrize("by_property", [True, False], ids=["property", "attribute"])
@pytest.mark.parametrize("smooth", [False, True], ids=["flat", "smooth"])
@pytest.mark.parametrize("kind", BROKEN)
def test_only_the_triangles_at_the_vertex_are_dropped(add: Any, kind: str, smooth: bool, by_property: bool) -> None:
    mesh = broken_cube(BROKEN[kind], smooth=smooth, by_property=by_property)
    add("Broken", mesh, location=(-4, 0, 0))
    add("Intact", cube("Intact"), location=(4, 0, 0))
    add("Round", cube("Round", smooth=True), location=(0, 4, 0))
    mesh.calc_loop_triangles()
    expected = {"Broken": sum(0 in triangle.vertices for triangle in mesh.loop_triangles)}
    found = extract.find(bpy.context.evaluated_depsgraph_get(), Notes())
    flat, kept = found.flattened().geometry, found.instanced().geometry
    assert isinstance(flat, Geometry)
    assert isinstance(kept, InstancedGeometry)
    assert flat.faulty_triangles() == expected
    assert kept.faulty_triangles() == expected
    assert np.array_equal(flat.origin, kept.origin)
    # The frame is that of the finite vertices.
    assert np.abs(flat.origin).max() < 5
    live = np.isfinite(flat.vertices[flat.triangles]).all(axis=(1, 2))
    assert np.abs(flat.vertices[flat.triangles[live]]).max() < 10
    # Normals are finite, also those of dropped triangles.
    assert flat.corner_normals is not None
    assert np.isfinite(flat.corner_normals).all()
    for one in kept.meshes:
        assert one.corner_normals is None or np.isfinite(one.corner_normals).all()


@pytest.mark.parametrize("instancing", ["flatten", "two-level"])
@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_vertex_leaves_the_rest_of_the_picture(
    add: Any, scene: Any, tmp_path: Path, kind: str, instancing: str
) -> None:
    scene.render.engine, scene.halfspace.samples = engine.ENGINE, 2
    scene.halfspace.instancing = instancing
    world()
    look((48, 32), (0, -9, 0), np.pi / 2)
    lamp("SUN", rotation_euler=(0.5, 0.3, 0))
    # The frame's origin is the same in both pictures: the broken object lies within the box of the others.
    add("Left", cube("Left", smooth=True), location=(-2.5, 0, 0))
    add("Right", cube("Right"), location=(2.5, 0, 0))
    without = render(scene, tmp_path)
    mesh = broken_cube(BROKEN[kind], smooth=False, by_property=True)
    add("Broken", mesh, location=(0, 0, 0), scale=(0.1, 0.1, 0.1))
    picture = render(scene, tmp_path)
    (dropped,) = (line for line in atlas.warnings(scene) if line.startswith("Dropped triangles"))
    assert [name in dropped for name in ("Broken", "Left", "Right")] == [True, False, False]
    # Only the middle of the picture differs, where the rest of the broken object is.
    assert picture["Combined.R"].std() > 0.01
    for columns in (slice(0, 16), slice(32, 48)):
        assert np.array_equal(colours(picture)[:, columns], colours(without)[:, columns])

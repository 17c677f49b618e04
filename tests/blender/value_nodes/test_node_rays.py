# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that trace rays, compared with Cycles: boxes on floors, each below a plate of another object."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix

from tests.blender import atlas
from tests.blender.atlas import made, read
from tests.blender.shapes import place


def corner(*, smooth: bool = False) -> Any:
    """A box on a floor, one mesh."""
    bm = bmesh.new()
    bmesh.ops.create_grid(bm, x_segments=1, y_segments=1, size=0.45)
    bmesh.ops.create_cube(bm, size=0.4, matrix=Matrix.Translation((0.05, -0.05, 0.2)))
    mesh = bpy.data.meshes.new("Corner")
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    return mesh


def stage(scene: Any, makers: dict[str, atlas.Maker], *, smooth: bool = False) -> None:
    """Place the tiles, turned a little, and hang a plate over a part of each."""
    atlas.sheet(scene, makers, corner(smooth=smooth))
    plate = bpy.data.meshes.new("Plate")
    plate.from_pydata([(-0.2, -0.3, 0), (0.1, -0.3, 0), (0.1, 0.3, 0), (-0.2, 0.3, 0)], [], [(0, 1, 2, 3)])
    plate.materials.append(atlas.tile_material("Plate", made("BsdfTransparent")))
    for item in atlas.tiles(scene):
        item.rotation_euler = (0.5, -0.3, 0.2)
        place("Plate", plate, location=(item.location[0] - 0.15, item.location[1], 0.6))
    scene.world = bpy.data.worlds.new("World")
    scene.world.light_settings.distance = 0.7


tilted = made("VectorMath", made("NewGeometry", output="Normal"), (0.5, 0.3, 0.0), operation="ADD")
unit = made("VectorMath", tilted, operation="NORMALIZE")
"""A tilted normal."""

occlusion, bevel, cast = (partial(read, kind) for kind in ("AmbientOcclusion", "Bevel", "Raycast"))


def occlusions() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("AO", "Color"):
        yield output, occlusion(output, samples=4, Color=(0.8, 0.4, 0.1, 1))
    yield "near", occlusion("AO", samples=4, Distance=0.15)
    yield "world", occlusion("AO", samples=4, Distance=0.0)
    yield "local", occlusion("AO", samples=4, only_local=True)
    yield "inside", occlusion("AO", samples=4, inside=True)
    yield "inside local", occlusion("AO", samples=4, inside=True, only_local=True, Distance=0.3)
    yield "tilted", occlusion("AO", Normal=unit, samples=4)
    yield "one", occlusion("AO", samples=1)
    yield "negative", occlusion("AO", samples=4, Distance=-1.0)


def bevels() -> Iterator[tuple[str, atlas.Maker]]:
    for radius in (0.05, 0.15, 0.0, -1.0):
        yield f"{radius}", bevel("Normal", samples=4, Radius=radius)
    yield "tilted", bevel("Normal", Normal=unit, samples=4, Radius=0.1)


def casts() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("Is Hit", "Self Hit", "Hit Distance", "Hit Position", "Hit Normal"):
        yield output, cast(output, Length=0.6)
        yield f"tilted {output}", cast(output, Direction=unit, Length=2.0)
    yield "local", cast("Hit Distance", Direction=unit, Length=2.0, only_local=True)
    yield "short", cast("Is Hit", Length=0.1)
    yield "negative", cast("Hit Distance", Length=-1.0)
    yield "from elsewhere", cast("Hit Distance", Position=(0.0, 0.0, 0.0), Direction=(0.0, 0.0, 1.0))


@pytest.mark.parametrize("family", [occlusions, bevels, casts])
def test_rays_of_nodes_are_those_of_cycles(scene: Any, family: Callable[[], Iterator[tuple[str, Any]]]) -> None:
    if family is casts and bpy.app.version < (5, 0):
        pytest.skip("Blender 4.5 has no Raycast")
    makers = dict(family())
    stage(scene, makers, smooth=family is bevels)
    atlas.assert_alike(scene, makers)


def test_rays_of_nodes_do_not_depend_on_the_structure(scene: Any) -> None:
    makers = {"AO": occlusion("AO", samples=3, only_local=True)}
    makers["bevel"] = bevel("Normal", samples=3, Radius=0.2)
    if bpy.app.version >= (5, 0):
        makers["cast"] = cast("Hit Distance", Direction=unit, Length=2.0)
    stage(scene, makers)
    atlas.configure(scene, 2, 0)
    found = []
    for structure, threads in (("brute", 1), ("bvh-sah", 2)):
        scene.halfspace.structure = structure
        scene.render.threads_mode, scene.render.threads = "FIXED", threads
        found.append(atlas.rendered(scene, makers, "HALFSPACE"))
    assert all(np.array_equal(found[0][name], found[1][name]) for name in makers)
    assert not any(line.startswith("rays of programs") for line in atlas.report(scene).left_out)


def test_absurd_rays_give_a_picture(scene: Any) -> None:
    makers: dict[str, atlas.Maker] = {}
    for value in (math.nan, math.inf, -math.inf, 3e38, -3e38, 0.0):
        makers[f"AO {value}"] = occlusion("AO", samples=1, Distance=value)
        makers[f"bevel {value}"] = bevel("Normal", samples=1, Radius=value)
        if bpy.app.version >= (5, 0):
            makers[f"cast {value}"] = cast("Hit Position", Length=value, Direction=unit)
    stage(scene, makers)
    atlas.configure(scene, 1, 0)
    found = atlas.rendered(scene, makers, "HALFSPACE")
    assert {name for name, tile in found.items() if not np.isfinite(tile).all()} == set()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that trace rays, beside Cycles: boxes on floors, each below a plate of another object."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import atlas
import bmesh
import bpy
import numpy as np
import pytest
from atlas import add
from mathutils import Matrix

from addon.blender.session import reports

SAMPLES = 64


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
    plate.materials.append(atlas.tile_material("Plate", lambda tree: add(tree, "BsdfTransparent").outputs[0]))
    for item in [item for item in scene.objects if item.type == "MESH"]:
        item.rotation_euler = (0.5, -0.3, 0.2)
        above = bpy.data.objects.new("Plate", plate)
        above.location = (item.location[0] - 0.15, item.location[1], 0.6)
        scene.collection.objects.link(above)
    scene.world = bpy.data.worlds.new("World")
    scene.world.light_settings.distance = 0.7


def shown(tree: Any, output: Any, factor: float = 0.5, shift: float = 0.5) -> Any:
    """A vector or number whose negative values are visible, too."""
    node = add(tree, "VectorMath", operation="MULTIPLY_ADD")
    tree.links.new(output, node.inputs[0])
    node.inputs[1].default_value, node.inputs[2].default_value = (factor,) * 3, (shift,) * 3
    return node.outputs[0]


def made(kind: str, output: str, *, normal: str = "", **settings: Any) -> atlas.Maker:
    """The output of a node; `normal`: the input to which a tilted normal is linked."""

    def make(tree: Any) -> Any:
        node = add(tree, kind, **settings)
        if normal:
            tilted = add(tree, "VectorMath", operation="ADD")
            tree.links.new(add(tree, "NewGeometry").outputs["Normal"], tilted.inputs[0])
            tilted.inputs[1].default_value = (0.5, 0.3, 0.0)
            unit = add(tree, "VectorMath", operation="NORMALIZE")
            tree.links.new(tilted.outputs[0], unit.inputs[0])
            tree.links.new(unit.outputs[0], node.inputs[normal])
        return shown(tree, node.outputs[output])

    return make


def occlusions() -> Iterator[tuple[str, atlas.Maker]]:
    kind = "AmbientOcclusion"
    for output in ("AO", "Color"):
        yield output, made(kind, output, samples=4, Color=(0.8, 0.4, 0.1, 1))
    yield "near", made(kind, "AO", samples=4, Distance=0.15)
    yield "world", made(kind, "AO", samples=4, Distance=0.0)
    yield "local", made(kind, "AO", samples=4, only_local=True)
    yield "inside", made(kind, "AO", samples=4, inside=True)
    yield "inside local", made(kind, "AO", samples=4, inside=True, only_local=True, Distance=0.3)
    yield "tilted", made(kind, "AO", normal="Normal", samples=4)
    yield "one", made(kind, "AO", samples=1)
    yield "negative", made(kind, "AO", samples=4, Distance=-1.0)


def bevels() -> Iterator[tuple[str, atlas.Maker]]:
    for radius in (0.05, 0.15, 0.0, -1.0):
        yield f"{radius}", made("Bevel", "Normal", samples=4, Radius=radius)
    yield "tilted", made("Bevel", "Normal", normal="Normal", samples=4, Radius=0.1)


def casts() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("Is Hit", "Self Hit", "Hit Distance", "Hit Position", "Hit Normal"):
        yield output, made("Raycast", output, Length=0.6)
        yield f"tilted {output}", made("Raycast", output, normal="Direction", Length=2.0)
    yield "local", made("Raycast", "Hit Distance", normal="Direction", Length=2.0, only_local=True)
    yield "short", made("Raycast", "Is Hit", Length=0.1)
    yield "negative", made("Raycast", "Hit Distance", Length=-1.0)
    yield "from elsewhere", made("Raycast", "Hit Distance", Position=(0.0, 0.0, 0.0), Direction=(0.0, 0.0, 1.0))


@pytest.mark.parametrize("family", [occlusions, bevels, casts])
def test_rays_of_nodes_are_those_of_cycles(scene: Any, family: Callable[[], Iterator[tuple[str, Any]]]) -> None:
    if family is casts and bpy.app.version < (5, 0):
        pytest.skip("Blender 4.5 has no Raycast")
    makers = dict(family())
    stage(scene, makers, smooth=family is bevels)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings


def test_rays_of_nodes_do_not_depend_on_the_structure(scene: Any) -> None:
    makers = {"AO": made("AmbientOcclusion", "AO", samples=3, only_local=True)}
    makers["bevel"] = made("Bevel", "Normal", samples=3, Radius=0.2)
    if bpy.app.version >= (5, 0):
        makers["cast"] = made("Raycast", "Hit Distance", normal="Direction", Length=2.0)
    stage(scene, makers)
    atlas.configure(scene, 2, 0)
    found = []
    for structure, threads in (("brute", 1), ("bvh-sah", 2)):
        scene.halfspace.structure = structure
        scene.render.threads_mode, scene.render.threads = "FIXED", threads
        found.append(atlas.rendered(scene, makers, "HALFSPACE"))
    assert all(np.array_equal(found[0][name], found[1][name]) for name in makers)
    report = reports.last(scene)
    assert report is not None
    assert not any(line.startswith("rays of programs") for line in report.left_out)


def test_absurd_rays_give_a_picture(scene: Any) -> None:
    makers: dict[str, atlas.Maker] = {}
    for value in (math.nan, math.inf, -math.inf, 3e38, -3e38, 0.0):
        makers[f"AO {value}"] = made("AmbientOcclusion", "AO", samples=1, Distance=value)
        makers[f"bevel {value}"] = made("Bevel", "Normal", samples=1, Radius=value)
        if bpy.app.version >= (5, 0):
            makers[f"cast {value}"] = made("Raycast", "Hit Position", Length=value, normal="Direction")
    stage(scene, makers)
    atlas.configure(scene, 1, 0)
    found = atlas.rendered(scene, makers, "HALFSPACE")
    assert {name for name, tile in found.items() if not np.isfinite(tile).all()} == set()

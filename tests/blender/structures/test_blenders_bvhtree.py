# SPDX-License-Identifier: GPL-3.0-or-later
"""The package's BVHTree against Blender's own; where they differ, exact arithmetic decides for the package's."""

from typing import Any

import bmesh
import bpy
import halfspace_native as native
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from addon.lab.commands.stability import BUNNY
from tests import bvhtree_module

bvhtree = bvhtree_module.load()

Mesh = tuple[Any, Any]


def suzanne() -> Mesh:
    """Blender's monkey: vertices and triangles."""
    bpy.ops.mesh.primitive_monkey_add()
    mesh = bpy.context.object.data
    vertices = np.array([one.co for one in mesh.vertices], np.float32)
    return vertices, np.array([one.vertices for one in mesh.loop_triangles], np.int32)


def bunny() -> Mesh:
    """The Stanford bunny, if it is there."""
    if not BUNNY.is_file():
        pytest.skip(f"the bunny is not there: {BUNNY}")
    with np.load(BUNNY) as scene:
        return scene["vertices"], scene["triangles"]


@pytest.fixture(params=[suzanne, bunny])
def mesh(scene: Any, request: pytest.FixtureRequest) -> Any:
    return request.param()


def both(mesh: Mesh) -> tuple[Any, Any]:
    """The package's tree and Blender's."""
    vertices, triangles = mesh[0].tolist(), mesh[1].tolist()
    return (
        bvhtree.BVHTree.FromPolygons(mesh[0], mesh[1], all_triangles=True),
        BVHTree.FromPolygons(vertices, triangles, all_triangles=True),
    )


def points(mesh: Mesh, count: int) -> Any:
    """Points in and around the box of a mesh, and some of its vertices."""
    random = np.random.default_rng(2)
    low, high = mesh[0].min(0), mesh[0].max(0)
    around = low + (high - low) * (3 * random.random((count, 3)) - 1)
    return np.concatenate([around, mesh[0][random.integers(0, len(mesh[0]), count // 8)]]).astype(np.float32)


def test_nearest_triangles(mesh: Mesh) -> None:
    ours, theirs = both(mesh)
    differ = 0
    for point in points(mesh, 400):
        position, normal, index, distance = ours.find_nearest(point)
        other = theirs.find_nearest(Vector(point))
        assert isinstance(position, Vector)
        assert isinstance(normal, Vector)
        assert distance == pytest.approx(other[3], rel=1e-4, abs=1e-6 * float(np.abs(mesh[0]).max()))
        if index == other[2]:
            assert (position - other[0]).length <= 1e-4 * float(np.abs(point).max())
            assert (normal - other[1]).length < 1e-3
            continue
        differ += 1
        squares = [bvhtree_module.squared_distance(point, mesh[0][mesh[1][i]]) for i in (index, other[2])]
        assert (squares[0], index) < (squares[1], other[2])
    assert differ > 0, "the closest point is often a vertex, of which Blender finds any triangle"


def test_rays(mesh: Mesh) -> None:
    ours, theirs = both(mesh)
    origins = points(mesh, 400)
    targets = mesh[0][np.random.default_rng(3).integers(0, len(mesh[0]), len(origins))]
    found = 0
    for origin, target in zip(origins, targets, strict=True):
        direction = target * np.float32(0.999) - origin
        one, other = ours.ray_cast(origin, direction), theirs.ray_cast(Vector(origin), Vector(direction))
        found += one[2] is not None
        if one[2] == other[2]:
            assert one[2] is None or one[3] == pytest.approx(other[3], rel=1e-3, abs=1e-5)
            continue
        exact = native.exact_closest(*mesh, origin[None], direction[None])
        assert exact.triangle[0] == (-1 if one[2] is None else one[2])
    assert found > 200


def test_ranges(mesh: Mesh) -> None:
    ours, theirs = both(mesh)
    radius = float(np.ptp(mesh[0], axis=0).max()) / 50
    found = 0
    for point in points(mesh, 100):
        own = {one[2] for one in ours.find_nearest_range(point, radius)}
        for index in own ^ {one[2] for one in theirs.find_nearest_range(Vector(point), radius)}:
            within = bvhtree_module.squared_distance(point, mesh[0][mesh[1][index]]) <= np.float32(radius).item() ** 2
            assert (index in own) == within
        found += len(own)
    assert found > 20


def test_overlaps(mesh: Mesh) -> None:
    shift = np.float32(np.ptp(mesh[0], axis=0).max() / 8) * np.array([1, 0.7, 0.3], np.float32)
    moved = mesh[0] + shift, mesh[1]
    (ours, theirs), (our_moved, their_moved) = both(mesh), both(moved)
    own, other = set(ours.overlap(our_moved)), set(theirs.overlap(their_moved))
    assert len(own & other) > 50
    assert len(own ^ other) < len(own) / 10
    for a, b in own ^ other:
        exact = native.exact_overlaps(mesh[0], mesh[1][[a]], moved[0], moved[1][[b]])
        assert ((a, b) in own) == (len(exact) == 1)


def test_a_touch_is_an_overlap_where_blender_finds_none() -> None:
    flat = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    touching = [(0.25, 0.25, 0), (1, 1, 1), (0, 1, 1)]
    trees = [[make.FromPolygons(one, [(0, 1, 2)]) for one in (flat, touching)] for make in (bvhtree.BVHTree, BVHTree)]
    same = [make.FromPolygons(flat, [(0, 1, 2)]) for make in (bvhtree.BVHTree, BVHTree)]
    assert trees[0][0].overlap(trees[0][1]) == [(0, 0)]
    assert trees[0][0].overlap(same[0]) == [(0, 0)]
    assert trees[1][0].overlap(same[1]) == [], "triangles in one plane"
    one = np.array([[0, 1, 2]])
    for other in (flat, touching):
        assert len(native.exact_overlaps(np.array(flat, float), one, np.array(other, float), one)) == 1


def test_a_surface_with_itself(scene: Any) -> None:
    mesh = suzanne()
    # Eyes and head of the monkey pass through each other.
    ours, theirs = both(mesh)
    own, other = set(ours.overlap(ours)), set(theirs.overlap(theirs))
    assert own >= other
    assert own == {(b, a) for a, b in own}
    assert len(own) > 20


def test_objects_and_bmeshes_have_their_polygons(scene: Any, add: Any) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    item = bpy.context.object
    item.modifiers.new("Smooth", "SUBSURF")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    edited = bmesh.new()
    edited.from_mesh(item.data)
    for ours, theirs in [
        (bvhtree.BVHTree.FromObject(item, depsgraph), BVHTree.FromObject(item, depsgraph)),
        (bvhtree.BVHTree.FromBMesh(edited), BVHTree.FromBMesh(edited)),
    ]:
        equal = parallel = 0
        for point in 4 * np.random.default_rng(4).random((100, 3), np.float32) - 2:
            one, other = ours.find_nearest(point), theirs.find_nearest(Vector(point))
            assert one[3] == pytest.approx(other[3], rel=1e-4, abs=1e-6)
            if one[2] == other[2]:
                equal += 1
                parallel += (one[1] - other[1]).length < 1e-3
        assert equal > 50
        # Normals of an object are those of triangles: some points lie as near to another triangle of the polygon.
        assert parallel > 0.8 * equal
    edited.free()
    with pytest.raises(ValueError, match="deform, cage"):
        bvhtree.BVHTree.FromObject(item, depsgraph, deform=False)
    with pytest.raises(ValueError, match="expected a mesh or a surface, got CAMERA"):
        bvhtree.BVHTree.FromObject(add("Camera", bpy.data.cameras.new("Camera")), depsgraph)


@pytest.mark.parametrize("turn", range(4))
def test_quadrilaterals_have_blenders_diagonal(turn: int) -> None:
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)]
    polygon = [tuple((i + turn) % 4 for i in range(4))]
    trees = [make.FromPolygons(vertices, polygon) for make in (bvhtree.BVHTree, BVHTree)]
    for x, y in [(0.5, 0.4), (0.3, 0.9), (0.8, 0.1)]:
        one, other = (tree.ray_cast(Vector((x, y, 5)), Vector((0, 0, -1))) for tree in trees)
        assert one[3] == pytest.approx(other[3])
        assert (one[1] - other[1]).length < 1e-6


ADD = {
    "META": bpy.ops.object.metaball_add,
    "SURFACE": bpy.ops.surface.primitive_nurbs_surface_sphere_add,
    "FONT": bpy.ops.object.text_add,
    "CURVE": bpy.ops.curve.primitive_bezier_circle_add,
    "MESH": bpy.ops.mesh.primitive_monkey_add,
}
"""Operators by the type of the object that they add."""


@pytest.mark.parametrize("kind", ADD)
@pytest.mark.parametrize("modified", [False, True])
def test_objects_of_all_types_have_blenders_surface(scene: Any, kind: str, modified: bool) -> None:
    ADD[kind]()
    item = bpy.context.object
    assert item.type == kind
    if kind == "CURVE":
        item.data.bevel_depth = 0.2
    if modified and kind != "META":
        item.modifiers.new("Array", "ARRAY")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    ours, theirs = bvhtree.BVHTree.FromObject(item, depsgraph), BVHTree.FromObject(item, depsgraph)
    for point in 6 * np.random.default_rng(4).random((100, 3), np.float32) - 3:
        one, other = ours.find_nearest(point), theirs.find_nearest(Vector(point))
        assert one[3] == pytest.approx(other[3], rel=1e-4, abs=1e-6)
        assert (one[0] - other[0]).length < 1e-4 or one[2] != other[2]


@pytest.mark.parametrize("kind", ["CURVE", "EMPTY", "CAMERA"])
def test_objects_without_a_surface_are_refused_as_in_blender(scene: Any, kind: str) -> None:
    if kind == "CURVE":
        bpy.ops.curve.primitive_bezier_circle_add()
    else:
        bpy.ops.object.add(type=kind)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for make in (bvhtree.BVHTree, BVHTree):
        with pytest.raises(ValueError, match=r"expected a mesh or a surface|Cannot get a mesh"):
            make.FromObject(bpy.context.object, depsgraph)


def test_generators_are_read_as_in_blender() -> None:
    mesh = bpy.data.meshes.new("Square")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    found = [
        make.FromPolygons((v.co for v in mesh.vertices), (p.vertices for p in mesh.polygons)).ray_cast(
            Vector((0.2, 0.3, 2)), Vector((0, 0, -1))
        )
        for make in (bvhtree.BVHTree, BVHTree)
    ]
    assert found[0] == found[1]

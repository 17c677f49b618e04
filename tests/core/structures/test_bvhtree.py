# SPDX-License-Identifier: GPL-3.0-or-later
"""The class in the shape of Blender's BVHTree, without Blender: polygons, results and batches."""

from __future__ import annotations

import math
import sys
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from tests import bvhtree_module


@pytest.fixture(scope="module")
def module() -> Any:
    """The module where Blender's mathutils is missing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "mathutils", None)
        yield bvhtree_module.load()


# A square, a concave arrow and a hexagon of which one corner is pushed in, all in planes.
VERTICES = [
    *[(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)],
    *[(4, 0, 1), (6, 0, 1), (5, 0.5, 1), (5, 3, 1)],
    *[(8, 0, 2), (10, 0, 2), (11, 1, 2), (10, 2, 2), (9.5, 1, 2), (8, 2, 2)],
]
POLYGONS = [(0, 1, 2, 3), (4, 6, 5, 7), (8, 9, 10, 11, 12, 13)]


def test_results_are_polygons_with_their_normals(module: Any) -> None:
    tree = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    position, normal, index, distance = tree.find_nearest((1, 1, 3))
    assert (position.tolist(), normal.tolist(), index, distance) == ([1, 1, 0], [0, 0, 1], 0, 3.0)
    position, normal, index, distance = tree.ray_cast((1, 1.5, 3), (0, 0, -0.25))
    assert (position.tolist(), normal.tolist(), index, distance) == ([1, 1.5, 0], [0, 0, 1], 0, 3.0)
    assert tree.ray_cast((1, 1.5, 3), (0, 0, 1)) == (None, None, None, None)
    assert tree.ray_cast((1, 1.5, 3), (0, 0, 0)) == (None, None, None, None)
    assert tree.find_nearest((1, 1, 3), 2.9) == (None, None, None, None)


@pytest.mark.parametrize("turn", range(6))
def test_polygons_are_cut_inside_their_outline(module: Any, turn: int) -> None:
    turned = [tuple(polygon[(i + turn) % len(polygon)] for i in range(len(polygon))) for polygon in POLYGONS]
    for polygons in (turned, [polygon[::-1] for polygon in turned]):
        tree = module.BVHTree.FromPolygons(VERTICES, polygons)
        assert tree.ray_cast((5, 0.2, 9), (0, 0, -1))[2] is None, "the notch of the arrow"
        assert tree.ray_cast((9.5, 1.5, 9), (0, 0, -1))[2] is None, "the notch of the hexagon"
        for x, y, index in [(1, 1, 0), (0.1, 1.8, 0), (5, 1, 1), (4.2, 0.2, 1), (8.3, 1.5, 2), (10.2, 1.4, 2)]:
            assert tree.ray_cast((x, y, 9), (0, 0, -1))[2] == index
            offsets, _ = tree.find_nearest_range_batch([(x, y, index)], 0.0)
            assert offsets[-1] in (1, 2), "once, or on a diagonal"


def test_limits_are_closed(module: Any) -> None:
    tree = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    assert tree.find_nearest((1, 1, 3), 3.0)[2] == 0
    assert tree.find_nearest((0, 0, 0), 0.0)[2:] == (0, 0.0)
    assert tree.ray_cast((1, 1.5, 3), (0, 0, -7), 3.0)[2] == 0
    assert tree.ray_cast((1, 1.5, 3), (0, 0, -7), 2.99)[2] is None
    # Of directions near the ends of the range, none is lost.
    for length in (1e-38, 1e-20, 3e38):
        found = tree.ray_cast((1, 1.5, 3), (0, 0, -length), sys.float_info.max)
        assert found[2:] == (0, pytest.approx(3.0, rel=2e-7))


def test_all_within_a_distance_are_sorted(module: Any) -> None:
    tree = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    found = tree.find_nearest_range((2, 1, 0), 5.0)
    assert [one[2] for one in found] == [0, 0, 1, 1]
    assert [one[3] for one in found] == sorted(one[3] for one in found)
    assert len(tree.find_nearest_range((2, 1, 0))) == 8


def test_batches_are_the_single_answers(module: Any) -> None:
    tree = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    random = np.random.default_rng(1)
    origins, targets = 10 * random.random((60, 3)), random.random((60, 3)) * [11, 2, 2]
    directions = targets - origins
    singles = [tree.ray_cast(o, d, 8.0) for o, d in zip(origins, directions, strict=True)]
    for batch, single in [
        (tree.ray_cast_batch(origins, directions, 8.0), singles),
        (tree.find_nearest_batch(origins, 2.0), [tree.find_nearest(o, 2.0) for o in origins]),
    ]:
        points, normals, polygons, distances = batch
        assert [-1 if one[2] is None else one[2] for one in single] == polygons.tolist()
        assert [math.inf if one[3] is None else one[3] for one in single] == distances.tolist()
        hit = polygons >= 0
        assert 0 < hit.sum() < 60
        assert np.isnan(points[~hit]).all()
        assert (points[hit] == [one[0] for one in single if one[2] is not None]).all()
        assert (normals[hit] == [one[1] for one in single if one[2] is not None]).all()


def test_overlaps_are_pairs_of_polygons(module: Any) -> None:
    tree = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    wall = module.BVHTree.FromPolygons([(-1, 1, -1), (9, 1, -1), (9, 1, 3), (-1, 1, 3)], [(0, 1, 2), (0, 2, 3)], True)
    found = tree.overlap(wall)
    assert {a for a, _ in found} == {0, 1, 2}
    assert len(found) == len(set(found))
    assert wall.overlap(tree) == sorted((b, a) for a, b in found)
    assert tree.overlap(tree) == [], "parts of one polygon are neighbours"


def test_bad_arguments_are_refused(module: Any) -> None:
    make = module.BVHTree.FromPolygons
    for polygons, only, words in (
        ([(0, 1, 2), (3, 14, 5)], False, r"polygons\[1\]: index 14 is out of range for 14 vertices"),
        ([(0, -1, 2)], True, r"polygons\[0\]: index -1 is out of range"),
        ([(0, 1, 2), (0, 1, 2, 3)], True, r"polygons\[1\]: expected 3 vertices, got 4"),
    ):
        with pytest.raises(ValueError, match=words):
            make(VERTICES, polygons, all_triangles=only)
    tree = make(VERTICES, [*POLYGONS, (0, 1), ()])
    at = (0, 0, 1)
    for call in (tree.find_nearest, lambda bad: tree.ray_cast(bad, at), lambda bad: tree.ray_cast(at, bad)):
        with pytest.raises(native.NonFiniteError):
            call((0, math.nan, 0))
        with pytest.raises(ValueError, match=r"expected three numbers, got shape \(2,\)"):
            call((0, 0))
    with pytest.raises(ValueError, match="differ in shape"):
        tree.ray_cast_batch(np.zeros((2, 3)), np.zeros((3, 3)))
    with pytest.raises(native.NonFiniteError):
        tree.find_nearest((0, 0, 0), math.nan)


def test_nothing_is_found_in_an_empty_tree(module: Any) -> None:
    for tree in (module.BVHTree.FromPolygons([], []), module.BVHTree.FromPolygons(VERTICES, [(0, 1)])):
        assert tree.find_nearest((0, 0, 0)) == tree.ray_cast((0, 0, 1), (0, 0, -1)) == (None, None, None, None)
        assert tree.find_nearest_range((0, 0, 0)) == tree.overlap(tree) == []


def test_generators_are_read_once(module: Any) -> None:
    whole = module.BVHTree.FromPolygons(VERTICES, POLYGONS)
    for vertices, polygons in (
        ((tuple(v) for v in VERTICES), (polygon for polygon in POLYGONS)),
        (iter(VERTICES), (iter(polygon) for polygon in POLYGONS)),
        (map(list, VERTICES), map(np.array, POLYGONS)),
    ):
        made = module.BVHTree.FromPolygons(vertices, polygons)
        for point in ((0.3, 0.2, 2.0), (5, 5, 5)):
            assert str(made.find_nearest(point)) == str(whole.find_nearest(point))
    made = module.BVHTree.FromPolygons(iter(VERTICES), (polygon[:3] for polygon in POLYGONS), all_triangles=True)
    assert made.find_nearest((0, 0, 9))[2] is not None


@pytest.mark.parametrize(
    ("vertices", "polygons"),
    [
        ([(0, 0), (1, 0), (0, 1)], [(0, 1, 2)]),
        ([(0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1)], [(0, 1, 2)]),
        (VERTICES, [(0, 1, 2**32 + 2)]),
        (VERTICES, [(0, 1, 2.5)]),
        (VERTICES, [(0, 1, math.nan)]),
    ],
)
def test_rejects_bad_vertices_and_indices(module: Any, vertices: Any, polygons: Any) -> None:
    for all_triangles in (False, True):
        with pytest.raises(ValueError, match=r"expected shape|out of range|no whole number"):
            module.BVHTree.FromPolygons(vertices, polygons, all_triangles)
    if len(vertices) == len(VERTICES):
        with pytest.raises(ValueError, match=r"range|whole numbers"):
            module.BVHTree(vertices, polygons)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Nearest triangles, triangles within a distance, and overlaps, as Python sees them; the tests of the native room
`nearest` compare them with integers.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from tests import bvhtree_module

Mesh = tuple[Any, Any]


def soup(seed: int, count: int, size: float = 0.3) -> Mesh:
    """Small triangles in a cube, every seventh without area."""
    random = np.random.default_rng(seed)
    corners = random.random((count, 1, 3)) + size * random.random((count, 3, 3))
    corners[::7, 2] = (corners[::7, 0] + corners[::7, 1]) / 2
    corners[::14, 1:] = corners[::14, :1]
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def lattice(seed: int, count: int) -> Mesh:
    """Triangles with corners of few values, of which many touch and have equal distances."""
    random = np.random.default_rng(seed)
    corners = random.integers(0, 4, (3 * count, 3)).astype(np.float32)
    return corners, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def points(seed: int, mesh: Mesh) -> Any:
    random = np.random.default_rng(seed)
    on = mesh[0][random.integers(0, len(mesh[0]), 40)]
    between = (on[:20] + on[20:]) / 2
    return np.concatenate(
        [on, between, random.integers(-1, 9, (40, 3)) / 2, 2 * random.random((40, 3)), [[1e20, 3, -7]]]
    )


@pytest.mark.parametrize("mesh", [soup(1, 200), lattice(2, 200)], ids=["soup", "lattice"])
def test_closest_points_are_those_of_integers_to_the_bit(mesh: Mesh) -> None:
    structure = native.build(*mesh, "bvh-sah")
    where = points(3, mesh)
    for limit in (None, 0.25, np.linspace(0, 2, len(where), dtype=np.float32)):
        found = structure.closest_points(where, limit, threads=2)
        right = native.exact_closest_points(*mesh, where, limit)
        assert found.triangle.tolist() == right.triangle.tolist()
        assert found.distance.tobytes() == right.distance.tobytes()
        assert found.point.tobytes() == right.point.tobytes()
    assert (found.triangle < 0).any()
    assert (found.triangle >= 0).any()
    assert np.isnan(found.point[found.triangle < 0]).all()


def test_triangles_within_a_distance_are_sorted_and_complete() -> None:
    mesh = lattice(6, 150)
    structure = native.build(*mesh, "bvh-sah")
    where = points(7, mesh)[::5]
    offsets, found = structure.points_within(where, 1.5)
    assert (offsets[0], offsets[-1]) == (0, len(found))
    for i, point in enumerate(where.astype(np.float32)):
        own = slice(offsets[i], offsets[i + 1])
        square = {j: bvhtree_module.squared_distance(point, mesh[0][one]) for j, one in enumerate(mesh[1])}
        within = sorted((square[j], j) for j in square if square[j] <= Fraction(9, 4))
        assert found.triangle[own].tolist() == [j for _, j in within]
        assert np.allclose(found.distance[own], [math.sqrt(square) for square, _ in within], rtol=1e-7, atol=0)
    each = np.full(len(where), 1.5, np.float32)
    assert structure.points_within(where, each, threads=3)[1].triangle.tolist() == found.triangle.tolist()


def test_overlaps_are_those_of_integers() -> None:
    one, other = lattice(10, 40), lattice(11, 40)
    right = native.exact_overlaps(*one, *other)
    assert len(right) > 20
    structure, against = native.build(*one, "bvh-sah"), native.build(*other, "bvh-sah:width=4")
    found = structure.overlaps(against, threads=2)
    assert (found.dtype, found.tolist()) == (np.int32, right.tolist())
    assert against.overlaps(structure).tolist() == sorted([b, a] for a, b in right.tolist())


def test_queries_are_cancelled_and_refused_by_name() -> None:
    at, cancelled = np.zeros((9, 3)), native.Monitor()
    cancelled.cancel()
    structure, other = (native.build(*soup(3, 400), spec) for spec in ("bvh-sah", "kd"))
    for way in (
        lambda asked, monitor: asked.closest_points(at, monitor=monitor),
        lambda asked, monitor: asked.points_within(at, 0.1, monitor=monitor),
        lambda asked, monitor: asked.overlaps(asked, monitor=monitor),
    ):
        way(structure, native.Monitor())
        with pytest.raises(native.Cancelled):
            way(structure, cancelled)
        with pytest.raises(native.SpecError, match=r"structure: kd has no boxes .*; bvh-sah has"):
            way(other, native.Monitor())


WRONG: list[tuple[Any, Any, type[Exception], str]] = [
    (np.full((2, 3), np.nan), 1.0, native.NonFiniteError, r"points\[0\]: .* is not finite"),
    (np.array([[0, 0, 0], [0, np.inf, 0]]), 1.0, native.NonFiniteError, r"points\[1\]"),
    (np.zeros((2, 2)), 1.0, native.ShapeError, r"points: expected an \(n, 3\)"),
    (np.zeros((2, 3)), np.nan, native.NonFiniteError, "NaN is no distance"),
    (np.zeros((2, 3)), np.ones(3, np.float32), native.ShapeError, "expected a number or 2 of them"),
    (np.zeros((2, 3)), "far", native.ShapeError, "expected a number or an"),
]


@pytest.mark.parametrize(("where", "distance", "error", "message"), WRONG)
def test_bad_points_and_distances_are_refused(where: Any, distance: Any, error: type[Exception], message: str) -> None:
    structure = native.build(*soup(1, 3), "bvh-sah")
    for call in (structure.closest_points, structure.points_within):
        with pytest.raises(error, match=message):
            call(where, distance)


def test_nothing_has_no_nearest_triangle_and_no_overlap() -> None:
    nothing = native.build(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), "bvh-sah")
    found = nothing.closest_points(np.zeros((2, 3)))
    assert (found.triangle.tolist(), found.distance.tolist()) == ([-1, -1], [math.inf, math.inf])
    assert nothing.points_within(np.zeros((2, 3)), 9.0)[0].tolist() == [0, 0, 0]
    assert nothing.overlaps(nothing).shape == (0, 2)
    some = native.build(*soup(1, 3), "bvh-sah")
    assert some.closest_points(np.zeros((1, 3)), -1.0).triangle.tolist() == [-1]
    assert len(some.closest_points(np.zeros((0, 3)))) == 0

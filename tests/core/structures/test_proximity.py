# SPDX-License-Identifier: GPL-3.0-or-later
"""Nearest triangles, triangles within a distance, and overlaps: exact, and refused where they cannot be answered."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import bvhtree_module
import halfspace_native as native
import numpy as np
import pytest

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
@pytest.mark.parametrize("spec", ["bvh-sah", "bvh-sah:width=2"])
def test_closest_points_are_those_of_integers_to_the_bit(mesh: Mesh, spec: str) -> None:
    structure = native.build(*mesh, spec)
    where = points(3, mesh)
    limits = np.linspace(0, 2, len(where), dtype=np.float32)
    for limit in (None, 0.25, limits):
        found = structure.closest_points(where, limit, threads=2)
        right = native.exact_closest_points(*mesh, where, limit)
        assert found.triangle.tolist() == right.triangle.tolist()
        assert found.distance.tobytes() == right.distance.tobytes()
        assert found.point.tobytes() == right.point.tobytes()
    assert (found.triangle < 0).any()
    assert (found.triangle >= 0).any()
    assert np.isnan(found.point[found.triangle < 0]).all()


def test_the_nearest_triangle_is_that_of_fractions() -> None:
    vertices, triangles = lattice(4, 40)
    where = points(5, (vertices, triangles)).astype(np.float32)[::4]
    found = native.build(vertices, triangles, "bvh-sah").closest_points(where)
    for i, point in enumerate(where):
        squares = [bvhtree_module.squared_distance(point, vertices[one]) for one in triangles]
        assert found.triangle[i] == squares.index(min(squares))
        # The distance lies between the middles to its neighbours.
        distance = found.distance[i]
        low, high = (
            (Fraction(float(distance)) + Fraction(float(np.nextafter(distance, end)))) / 2 for end in (0, 1e30)
        )
        assert low <= 0 or low**2 <= min(squares)
        assert min(squares) <= high**2


def test_triangles_within_a_distance_are_sorted_and_complete() -> None:
    mesh = lattice(6, 150)
    structure = native.build(*mesh, "bvh-sah")
    where = points(7, mesh)
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


@pytest.mark.parametrize(("one", "other"), [(soup(8, 90, 0.6), soup(9, 60, 0.6)), (lattice(10, 40), lattice(11, 40))])
def test_overlaps_are_those_of_integers(one: Mesh, other: Mesh) -> None:
    right = native.exact_overlaps(*one, *other)
    assert len(right) > 20
    structure, against = native.build(*one, "bvh-sah"), native.build(*other, "bvh-sah:width=4")
    for threads in (1, 2):
        found = structure.overlaps(against, threads=threads)
        assert (found.dtype, found.tolist()) == (np.int32, right.tolist())
    assert against.overlaps(structure).tolist() == sorted([b, a] for a, b in right.tolist())
    # Two structures over the same triangles: each meets itself.
    again = native.build(*one, "bvh-sah").overlaps(structure)
    assert {(i, i) for i in range(len(one[1]))} <= {(a, b) for a, b in again.tolist()}


@pytest.mark.parametrize("threads", [1, 2])
def test_a_monitor_cancels_queries(threads: int) -> None:
    mesh = soup(3, 400)
    structure, at = native.build(*mesh, "bvh-sah"), points(4, mesh)
    ways = (
        lambda monitor: structure.closest_points(at, threads=threads, monitor=monitor),
        lambda monitor: structure.points_within(at, 0.1, threads=threads, monitor=monitor),
        lambda monitor: structure.overlaps(structure, threads=threads, monitor=monitor),
    )
    cancelled = native.Monitor()
    cancelled.cancel()
    for way in ways:
        way(native.Monitor())
        with pytest.raises(native.Cancelled):
            way(cancelled)


def test_a_structure_with_itself_has_no_neighbours() -> None:
    # A strip of three triangles, and one that begins at a vertex of the first and pierces all.
    vertices = np.array(
        [[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0], [0, 4, 0], [0.5, 2.5, -1], [0.5, 2.5, 1]], np.float32
    )
    triangles = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [0, 5, 6]], np.int32)
    structure = native.build(vertices, triangles, "bvh-sah")
    assert structure.overlaps(structure).tolist() == [[0, 3], [1, 3], [2, 3], [3, 0], [3, 1], [3, 2]]


@pytest.mark.parametrize("spec", ["kd", "bih", "brute", "obb"])
def test_other_structures_are_refused_by_name(spec: str) -> None:
    structure = native.build(*soup(1, 3), spec)
    with pytest.raises(native.SpecError, match=f"structure: {spec} has no boxes .*; bvh-sah has"):
        structure.closest_points(np.zeros((1, 3)))
    for call in (lambda: structure.points_within(np.zeros((1, 3)), 1), lambda: structure.overlaps(structure)):
        with pytest.raises(native.SpecError, match="bvh-sah has"):
            call()


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Tubes around curves and spheres around points, as triangles."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from addon.core.scene import spheres, tubes
from addon.core.scene.faulty import faulty


def some_curves(*, straight: bool = False, radius: float = 0.05) -> tubes.Strands:
    """Forty curves of two to six points."""
    rng = np.random.default_rng(4)
    counts = np.arange(40) % 5 + 2
    first = np.concatenate([[0], np.cumsum(counts)])
    steps = rng.normal(size=(first[-1], 3)) * 0.4 + (1, 0, 0)
    steps[first[:-1]] *= 5
    points = np.cumsum(steps, axis=0).astype(np.float32)
    return tubes.strands(points, np.full(len(points), radius, np.float32), first, straight=straight)


def outward(positions: Any, normals: Any, triangles: Any) -> Any:
    """The cosine of each triangle's normal with that of its first corner."""
    a, b, c = (positions[triangles[:, i]].astype(float) for i in range(3))
    faces = np.cross(b - a, c - a)
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    return (faces * normals[triangles[:, 0]]).sum(axis=1)


def test_tubes_of_lines_are_closed_around_and_face_outward() -> None:
    curves = some_curves(straight=True, radius=1e-3)
    made = tubes.tubes(curves, 1, 6)
    assert len(made.triangles) == curves.segments * 2 * 6
    assert outward(made.positions, made.normals, made.triangles).min() > 0
    edges = Counter(
        frozenset(edge) for t in made.triangles.tolist() for edge in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))
    )
    assert sum(n == 1 for n in edges.values()) == 2 * 6 * len(curves.counts), "only both ends of a tube are open"
    assert max(edges.values()) == 2


def test_a_straight_tube_is_as_broad_as_its_cylinder_on_average() -> None:
    points = np.array([(0, 0, 0), (0, 0, 10)], np.float32)
    curve = tubes.strands(points, np.full(2, 0.5, np.float32), np.array([0, 2]), straight=True)
    for sides in (3, 4, 8):
        ring = tubes.tubes(curve, 1, sides).positions[:sides, :2]
        turns = np.linspace(0, math.pi, 1000, endpoint=False)
        breadth = np.ptp(ring @ np.stack([np.cos(turns), np.sin(turns)]), axis=0)
        assert breadth.mean() == pytest.approx(1.0, rel=1e-4)


def test_splines_pass_through_their_points_and_ends() -> None:
    curves = some_curves()
    made = tubes.tubes(curves, 4, 8)
    rings = made.positions.reshape(-1, 8, 3).mean(axis=1)
    begins = np.flatnonzero(made.share == 0)
    assert np.allclose(rings[begins], curves.points[made.before[begins]], atol=1e-5)
    assert len(begins) == len(curves.points)


def test_polygons_lie_between_the_points_that_they_name() -> None:
    curves = some_curves(straight=True)
    made = tubes.tubes(curves, 3, 8)
    share = made.share[:, None]
    between = curves.points[made.before] * (1 - share) + curves.points[made.after] * share
    assert np.allclose(between, made.positions.reshape(-1, 8, 3).mean(axis=1), atol=1e-5)
    assert (made.polygon_of_corner() == made.triangles // 8).all()


def test_a_spline_is_that_of_catmull_and_rom() -> None:
    points = np.array([(0, 0, 0), (1, 1, 0), (2, 0, 0), (3, 3, 0)], np.float32)
    curve = tubes.strands(points, np.full(4, 0.1, np.float32), np.array([0, 4]))
    rings = tubes.tubes(curve, 2, 8).positions.reshape(-1, 8, 3).mean(axis=1)
    # The middle of the middle segment: -1/16, 9/16, 9/16, -1/16.
    assert np.allclose(rings[3], (-points[0] + 9 * points[1] + 9 * points[2] - points[3]) / 16, atol=1e-5)


def test_frames_are_perpendicular_and_do_not_twist() -> None:
    turn = np.linspace(0, 4 * math.pi, 200)
    points = np.stack([np.cos(turn), np.sin(turn), np.zeros(200)], axis=1)
    right, up = tubes.frames(points, np.array([0, 200]))
    along = points[2:] - points[:-2]
    assert np.abs((right[1:-1] * along).sum(axis=1)).max() < 1e-9
    assert np.abs((right * up).sum(axis=1)).max() < 1e-9
    assert np.allclose(np.linalg.norm(right, axis=1), 1)
    assert np.ptp(right[:, 2]) < 1e-6, "in a plane, the part across it stays"


def test_frames_survive_curves_that_turn_back() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 0, 0), (0, 1, 0)], float)
    assert np.allclose(np.linalg.norm(tubes.frames(points, np.array([0, 5])), axis=2), 1)


def test_tips_without_radius_have_no_triangles_without_area() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0)], np.float32)
    curve = tubes.strands(points, np.array([0, 1, 0], np.float32), np.array([0, 3]), straight=True)
    made = tubes.tubes(curve, 1, 6)
    assert len(made.triangles) == 12
    assert not faulty(made.positions, made.triangles).any()


def test_unusable_curves_are_counted_and_left_out() -> None:
    points = np.zeros((12, 3), np.float32)
    points[:, 0] = np.arange(12)
    points[1, 1] = np.nan
    points[4:6] = 7.0
    radii = np.array([1, 1, 1, -1, 1, 1, 0, 0, np.inf, 1, 1, 1], np.float32)
    curves = tubes.strands(points, radii, np.array([0, 2, 4, 6, 8, 10, 10, 11, 12]))
    sound, broken, negative = tubes.usable(curves, 2.0**63)
    assert (broken, negative) == (2, 1)
    assert sound.numbers.tolist() == [1], "without length, without radius, and of one or no point"
    assert sound.radii.tolist() == [1, 0]


def test_detail_follows_the_size_of_pixels_within_limits() -> None:
    radii = np.array([1e-6, 1.0, 1e9, 0.0, 1.0])
    sides = tubes.sides_of(radii, np.array([1.0, 1e-2, 1.0, 1.0, 0.0])).tolist()
    assert sides[0] == tubes.FEWEST_SIDES
    assert sides[1:3] == [tubes.MOST_SIDES] * 2
    assert tubes.FEWEST_SIDES <= min(sides) <= max(sides) <= tubes.MOST_SIDES
    assert tubes.sides_of(np.array([1.0]), np.array([0.2]))[0] == 13
    curves = some_curves()
    finer = np.stack(
        [tubes.pieces_of(curves, tubes.deviations(curves), np.full(40, size)) for size in (1e3, 1.0, 0.1, 0.0)]
    )
    assert (np.diff(finer, axis=0) >= 0).all()
    assert (finer[0] == 1).all()
    assert (finer[-1] == np.where(curves.counts > 2, tubes.MOST_PIECES, 1)).all()
    lines = some_curves(straight=True)
    assert tubes.pieces_of(lines, tubes.deviations(lines), np.full(40, 1e-9)).max() == 1


def test_pieces_ignore_a_spline_that_stays_on_its_chord() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (10, 0, 0), (11, 0, 0)], np.float32)
    curve = tubes.strands(points, np.full(4, 0.1, np.float32), np.array([0, 4]))
    assert tubes.pieces_of(curve, tubes.deviations(curve), np.array([1e-6])) == 1


def test_joined_tubes_keep_their_own_vertices() -> None:
    curves = some_curves()
    parts = [tubes.tubes(curves.chosen(np.arange(40) % 2 == i), 2, 8 + 2 * i) for i in range(2)]
    whole = tubes.joined(parts)
    ends = whole.positions[whole.triangles]
    assert np.array_equal(ends[: len(parts[0].triangles)], parts[0].positions[parts[0].triangles])
    assert np.array_equal(ends[len(parts[0].triangles) :], parts[1].positions[parts[1].triangles])
    assert set(whole.numbers.tolist()) == set(range(40))


@pytest.mark.parametrize("level", range(4))
def test_spheres_have_the_mean_silhouette_of_a_sphere(level: int) -> None:
    positions, normals, triangles = spheres.sphere(level)
    assert len(triangles) == 20 * 4**level
    assert outward(positions, normals, triangles).min() > 0.7
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a) / 2
    towards = np.random.default_rng(1).normal(size=(500, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    assert (np.abs(areas @ towards.T).sum(axis=0) / 2).mean() == pytest.approx(math.pi, rel=5e-3)


def test_spheres_lie_around_their_centres() -> None:
    centres = np.array([(0, 0, 0), (5, -1, 2)], np.float32)
    positions, normals, triangles = spheres.spheres(centres, np.array([1, 0.1], np.float32), 2)
    assert outward(positions, normals, triangles).min() > 0.9
    second = positions[len(positions) // 2 :]
    assert np.allclose(second.mean(axis=0), centres[1], atol=1e-5)
    assert np.linalg.norm(second - centres[1], axis=1).max() == pytest.approx(0.1, rel=0.02)
    assert [spheres.level_of(r, 1.0) for r in (0.1, 5.0, 50.0, math.inf)] == [1, 2, 3, 4]

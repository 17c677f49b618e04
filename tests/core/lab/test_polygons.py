# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons as triangles: those of all outlines cover the polygon once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.lab.bench import polygons


def star(count: int, seed: int) -> Any:
    """A random outline around the origin, most corners reflex."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    return rng.uniform(0.1, 1, count)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def spiral(turns: int) -> Any:
    """A band that winds around the origin."""
    angles = np.linspace(1, 2 * np.pi * turns, 12 * turns)
    arm = np.stack([np.cos(angles), np.sin(angles)], axis=1) * angles[:, None]
    return np.concatenate([arm, 0.8 * arm[::-1]])


def comb(teeth: int) -> Any:
    """Teeth side by side."""
    top = [(x + dx, y) for x in range(teeth, 0, -1) for dx, y in ((0, 1.0), (-0.3, 5.0), (-0.5, 1.0))]
    return np.array([(0.0, 0.0), (teeth, 0.0), *top])


OUTLINES: dict[str, Any] = {
    "triangle": np.array([(0, 0), (2, 0), (1, 1.0)]),
    "arrow": np.array([(2, 2), (0, 1), (-2, 2), (0, 0.0)]),
    "reflex second": np.array([(0, 0), (2, 2), (0, 1), (-2, 2.0)]),
    "l": np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3.0)]),
    "collinear": np.array([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (2, 2), (1, 2), (0, 2), (0, 1.0)]),
    "collinear and reflex": np.array([(0, 0), (1, 0), (4, 0), (4, 4), (2, 4), (2, 2), (2, 1), (1, 1), (0, 1.0)]),
    "corner twice": np.array([(0, 0), (4, 0), (4, 0), (4, 4), (2, 1), (0, 4.0)]),
    "touches itself": np.array([(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4.0)]),
    # A square with a square hole, joined by a cut that is passed twice; and with two holes.
    "hole": np.array(
        [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (3, 3), (3, 6), (6, 6), (6, 3), (3, 3.0)]
    ),
    "two holes": np.array(
        [(0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1), (0, 0), (9, 0), (9, 9), (8, 8), (8, 6), (6, 6), (6, 8), (8, 8),
         (9, 9), (0, 9.0)]
    ),
    "comb": comb(12),
    "spiral": spiral(4),
    **{f"star {count} {seed}": star(count, seed) for count in (5, 9, 60) for seed in range(3)},
}  # fmt: skip


def area(flat: Any) -> float:
    """The signed area of an outline."""
    x, y = np.asarray(flat, float).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def check(points: Any, flat: Any) -> None:
    """Fail unless triangles of these corners are turned as the outline, and cover its area."""
    count = len(points)
    found = polygons.triangles(points, np.arange(count), np.array([count]))
    assert found.shape == (count - 2, 3)
    areas = np.array([area(flat[triangle]) for triangle in found])
    whole = area(flat)
    assert (np.sign(whole) * areas >= -1e-12 * abs(whole)).all()
    assert areas.sum() == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("name", OUTLINES)
def test_triangles_cover_an_outline_once_from_every_corner_and_side(name: str) -> None:
    outline = OUTLINES[name]
    for flat in (outline, outline[::-1]):
        for shift in range(0, len(flat), max(len(flat) // 6, 1)):
            turned = np.roll(flat, shift, axis=0)
            check(np.insert(turned, shift % 3, 0.5, axis=1), turned)


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1e6, 1e30])
@pytest.mark.parametrize("name", ["arrow", "hole", "comb", "star 60 1"])
def test_the_size_does_not_matter(name: str, scale: float) -> None:
    check(np.insert(scale * OUTLINES[name], 2, 0, axis=1), OUTLINES[name])


@pytest.mark.parametrize("name", ["reflex second", "l", "hole", "spiral", "star 60 2"])
def test_a_polygon_that_is_not_flat_is_cut_as_it_is_seen_along_its_normal(name: str) -> None:
    flat = OUTLINES[name]
    height = 0.05 * np.sin(3 * flat[:, 0] + flat[:, 1])
    check(np.c_[flat, height], flat)


def test_polygons_of_all_sizes_keep_their_order() -> None:
    flat = np.concatenate([OUTLINES[name] for name in ("arrow", "triangle", "l", "star 9 0")])
    counts = np.array([4, 2, 3, 6, 1, 9])
    points = np.insert(flat, 2, 0, axis=1)
    corners = np.r_[0:4, 0, 1, 4:7, 7:13, 5, 13:22]
    found = polygons.triangles(points, corners, counts)
    assert len(found) == 2 + 1 + 4 + 7
    owners = [range(4), range(4, 7), range(7, 13), range(13, 22)]
    assert all(
        set(t) <= set(own) for t, own in zip(np.split(found, [2, 3, 7]), owners, strict=True) for t in [t.ravel()]
    )


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0, 0)] * 5,
        [(0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 3, 3)],
        [(0, 0, 0), (np.nan, 1, 1), (2, 2, 0), (3, 0, 0)],
        [(0, 0, 0), (np.inf, 1, 1), (2, 2, 0), (3, 0, 0)],
        [(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 2, 0)],
        [(np.cos(4 * np.pi * i / 5), np.sin(4 * np.pi * i / 5), 0) for i in range(5)],
    ],
    ids=["point", "line", "nan", "infinite", "bow tie", "pentagram"],
)
def test_degenerate_polygons_become_triangles_all_the_same(points: Any) -> None:
    found = polygons.triangles(np.array(points, float), np.arange(len(points)), np.array([len(points)]))
    assert found.shape == (len(points) - 2, 3)
    assert set(found.ravel()) <= set(range(len(points)))


def test_convex_polygons_stay_fans() -> None:
    angles = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    found = polygons.triangles(points, np.arange(7), np.array([7]))
    assert found.tolist() == [[0, i, i + 1] for i in range(1, 6)]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf cells and ray paths of every structure, against its statistics and its answers."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from addon.core.base import colours
from addon.core.overlay import cells, planes
from tests.kinds import KINDS
from tests.rooms_of_triangles import soup

native = pytest.importorskip("halfspace_native")

RAYS = 40

EARLY = ("bvh-sah", "bih", "brute")
"""Structures in which rays of this test end at a hit before the nearest is known."""

FAMILY = {row["id"]: row["family"] for row in native.structures()}


SOUP = soup(80, 5, box=[4, 3, 2], size=0.3)


def some_rays(seed: int) -> tuple[Any, Any]:
    """Rays from around the soup towards its middle."""
    rng = np.random.default_rng(seed)
    origins = (rng.random((RAYS, 3)) * 8 - 2).astype(np.float32)
    return origins, (np.array([2, 1.5, 1]) + 0.5 * rng.standard_normal((RAYS, 3)) - origins).astype(np.float32)


def faces(found: Any) -> list[list[Any]]:
    """The polygons of each cell, in f64."""
    polygons = np.split(found["vertices"].astype(np.float64), found["offsets"][1:-1].astype(int))
    return [polygons[a:b] for a, b in itertools.pairwise(found["cells"].astype(int))]


def volume(cell: list[Any]) -> float:
    """Volume of a convex cell, from its faces and a point inside."""
    middle = np.mean(np.concatenate(cell), axis=0)
    total = 0.0
    for face in cell:
        spokes = face - middle
        for a, b in itertools.pairwise(spokes[1:]):
            total += abs(np.linalg.det(np.stack([spokes[0], a, b]))) / 6
    return total


@pytest.mark.parametrize("spec", KINDS)
def test_leaves_hold_all_references_and_fill_space(spec: str) -> None:
    tree = native.build(*SOUP, spec)
    every = tree.leaf_cells(0, 1_000_000)
    assert every["hidden"] == 0
    assert every["count"].sum() == tree.statistics["references"]
    assert list(every["count"]) == sorted(every["count"], reverse=True)
    parts = [volume(cell) for cell in faces(every)]
    whole = np.prod(every["vertices"].max(axis=0) - every["vertices"].min(axis=0).astype(np.float64))
    if FAMILY[spec] != "objects":
        assert sum(parts) == pytest.approx(whole, rel=1e-5)
    full = tree.leaf_cells(1, 1_000_000)
    assert len(full["count"]) == (every["count"] > 0).sum()
    few = tree.leaf_cells(1, 3)
    assert few["hidden"] == len(full["count"]) - len(few["count"])
    assert few["count"].tolist() == full["count"][:3].tolist()


@pytest.mark.parametrize("spec", [*KINDS, "kd:nodes=boxes", "bsp-wn-plus-kd:nodes=boxes"])
def test_paths_are_those_of_the_traversal(spec: str) -> None:
    tree = native.build(*SOUP, spec)
    origins, directions = some_rays(6)
    hits = tree.closest(origins, directions, counters=True)
    assert (hits.triangle >= 0).sum() > RAYS // 8
    for i in range(len(origins)):
        found = tree.trace_path(origins[i].tolist(), directions[i].tolist())
        assert (found["t"], found["triangle"]) == (hits.t[i], hits.triangle[i])
        visits = found["visits"]
        ends = visits["triangle_offsets"].astype(int)
        tested = visits["tested"]
        assert np.diff(ends)[tested].sum() == found["counters"]["tests"]
        # The order of rounding may differ between instruction sets, and so may a count or two.
        assert abs(int(found["counters"]["tests"]) - int(hits.counters["tests"][i])) <= 16
        if hits.triangle[i] >= 0:
            owners = np.repeat(np.arange(len(tested)), np.diff(ends))
            assert tested[owners[visits["triangles"] == hits.triangle[i]]].any()
        for cell, enter, leave in zip(faces(visits), visits["enter"], visits["leave"], strict=True):
            if np.isfinite(enter):
                corners = np.concatenate(cell)
                middle = origins[i] + (enter + leave) / 2 * directions[i].astype(np.float64)
                assert (middle >= corners.min(axis=0) - 1e-5).all()
                assert (middle <= corners.max(axis=0) + 1e-5).all()
        if FAMILY.get(spec) in ("space", "octants"):
            spans = np.stack([visits["enter"], visits["leave"]], axis=1)
            spans = spans[np.isfinite(spans).all(axis=1)]
            spans = spans[np.argsort(spans[:, 0])]
            # Each cell ends where the next begins, from the scene's box to the hit.
            assert spans[1:, 0] == pytest.approx(spans[:-1, 1], abs=1e-6)
            if hits.triangle[i] >= 0:
                assert spans[-1, 1] >= hits.t[i] - 1e-6
        crossings = found["crossings"]
        for t, polygon in zip(
            crossings["t"], np.split(crossings["vertices"], crossings["offsets"][1:-1].astype(int)), strict=False
        ):
            assert len(polygon) >= 3
            point = origins[i] + t * directions[i].astype(np.float64)
            assert (point >= polygon.min(axis=0) - 1e-5).all()
            assert (point <= polygon.max(axis=0) + 1e-5).all()


@pytest.mark.parametrize("spec", KINDS)
def test_paths_of_any_hit_rays_end_where_the_traversal_ends(spec: str) -> None:
    tree = native.build(*SOUP, spec)
    origins, directions = some_rays(7)
    occluded = tree.occluded(origins, directions)
    counted = None if spec == "brute" else tree.record(origins, directions, any_hit=True).counters
    nearer = 0
    for i in range(RAYS):
        found = tree.trace_path(origins[i].tolist(), directions[i].tolist(), any_hit=True)
        nearest = tree.trace_path(origins[i].tolist(), directions[i].tolist())
        assert (found["triangle"] >= 0) == occluded[i]
        assert found["t"] >= nearest["t"]
        if counted is not None:
            assert found["counters"] == {name: int(column[i]) for name, column in counted.items()}
        # Each tested leaf is reached after those before it, and the counts agree with the ray's own.
        visits = found["visits"]
        reached = visits["steps"][visits["tested"]].astype(int)
        assert (np.diff(reached) >= 0).all()
        assert reached.max(initial=0) <= found["counters"]["steps"]
        assert not visits["steps"][~visits["tested"]].any()
        nearer += int(found["counters"]["tests"]) < int(nearest["counters"]["tests"])
    assert nearer or spec not in EARLY, "no ray ended before its nearest hit was known"


def test_leaves_that_were_tested_before_a_nearer_hit_was_known_have_an_interval() -> None:
    tree = native.build(*SOUP, "bvh-sah")
    rng = np.random.default_rng(8)
    beyond = 0
    for _ in range(20 * RAYS):
        origin = rng.random(3) * 8 - 2
        found = tree.trace_path(origin.tolist(), (np.array([2, 1.5, 1]) - origin).tolist())
        visits = found["visits"]
        after = visits["enter"] > found["t"]
        assert visits["tested"][after].all()
        assert (visits["leave"][after] > visits["enter"][after]).all()
        beyond += int(after.sum())
    assert beyond


def test_a_path_that_misses_the_scene_is_empty() -> None:
    tree = native.build(*SOUP, "kd")
    found = tree.trace_path([100, 100, 100], [1, 0, 0])
    assert found["triangle"] == -1
    assert len(found["visits"]["enter"]) == 0
    assert len(found["crossings"]["t"]) == 0
    with pytest.raises(ValueError, match="origin"):
        tree.trace_path([np.nan, 0, 0], [1, 0, 0])


@pytest.mark.parametrize("spec", KINDS)
def test_cells_and_paths_become_levels(spec: str) -> None:
    tree = native.build(*SOUP, spec)
    chosen = cells.choose(tree, 1, 600)
    assert 0 < len(chosen) <= 100
    made = cells.levels(chosen, 0.9, 2.0)
    assert sum(len(level.lines) for level in made) == 2 * len(chosen.vertices)
    # The fullest come last, over the others.
    assert made[-1].line_colours[:, 3].max() == max(level.line_colours[:, 3].max() for level in made)
    path = cells.follow(tree, (-3.0, 1.5, 1.0), (1.0, 0.0, 0.0))
    tints = dict.fromkeys(planes.KINDS, (1.0, 1.0, 1.0))
    drawn = cells.path_levels(path, tints, 1.0, 2.0)
    start, end = drawn[-1].lines
    assert start.tolist() == [-3, 1.5, 1]
    assert end[0] == pytest.approx(path.t - 3 if path.triangle >= 0 else end[0])
    assert len(path.lines()) == 4


def test_false_colours_grow_brighter() -> None:
    scale = colours.false_colour(np.linspace(0, 1, 64))
    brightness = scale @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(brightness) > 0).all()
    assert np.array_equal(colours.false_colour(np.array([-1.0, np.nan, 2.0])), scale[[0, 0, -1]])
    few = colours.of_counts(np.array([1, 10, 100]))
    assert np.array_equal(few[-1], scale[-1])
    assert colours.of_counts(np.array([], np.int32)).shape == (0, 3)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that are projected onto the directions of a tree meet the nodes of the generic traversal."""

from __future__ import annotations

import halfspace_native as native
import numpy as np
import pytest

from addon.core.structures import catalogue, specs, ways
from tests.rooms_of_triangles import soup

COUNTERS = ("steps_axis", "steps_oblique", "leaves", "leaves_empty", "tests", "verdicts")


@pytest.mark.parametrize(
    "tree",
    [
        "rbsp:k=3",
        "rbsp",
        "rbsp:k=26,axes_depth=4",
        "rbsp:k=20,set=random,seed=5",
        "rbsp-kd",
        "rbsp-kd:k=26,set=spiral",
        "rbsp:costs=thesis,ties=pbrt,clip=0",
    ],
)
def test_the_nodes_and_the_work_are_those_of_the_generic_traversal(tree: str) -> None:
    scene = soup(1500, 3, box=2)
    rng = np.random.default_rng(4)
    origins = rng.uniform(-1, 3, (3000, 3)).astype(np.float32)
    aims = scene[0][rng.integers(0, len(scene[0]), len(origins))]
    directions = (aims - origins).astype(np.float32)
    # Some rays go along the axes and along diagonals, where speeds along other directions are zero.
    directions[::4] = rng.integers(-1, 2, (len(directions[::4]), 3)) + np.array([0, 0, 2])
    joint = "," if ":" in tree else ":"
    generic, own = (native.build(*scene, f"{tree}{joint}traversal={way}") for way in ("dir", "projected"))
    assert own.validate() == []
    assert own.statistics["nodes_oblique"] == generic.statistics["nodes_oblique"] > 0
    # The numbered nodes are no larger than the nodes that they are made from, but for the table of directions.
    extra = own.statistics["bytes"] - generic.statistics["bytes"]
    assert 8 * own.statistics["leaves"] < extra < 16 * 2 * own.statistics["leaves"] + 1000
    expected, found = (one.closest(origins, directions, counters=True) for one in (generic, own))
    assert np.array_equal(expected.t, found.t)
    assert np.array_equal(expected.triangle, found.triangle)
    assert np.isfinite(found.t).sum() > 500
    assert expected.counters is not None
    assert found.counters is not None
    for name in COUNTERS:
        assert np.array_equal(expected.counters[name], found.counters[name]), name


@pytest.mark.parametrize("tree", ["rbsp", "rbsp-kd:k=26", "rbsp:leaves=scalar", "rbsp-kd:robust=none,leaves=scalar"])
def test_single_rays_are_projected_by_default(tree: str) -> None:
    built = native.build(*soup(3000, 3, box=8, size=0.2), tree)
    assert built.counted_as == "projected"
    structure = catalogue.load()[specs.structure_of(tree)]
    assert "traversal=projected" in str(ways.single(structure, tree))


@pytest.mark.parametrize("way", ["tile", "packet"])
@pytest.mark.parametrize("tree", ["rbsp:k=3", "rbsp", "rbsp:k=26,axes_depth=4", "rbsp-kd:k=26,set=spiral"])
def test_groups_of_rays_meet_the_nodes_and_the_hits_of_the_generic_groups(tree: str, way: str) -> None:
    scene = soup(1500, 3, box=2)
    rng = np.random.default_rng(4)
    directions = (rng.uniform(-0.2, 0.2, (2000, 3)) + np.array([0, 0, 1])).astype(np.float32)
    origins = np.full_like(directions, [1, 1, -1])
    # The second half starts at points of its own.
    origins[1000:] += rng.uniform(0, 0.1, (1000, 3)).astype(np.float32)
    joint = "," if ":" in tree else ":"
    built = [native.build(*scene, f"{tree}{joint}traversal={name}") for name in (way, f"{way}-projected")]
    built.append(native.build(*scene, "brute"))
    generic, own, exact = (one.closest(origins, directions, counters=True) for one in built)
    assert generic.counters is not None
    assert own.counters is not None
    for name in ("t", "triangle", "u", "v"):
        assert np.array_equal(getattr(own, name), getattr(exact, name)), name
    assert np.isfinite(own.t).sum() > 500
    assert own.counters["steps_oblique"].sum() > 0
    if way == "packet":
        for name in COUNTERS:
            assert np.array_equal(generic.counters[name], own.counters[name]), name
    blocked = [one.occluded(origins, directions) for one in built]
    assert np.array_equal(blocked[1], blocked[2])


def test_random_directions_are_drawn_once_for_the_whole_tree() -> None:
    found = native.build(*soup(400, 3, box=2), "rbsp:k=5,set=random,seed=1").analysis()["level_directions_oblique"]
    assert 0 < found.max() <= 5

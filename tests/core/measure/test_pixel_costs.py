# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of wasted tests, overlap, shadow rays and leaf depth, each against single rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.core.measure import costmap
from addon.core.scene import rays
from tests.rooms_of_triangles import WORKLOAD, built

SIZE = (32, 24)


def in_rows(values: Any) -> Any:
    """Values of rays in tiles as a map, rows from the bottom."""
    width, height = SIZE
    picture = np.empty(width * height)
    picture[rays.tile_order(width, height)] = values
    return picture.reshape(height, width)[::-1]


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "octree-net"])
def test_maps_agree_with_single_rays(spec: str) -> None:
    structure = built(spec)[0]
    primary, shadow = rays.make(WORKLOAD, structure, size=SIZE, seed=0, names=("primary", "shadow"))
    found = structure.closest(primary.origins, primary.directions, order="tile8", counters=True)
    hit = found.triangle >= 0
    assert 0 < hit.sum() < len(hit)
    # Tiles that are traced as a whole share their tests.
    alone = structure.closest(primary.origins, primary.directions, counters=True).counters
    tiles = found.counters["tests"].reshape(-1, 64)
    together = not (alone["tests"] == found.counters["tests"]).all()
    wanted = np.repeat(tiles.mean(axis=1), 64) if together else found.counters["tests"]
    assert costmap.measure(structure, WORKLOAD, SIZE, "TESTS") == pytest.approx(in_rows(wanted))
    assert together or spec == "octree-net"
    # A shadow ray for each hit, in the same order.
    _, counters = structure.occluded(
        shadow.origins, shadow.directions, counters=True, t_max=shadow.t_max, order=shadow.order
    )
    wanted = np.zeros(len(hit))
    wanted[hit] = counters["visits"] + counters["tests"]
    assert (costmap.measure(structure, WORKLOAD, SIZE, "ANY_HIT") == in_rows(wanted)).all()
    # The leaf that the traversal tests where the ray ends is as deep as the map states.
    measured = costmap.measure(structure, WORKLOAD, SIZE, "DEPTH")[::-1].reshape(-1)[rays.tile_order(*SIZE)]
    equal = []
    for i in np.flatnonzero(hit)[::7]:
        path = structure.trace_path(primary.origins[i].tolist(), primary.directions[i].tolist())
        visits, t = path["visits"], path["t"]
        ends, near = visits["triangle_offsets"], 1e-5 * path["t"]
        around = np.flatnonzero((visits["enter"] <= t + near) & (visits["leave"] >= t - near))
        holding = [k for k in around if path["triangle"] in visits["triangles"][ends[k] : ends[k + 1]]]
        equal.append(measured[i] == visits["depth"][holding].min())
    assert len(equal) > 10
    assert all(equal)
    assert (measured[~hit] == 0).all()


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "bih", "obb", "grid", "octree-beam", "bsp-wn-plus-kd", "brute"])
def test_wasted_tests_are_a_part_of_the_tests_of_the_same_rays(spec: str) -> None:
    structure = built(spec)[0]
    wasted, tests = (costmap.measure(structure, WORKLOAD, SIZE, key) for key in ("WASTED", "SINGLE_TESTS"))
    assert (wasted <= tests).all()
    assert 0 < wasted.sum() < tests.sum()
    # They are those of rays that are followed one by one.
    (primary,) = rays.make(WORKLOAD, structure, size=SIZE, seed=0, names=("primary",))
    at = tests[::-1].reshape(-1)[rays.tile_order(*SIZE)]
    for i in range(0, len(primary), 37):
        path = structure.trace_path(primary.origins[i].tolist(), primary.directions[i].tolist())
        visits = path["visits"]
        assert at[i] == (np.diff(visits["triangle_offsets"].astype(int)) * visits["tested"]).sum()


def test_a_map_that_is_packed_keeps_every_number() -> None:
    for kind, most in (("<u2", 65535.0), ("<u4", 2.0**32 - 1), ("<f4", 0.25), ("<f8", 2.0**32 + 0.1), ("<f8", 0.1)):
        values = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, most]])
        stored = costmap.packed(values)
        assert stored["type"] == kind
        assert np.array_equal(costmap.unpacked(stored), values)


def test_codes_of_quantities_are_kept_in_files() -> None:
    codes = {one.code: one.key for one in costmap.QUANTITIES}
    names = ["STEPS", "TESTS", "TIME", "WASTED", "OVERLAP", "ANY_HIT", "DEPTH", "SINGLE_TESTS"]
    assert codes == dict(enumerate(names))


def test_only_trees_that_divide_objects_overlap() -> None:
    assert not costmap.measure(built("kd")[0], WORKLOAD, SIZE, "OVERLAP").any()
    assert costmap.measure(built("bvh-sah")[0], WORKLOAD, SIZE, "OVERLAP").max() >= 80

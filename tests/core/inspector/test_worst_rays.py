# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of the rays of a view, their order, the cost of levels, histograms and tables."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from addon.core.base import csv_text
from addon.core.inspector import csv_files, histogram, levels, node_view, ray_costs, replay
from addon.core.overlay import cells
from tests.rooms_of_triangles import SIZE, WORKLOAD, built


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "brute"])
def test_rays_are_counted_one_by_one_and_ordered(spec: str) -> None:
    structure, _ = built(spec)
    gathered = ray_costs.gather(structure, WORKLOAD, SIZE)
    assert list(gathered) == list(ray_costs.SETS)
    for name, costs in gathered.items():
        assert 0 < len(costs) <= SIZE[0] * SIZE[1]
        assert len(np.unique(costs.pixels, axis=0)) == len(costs)
        assert (costs.pixels < SIZE).all()
        for key in ("STEPS", "TESTS"):
            order = ray_costs.worst(costs, key, 20)
            values = costs.values(key)
            assert values[order].tolist() == sorted(values.tolist(), reverse=True)[:20]
        assert costs.rays.any_hit == (name == "shadow")
        index = int(ray_costs.worst(costs, "TESTS", 1)[0])
        ray = costs.rays.origins[index].tolist(), costs.rays.directions[index].tolist()
        path = cells.follow(structure, *ray, float(costs.rays.t_max[index]), any_hit=costs.rays.any_hit)
        assert path.tests == costs.tests[index]
        # All listed leaves with triangles of an any-hit ray were visited.
        assert not costs.rays.any_hit or path.tested[path.cells.count > 0].all()


def test_pixels_are_those_that_the_rays_belong_to() -> None:
    structure, _ = built("kd")
    gathered = ray_costs.gather(structure, WORKLOAD, SIZE)
    primary = gathered["primary"]
    at = {tuple(pixel): index for index, pixel in enumerate(primary.pixels.tolist())}
    found = structure.closest(primary.rays.origins, primary.rays.directions)
    for name in ("shadow", "diffuse"):
        costs = gathered[name]
        owner = [at[tuple(pixel)] for pixel in costs.pixels.tolist()]
        ends = primary.rays.origins[owner] + found.t[owner, None] * primary.rays.directions[owner]
        assert np.abs(ends - costs.rays.origins).max() < 1e-3 * WORKLOAD.diagonal()


def test_the_slowest_rays_come_one_from_each_block(monkeypatch: pytest.MonkeyPatch) -> None:
    structure, _ = built("kd")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    count = len(costs) // ray_costs.BLOCK
    monkeypatch.setattr(ray_costs, "_timed", lambda _structure, parts: np.arange(len(parts), dtype=np.float64))
    times = ray_costs.block_times(structure, costs)
    indices, nanoseconds = ray_costs.slowest(costs, times, 5)
    assert (indices // ray_costs.BLOCK).tolist() == [count - 1 - i for i in range(5)]
    assert nanoseconds.tolist() == [float(count - 1 - i) for i in range(5)]
    work = (costs.steps + costs.tests).reshape(count, -1)
    assert (costs.steps + costs.tests)[indices].tolist() == work.max(axis=1)[::-1][:5].tolist()


def test_every_ray_has_a_rank() -> None:
    structure, _ = built("kd")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["diffuse"]
    times = np.random.default_rng(3).permutation(-(-len(costs) // ray_costs.BLOCK)).astype(np.float64)
    for key in ray_costs.KEYS:
        order, ranks = ray_costs.ranked(costs, key, times)
        assert sorted(order.tolist()) == list(range(len(costs)))
        assert ranks[0] == 1
        if key != "TIME":
            assert ranks.tolist() == list(range(1, len(costs) + 1))
            assert (np.diff(costs.values(key)[order]) <= 0).all()
            continue
        # The rays of a block share its rank; the first of them is the one that is shown.
        assert (np.diff(times[order // ray_costs.BLOCK]) <= 0).all()
        assert (np.diff(ranks) >= 0).all()
        assert ranks[-1] == len(times)
        shown, _ = ray_costs.slowest(costs, times, len(times))
        assert [int(order[np.argmax(ranks == place + 1)]) for place in range(len(times))] == shown.tolist()


def test_times_are_the_shortest_less_that_of_the_call(monkeypatch: pytest.MonkeyPatch) -> None:
    structure, _ = built("bvh-sah")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    blocks = -(-len(costs) // ray_costs.BLOCK)
    # Seconds of an empty call and of the passes of each round, which is slower than the one before.
    seconds = iter([call for slow in range(ray_costs.ROUNDS) for call in (1.0, *(slow + 11.0 + np.arange(blocks)))])
    monkeypatch.setattr(ray_costs, "_seconds", lambda _work: next(seconds))
    indices, nanoseconds = ray_costs.slowest(costs, ray_costs.block_times(structure, costs), 3)
    rays = ray_costs.BLOCK * ray_costs.REPEATS
    assert (indices // ray_costs.BLOCK).tolist() == [blocks - 1, blocks - 2, blocks - 3]
    assert nanoseconds == pytest.approx([1e9 * (blocks + 9 - place) / rays for place in range(3)])


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "octree-param"])
def test_levels_sum_to_the_whole(spec: str) -> None:
    structure, nodes = built(spec)
    primary = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    found = levels.measure(structure, nodes, WORKLOAD, primary)
    analysis = structure.analysis()
    assert sum(level.sah for level in found.levels) == pytest.approx(analysis["sah_nodes"] + analysis["sah_leaves"])
    assert sum(level.sah_share for level in found.levels) == pytest.approx(1)
    assert [level.nodes for level in found.levels][: len(analysis["level_nodes"])] == analysis["level_nodes"].tolist()
    assert [level.leaves for level in found.levels] == analysis["leaf_depths"].tolist()
    overlap = sum(level.overlap for level in found.levels)
    assert abs(overlap - analysis["epo"]) <= 5 * found.overlap_error
    assert sum(level.fitted_nanoseconds or 0.0 for level in found.levels) == pytest.approx(found.prices.measured)
    assert found.prices.step >= 0
    assert found.prices.test >= 0
    mean = primary.tests.mean()
    assert sum(level.tests for level in found.levels) == pytest.approx(mean, rel=0.5)
    assert "1 of 9 answers wrong" in levels.sentences(found, 1, 9)[0]
    for explained, sure in ((levels.CERTAIN, True), (levels.CERTAIN - 0.01, False)):
        fitted = levels.sentences(replace(found, prices=replace(found.prices, explained=explained)))[1]
        assert ("cannot separate" in fitted) != sure
    unsure = replace(found, prices=replace(found.prices, explained=1.0, ends=((1.0, 2.0), (-3.0, 1.0))))
    assert "a test not identifiable (−3.0 to 1.0)" in levels.sentences(unsure)[1]


def test_small_shares_keep_two_digits() -> None:
    texts = [node_view.percent(share) for share in (0, 0.00004321, 0.0099, 0.01, 0.9994)]
    assert texts == ["0.0%", "0.0043%", "0.99%", "1.0%", "99.9%"]


def test_levels_share_the_measured_time(monkeypatch: pytest.MonkeyPatch) -> None:
    structure, nodes = built("kd")
    primary = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    view = replace(primary.rays, order="none")
    counters = structure.closest(view.origins, view.directions, counters=True).counters
    blocks = [counters[name].reshape(-1, 64).mean(axis=1) for name in ("visits", "tests")]
    monkeypatch.setattr(levels.costmap, "nanoseconds", lambda *_: (3 * blocks[0] + 5 * blocks[1]).astype(np.float32))
    found = levels.measure(structure, nodes, WORKLOAD, primary)
    assert (found.prices.step, found.prices.test) == pytest.approx((3, 5), rel=1e-3)
    assert found.prices.explained == pytest.approx(1)
    wanted = float((3 * blocks[0] + 5 * blocks[1]).mean())
    assert sum(level.fitted_nanoseconds or 0.0 for level in found.levels) == pytest.approx(wanted, rel=1e-5)


def test_a_range_selects_pixels_and_states_their_share() -> None:
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    made = histogram.histogram(values, 8.0)
    assert made.counts.sum() == 16
    assert made.counts[-1] == 8  # from 8 on, at the end of the scale
    assert histogram.within(values, 2, 5, 8.0).sum() == 4
    assert histogram.within(values, 2, 8, 8.0).sum() == 14
    drawn = histogram.ranged(values, 2, 5, 8.0)
    grey = np.ptp(drawn, axis=2) == 0
    assert grey.sum() == 12
    assert histogram.sentence(values, 2, 8, 8.0) == "87.5% of the pixels, 99.2% of the sum"


def rows(text: str) -> list[dict[str, Any]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_tables_hold_every_node_ray_step_and_pixel() -> None:
    structure, nodes = built("kd")
    made = rows(csv_text.text(csv_files.nodes(nodes)))
    assert len(made) == len(nodes)
    assert sum(float(row["sah"]) for row in made) == pytest.approx(nodes.costs.sum())
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["shadow"]
    times = csv_files.Times(np.arange(-(-len(costs) // ray_costs.BLOCK)) + 0.5, 2, 9)
    made = rows(csv_text.text(csv_files.rays(costs, "TESTS", times)))
    assert [int(row["tests"]) for row in made] == sorted(costs.tests.tolist(), reverse=True)
    assert [int(row["rank"]) for row in made] == list(range(1, len(costs) + 1))
    for row in made:
        index = int(row["ray"])
        assert row["kind"] == "shadow"
        assert (int(row["column"]), int(row["row"])) == tuple(costs.pixels[index])
        assert (int(row["steps"]), int(row["tests"])) == (costs.steps[index], costs.tests[index])
        assert float(row["nanoseconds"]) == index // ray_costs.BLOCK + 0.5
        assert (row["wrong_answers"], row["compared_answers"]) == ("2", "9")
    path = cells.follow(structure, [-1.0, -2.0, 2.5], [1.0, 1.1, -0.3])
    found = replay.replay(nodes, path)
    made = rows(csv_text.text(csv_files.steps(nodes, found)))
    assert sum(int(row["tests"]) for row in made) == path.tests
    made = rows(csv_text.text(csv_files.pixels({"a": np.array([[0.0, 1.0, 2.0**32], [3.0, 0.1, 1 / 3]])})))
    assert [row["a"] for row in made] == ["3", "0.1", "0.3333333333333333", "0", "1", "4294967296"]  # from the top
    assert csv_text.text([]) == ""

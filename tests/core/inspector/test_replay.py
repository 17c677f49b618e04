# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of single rays against the traversal's own counters."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from addon.core.base import native
from addon.core.inspector import ray_costs, reasons, replay
from addon.core.overlay import cells
from addon.core.tree import table
from addon.core.tree.table import LEAF
from tests.rooms_of_triangles import SIZE, WORKLOAD, built

SPECS = ["kd", "bsp-wn-plus-kd", "bvh-sah", "bih", "obb", "octree-param", "grid", "brute"]
EXACT = {"kd", "bsp-wn-plus-kd", "bvh-sah"}
"""Structures whose traversals count one step for each inner node on the ray."""


def replayed(structure: Any, nodes: Any, costs: Any, index: int) -> tuple[Any, Any]:
    """The path of the ray at `index`, and its steps."""
    path = cells.follow(structure, costs.rays.origins[index].tolist(), costs.rays.directions[index].tolist())
    return path, replay.replay(nodes, path)


@pytest.mark.parametrize("spec", SPECS)
def test_steps_are_those_that_the_traversal_counts(spec: str) -> None:
    structure, nodes = built(spec)
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    inner = counted = 0
    for index in range(0, len(costs), 37):
        path, made = replayed(structure, nodes, costs, index)
        assert made.tested(len(made)) == path.tests == costs.tests[index]
        reached = [step.reached for step in made.steps if step.tests]
        assert reached == path.reached[path.tested].tolist()
        assert [step.leaf for step in made.steps if step.leaf >= 0] == list(range(len(path.cells)))
        rows = [step.node for step in made.steps]
        assert len(set(rows)) == len(rows)
        # Parents come before their children.
        assert all(nodes.parent[row] < 0 or nodes.parent[row] in rows[:place] for place, row in enumerate(rows))
        assert all((nodes.kind[step.node] == LEAF) == (step.leaf >= 0) for step in made.steps)
        inner, counted = inner + made.inner(len(made)), counted + path.steps
    assert spec not in EXACT or abs(inner - counted) <= 0.03 * counted
    assert spec == "brute" or inner


@pytest.mark.parametrize("spec", ["kd", "bsp-wn-plus-kd", "bvh-sah"])
def test_each_leaf_of_a_path_is_found_among_the_nodes(spec: str) -> None:
    structure, nodes = built(spec)
    path = cells.follow(structure, [-1.0, -2.0, 2.5], [1.0, 1.1, -0.3])
    assert len(path.cells) > 1
    offsets = structure.trace_path([-1.0, -2.0, 2.5], [1.0, 1.1, -0.3])["visits"]
    for visit, leaf in enumerate(replay.leaves(nodes, path)):
        start, end = offsets["triangle_offsets"][visit : visit + 2]
        assert sorted(offsets["triangles"][start:end].tolist()) == sorted(
            nodes.triangles[nodes.triangle_offsets[leaf] : nodes.triangle_offsets[leaf + 1]].tolist()
        )


def test_a_step_states_its_interval_and_its_tests() -> None:
    structure, nodes = built("kd")
    path = cells.follow(structure, [-1.0, -2.0, 2.5], [1.0, 1.1, -0.3])
    made = replay.replay(nodes, path)
    first = made.steps[0]
    enter, leave = replay.span(nodes, path, 0)
    assert (first.node, first.enter, first.leave) == (0, enter, leave)
    for t in (enter, leave):
        point = path.origin + t * path.direction
        assert (np.abs(np.concatenate([point, point]) - nodes.bounds[0]) < 1e-6).any()
    assert replay.words(nodes, first)[0].startswith("Node 0: ")
    full = next(step for step in made.steps if step.tests)
    assert replay.words(nodes, full)[-2:] == [
        f"{full.tests} of {nodes.counts[full.node]} triangles tested",
        f"Counted by then: {full.reached} inner nodes",
    ]


@pytest.mark.parametrize("spec", ["kd", "bvh-sah"])
def test_a_hit_on_the_side_of_its_leaf_lies_in_it(spec: str) -> None:
    corners = np.array(list(itertools.product((-1, 1), repeat=3)), np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))], np.int32)
    structure = native.load().build(corners, triangles, spec)
    nodes = table.read(structure, corners, triangles)
    origin = np.array([7.3589, -6.9258, 4.9583], np.float32)
    path = cells.follow(structure, origin.tolist(), (-origin / np.linalg.norm(origin)).tolist())
    assert (path.enter > path.t).all(), "the hit is rounded to a parameter before the leaf"
    step = replay.replay(nodes, path).steps[-1]
    assert step.enter == step.leave == pytest.approx(path.t, rel=1e-6)
    assert replay.words(nodes, step)[1] == f"Ray interval: {path.t:.4g} to {path.t:.4g}"


def test_a_ray_that_misses_the_scene_visits_nothing_or_the_root() -> None:
    structure, nodes = built("bvh-sah")
    path = cells.follow(structure, [0.0, 0.0, 100.0], [0.0, 0.0, 1.0])
    made = replay.replay(nodes, path)
    assert made.tested(len(made)) == 0
    assert np.isnan(replay.span(nodes, path, 0)).all()
    lines = reasons.reasons(nodes, path, made)
    assert lines[0] == "It hits nothing"
    assert all("diagonal" in line or "along" in line for line in lines[1:])


def test_reasons_name_the_work_in_vain() -> None:
    structure, nodes = built("bvh-sah")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    hit = structure.closest(costs.rays.origins, costs.rays.directions).triangle >= 0
    index = next(int(one) for one in ray_costs.worst(costs, "TESTS", 500) if hit[one])
    path, made = replayed(structure, nodes, costs, index)
    lines = reasons.reasons(nodes, path, made)
    # Count the tests in leaves without the hit independently, from the native path.
    visits = structure.trace_path(path.origin.tolist(), path.direction.tolist())["visits"]
    ends = visits["triangle_offsets"]
    sizes = np.diff(ends.astype(int)) * visits["tested"]
    holds = [path.triangle in visits["triangles"][a:b] for a, b in itertools.pairwise(ends)]
    share = sizes[~np.array(holds)].sum() / sizes.sum()
    assert 0.15 < share < 1
    assert any(line.startswith(f"{share:.0%} of the tests are in ") for line in lines)
    assert reasons.summary(costs, index)[2].startswith(f"{costs.tests[index]:,} tests, ")
    median = np.median(costs.tests[costs.tests > 0])
    assert f", {costs.tests[index] / median:.1f} times the median" in reasons.summary(costs, index)[2]
    # The tests in vain are compared with the usual share.
    wasted = f"{costs.wasted[index]:,} tests wasted, {costs.wasted[index] / costs.tests[index]:.0%} of its own"
    usual = costs.wasted.sum() / costs.tests.sum()
    assert reasons.summary(costs, index)[3] == f"{wasted}; {usual:.0%} of those of all these rays"
    assert f"It hits triangle {path.triangle:,} at distance {path.t:.4g}" in lines


def test_reasons_begin_with_the_quantity_of_the_order() -> None:
    structure, nodes = built("kd")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    orders = []
    for index in ray_costs.worst(costs, "STEPS", 50).tolist():
        path, made = replayed(structure, nodes, costs, index)
        by_steps, by_tests = (reasons.reasons(nodes, path, made, key) for key in ("STEPS", "TESTS"))
        assert sorted(by_steps) == sorted(by_tests)
        if any("of the tests" in line for line in by_steps) and any("empty leaves" in line for line in by_steps):
            orders.append((by_steps, by_tests))
    assert orders
    assert all("of the tests" not in by_steps[0] and "of the tests" in by_tests[0] for by_steps, by_tests in orders)


def test_steps_that_the_counters_lack_are_explained() -> None:
    structure, nodes = built("kd")
    costs = ray_costs.gather(structure, WORKLOAD, SIZE)["primary"]
    more = 0
    for index in ray_costs.worst(costs, "STEPS", 50).tolist():
        _, made = replayed(structure, nodes, costs, index)
        note = replay.against(made, int(costs.steps[index]))
        difference = len(made) - int(costs.steps[index])
        # What is shown beyond the count are empty leaves.
        empty = sum(step.leaf >= 0 and not nodes.counts[step.node] for step in made.steps)
        assert difference <= empty
        assert note.startswith(
            f"{difference} of them" if difference > 0 else f"{-difference} more" if difference else ""
        )
        assert bool(note) == bool(difference)
        more += difference > 0
    assert more

# SPDX-License-Identifier: GPL-3.0-or-later
"""Counters explain a time only if they are those of the timed traversal."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import benchmark, counting
from addon.core.report import costs, report
from addon.core.scene import grid, rays
from addon.core.structures import catalogue, ways
from addon.lab.report import plots
from tests.report_rows import everything, row

NAMES = [row["id"] for row in halfspace_native.structures()]


def marked(*chosen: str) -> dict[str, dict[str, bool]]:
    """For each configuration and ray set, the mark of its row that the counters are of the timed traversal."""
    options = benchmark.Options(size=(16, 16), repeats=1, check_rays=64)
    found = benchmark.measure(halfspace_native, grid.workload(2, 64), chosen, options, lambda _: None)
    return {
        one["spec"]: {name: column["counts_timed_walk"] for name, column in one["rays"].items() if name != "walls"}
        for one in found
    }


def test_a_row_marks_counters_of_the_timed_traversal() -> None:
    alone = dict.fromkeys(rays.NAMES, True)
    chosen = ("kd:traversal=dir", "kd:traversal=packet", "kd:shadow=beam,traversal=dir", "octree-net", "octree-beam")
    assert marked(*chosen) == dict.fromkeys(chosen, alone)


@pytest.mark.parametrize("name", NAMES)
def test_kernels_that_do_not_count_themselves_count_single_rays(name: str) -> None:
    """Where a kernel does not count itself, the counters are those of single rays; else the mark would be wrong."""
    one = catalogue.load()[name]
    scene = grid.workload(3, 64)
    singles = {way.nodes: ways.spelled(one, name, way) for way in one.ways if way.rays == "single"}
    for way in one.ways:
        tree = halfspace_native.build(scene.vertices, scene.triangles, ways.spelled(one, name, way))
        for some in rays.make(scene, tree, size=(32, 32), seed=1, names=("primary", "shadow", "diffuse")):
            route = tree.routes[counting.kind_of(some)]
            assert route["nodes"] == way.nodes
            if route["counted"]:
                continue
            single = halfspace_native.build(scene.vertices, scene.triangles, singles[way.nodes])
            assert np.array_equal(_steps(tree, some), _steps(single, some)), (name, way.traversal, some.name)


def _steps(tree: Any, some: rays.RaySet) -> Any:
    arguments: dict[str, Any] = {"t_max": some.t_max, "order": some.order, "counters": True}
    if some.any_hit:
        return tree.occluded(some.origins, some.directions, **arguments)[1]["steps"]
    return tree.closest(some.origins, some.directions, **arguments).counters["steps"]


def finding(*rows: dict[str, Any]) -> str:
    """The sentence on primary rays in the findings of these rows."""
    return next(text for text in report.findings(list(rows)) if ": Primary" in text)


def test_counters_of_another_traversal_explain_nothing() -> None:
    rows = row("a", 4.0), row("b", 2.0)
    assert "because its steps are cheaper: it needs about as many" in finding(*rows)
    rows[0]["rays"]["primary"]["counts_timed_walk"] = False
    words = "counters do not explain it: rays of a are counted one by one, though they may be traced together."
    assert words in finding(*rows)
    assert "because" not in finding(*rows)
    # Nor do counters without steps.
    rows = row("a", 4.0), row("b", 2.0)
    for one in rows:
        one["rays"]["primary"] |= {"steps": 0.0, "tests": 0.0}
    assert finding(*rows).endswith("the noise is 1.0 %).")


def test_times_of_traversals_that_are_not_counted_are_not_fitted() -> None:
    rows = [everything(f"bsp-wn:k={k}", 1.0 + k / 10, k) for k in range(3, 8)]
    rows[0]["rays"]["primary"]["counts_timed_walk"] = False
    (found,) = costs.fits(rows)
    assert found.specs == tuple(one["spec"] for one in rows[1:])
    if plots.problem() is None:
        (picture,) = (one for one in plots.scene_figures(rows) if one.about.title == "Fitted costs")
        words = "Left out, as their rays are counted one by one, though they may be traced together: bsp-wn:k=3."
        assert words in picture.caption


def test_a_remark_names_configurations_counted_in_another_traversal() -> None:
    def build(_vertices: Any, _triangles: Any, spec: str, **_: Any) -> Any:
        """The kernel of camera rays of octrees does not count itself."""
        counted = not spec.startswith("octree")
        return SimpleNamespace(spec=spec, routes={"closest": {"counted": True}, "tiles": {"counted": counted}})

    chosen = {"kd": "kd:traversal=dir", "boxes": "bvh-sah", "a tree": "octree-net"}
    assert counting.remark(chosen, halfspace_native) == ""
    silent: Any = SimpleNamespace(build=build)
    remark = counting.remark(chosen, silent)
    assert remark == " (rays of a tree are counted one by one, though they may be traced together)"

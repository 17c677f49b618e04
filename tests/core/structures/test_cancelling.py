# SPDX-License-Identifier: GPL-3.0-or-later
"""A cancelled monitor ends everything whose work is in proportion to the tree or to the rays."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from tests.kinds import KINDS
from tests.rooms_of_triangles import soup

SPECS = (*KINDS, "kd:traversal=rope", "rbsp:traversal=projected", "octree-beam:traversal=polygon")


def rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the cube in all directions."""
    rng = np.random.default_rng(4)
    return rng.random((count, 3)).astype(np.float32), rng.standard_normal((count, 3)).astype(np.float32)


def works(tree: Any) -> dict[str, Callable[..., Any]]:
    """Everything that inspects a tree, or records its rays, by name."""
    ray = [0.1, 0.2, 0.3], [0.7, 0.5, 0.4]
    names = ("validate", "analysis", "export", "split_polygons", "leaf_cells")
    found: dict[str, Callable[..., Any]] = {name: getattr(tree, name) for name in names}
    found["trace_path"] = lambda **monitor: tree.trace_path(*ray, **monitor)
    if tree.spec != "brute":
        found["record"] = lambda **monitor: tree.record(*rays(100), **monitor).counters
    return found


def queries(tracer: Any) -> list[Callable[..., Any]]:
    """Every way of tracing rays through 300 triangles."""
    some = rays(2048)
    kinds: list[dict[str, Any]] = [{}, {"order": "tile8"}, {"triangle_mask": np.arange(300, dtype=np.uint32)}]
    kinds.append({"counters": True})
    ways = [(ask, kind) for ask in (tracer.closest, tracer.occluded) for kind in kinds]
    ways += [(tracer.all_hits, {}), (tracer.count_hits, {})]
    return [lambda ask=ask, kind=kind, **monitor: ask(*some, **kind, **monitor) for ask, kind in ways]


def words(found: Any) -> str:
    """A result as text, arrays in full."""
    if isinstance(found, tuple):
        return repr([*map(words, found)])
    if isinstance(found, native.Hits):
        return words((found.t, found.triangle, found.u, found.v))
    if isinstance(found, dict):
        return repr({key: words(value) for key, value in found.items()})
    return repr(found.tobytes() if isinstance(found, np.ndarray) else found)


@pytest.mark.parametrize("spec", SPECS)
def test_a_monitor_changes_no_result_and_cancels_all_work(spec: str) -> None:
    tree: Any = native.build(*soup(300, 3, size=0.02), spec)
    placed = native.build_instances([tree], np.zeros(1, np.int32), np.eye(4)[None])
    cancelled = native.Monitor()
    cancelled.cancel()
    for name, work in [*works(tree).items(), *(("rays", one) for each in (tree, placed) for one in queries(each))]:
        assert words(work()) == words(work(monitor=native.Monitor())), name
        # Without a tree, there may be no loop to cancel.
        if spec != "brute" or name in ("validate", "trace_path", "rays"):
            with pytest.raises(native.Cancelled):
                work(monitor=cancelled)


def cancelled_within(work: Callable[[native.Monitor], Any], seconds: float = 0.05) -> native.Monitor:
    """Cancel work shortly after its begin; it must end by that."""
    monitor = native.Monitor()
    timer = threading.Timer(seconds, monitor.cancel)
    timer.start()
    with pytest.raises(native.Cancelled):
        work(monitor)
    timer.join()
    return monitor


@pytest.mark.parametrize("spec", [one for one in SPECS if not one.startswith(("kd-", "bsp", "bbox", "beam"))])
def test_counted_rays_end_before_all_are_traced(spec: str) -> None:
    tree: Any = native.build(*soup(20_000, 3, size=0.02), spec)
    placed = native.build_instances([tree], np.zeros(1, np.int32), np.eye(4)[None])
    some = rays(2_000_000)
    for tracer in (tree, placed):
        for trace in (tracer.closest, tracer.occluded):
            cancelled_within(lambda monitor, trace=trace: trace(*some, counters=True, threads=1, monitor=monitor))


def test_builds_and_rays_are_cancelled_from_another_thread() -> None:
    scene = soup(200_000, 3, size=0.02)
    monitor = cancelled_within(lambda monitor: native.build(*scene, "kd-sah", threads=1, monitor=monitor), 0.02)
    assert monitor.cancelled
    assert monitor.progress < 1
    # Without the cancel, these rays meet 4e11 triangles.
    tree, some = native.build(*scene, "brute"), rays(2_000_000)
    for trace in (tree.closest, tree.occluded, tree.all_hits, tree.count_hits):
        cancelled_within(lambda monitor, trace=trace: trace(*some, threads=1, monitor=monitor), 0.02)

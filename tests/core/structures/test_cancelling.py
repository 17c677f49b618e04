# SPDX-License-Identifier: GPL-3.0-or-later
"""A cancelled monitor ends everything whose work is in proportion to the tree or to the rays."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

SPECS = (
    "brute",
    "kd",
    "kd:traversal=rope",
    "rbsp:traversal=projected",
    "bvh-sah",
    "obb",
    "bih",
    "bih-obl",
    "octree-net",
    "octree-beam:traversal=polygon",
    "grid",
)


def soup(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Small triangles in a cube."""
    rng = np.random.default_rng(3)
    corners = rng.random((count, 1, 3)) + 0.02 * rng.standard_normal((count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the cube in all directions."""
    rng = np.random.default_rng(4)
    return rng.random((count, 3)).astype(np.float32), rng.standard_normal((count, 3)).astype(np.float32)


def works(tree: Any) -> dict[str, Callable[..., Any]]:
    """Everything that inspects a tree, or records its rays, by name."""
    ray = [0.1, 0.2, 0.3], [0.7, 0.5, 0.4]
    found: dict[str, Callable[..., Any]] = {
        "validate": tree.validate,
        "analysis": tree.analysis,
        "export": tree.export,
        "split_polygons": tree.split_polygons,
        "leaf_cells": tree.leaf_cells,
        "trace_path": lambda **monitor: tree.trace_path(*ray, **monitor),
    }
    if tree.spec != "brute":
        found["record"] = lambda **monitor: tree.record(*rays(100), **monitor).counters
    return found


def words(found: Any) -> str:
    """A result as text, arrays in full."""
    if isinstance(found, dict):
        return repr({key: words(value) for key, value in found.items()})
    return repr(found.tobytes() if isinstance(found, np.ndarray) else found)


@pytest.mark.parametrize("spec", SPECS)
def test_a_monitor_changes_no_result_and_cancels_all_inspections(spec: str) -> None:
    tree = native.build(*soup(300), spec)
    cancelled = native.Monitor()
    cancelled.cancel()
    for name, work in works(tree).items():
        assert words(work()) == words(work(monitor=native.Monitor())), name
        # Without a tree, there may be no loop to cancel.
        if spec != "brute" or name in ("validate", "trace_path"):
            with pytest.raises(native.Cancelled):
                work(monitor=cancelled)


def cancelled_within(work: Callable[[native.Monitor], Any]) -> None:
    """Cancel work shortly after its begin; it must end by that."""
    monitor = native.Monitor()
    timer = threading.Timer(0.05, monitor.cancel)
    timer.start()
    with pytest.raises(native.Cancelled):
        work(monitor)
    timer.join()


@pytest.mark.parametrize("spec", SPECS)
def test_counted_rays_end_before_all_are_traced(spec: str) -> None:
    tree: Any = native.build(*soup(20_000), spec)
    placed = native.build_instances([tree], np.zeros(1, np.int32), np.eye(4)[None])
    some = rays(2_000_000)
    for tracer in (tree, placed):
        for trace in (tracer.closest, tracer.occluded):
            cancelled_within(lambda monitor, trace=trace: trace(*some, counters=True, threads=1, monitor=monitor))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of every camera, shadow and bounce ray of a view, and which of them cost most.

Steps and tests are those of rays traced one by one, as the replay shows them. Time is that of the rays as they are
traced for a picture, in tiles or streams, and has one value for 64 neighbours.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..measure import counting
from ..scene import rays
from ..scene.workload import Workload

if TYPE_CHECKING:
    from ..base.interface import Structure

SETS = {"primary": "Camera", "shadow": "Shadow", "diffuse": "Bounce"}
"""The ray sets of the inspector, with their names on panels."""

KEYS = {"STEPS": "steps", "TESTS": "tests", "TIME": "ns"}
"""The orders of rays, with the unit of the numbers."""

BLOCK = rays.TILE**2
"""Number of rays that are timed together."""

REPEATS, ROUNDS = 8, 5
"""Times that rays are traced in one timed call, and number of calls, of which the shortest counts."""


@dataclass(frozen=True, eq=False)
class RayCosts:
    """The rays of one set.

    rays: (n,) of them. pixels: (n, 2), column and row of the pixel each belongs to, from the top left. steps: nodes
    visited, leaves included. tests: triangles tested; wasted: those of visits of leaves that found no nearer hit.
    """

    rays: rays.RaySet
    pixels: NDArray[np.int64]
    steps: NDArray[np.int64]
    tests: NDArray[np.int64]
    wasted: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.rays)

    def values(self, key: str) -> NDArray[np.int64]:
        """(n,), the counter of a key other than TIME."""
        return self.steps if key == "STEPS" else self.tests


def gather(structure: Structure, workload: Workload, size: tuple[int, int]) -> dict[str, RayCosts]:
    """The costs of each set of SETS, of a view of `size` pixels, multiples of 8."""
    width, height = size
    made = rays.make(workload, structure, size=size, seed=0, names=tuple(SETS))[: len(SETS)]
    primary = made[0]
    tiles = rays.tile_order(width, height)
    hit = structure.closest(primary.origins, primary.directions, order=primary.order).triangle >= 0
    # Shadow rays keep the order of tiles, bounces that of scanlines.
    pixels = {"primary": tiles, "shadow": tiles[hit], "diffuse": np.sort(tiles[hit])}
    found = {}
    for some in made:
        places = pixels[some.name]
        if len(places) != len(some):
            raise ValueError(f"{some.name}: expected {len(places)} rays, got {len(some)}")
        found[some.name] = _counted(structure, some, np.stack([places % width, places // width], axis=1))
    return found


def again(structure: Structure, costs: RayCosts) -> RayCosts:
    """The costs of the same rays in another structure over the same triangles."""
    return _counted(structure, costs.rays, costs.pixels)


def _counted(structure: Structure, some: rays.RaySet, pixels: NDArray[np.int64]) -> RayCosts:
    """The costs of these rays, each traced alone."""
    counters = counting.alone(structure, some)
    columns = [counters[name].astype(np.int64) for name in ("visits", "tests", "tests_wasted")]
    return RayCosts(some, pixels, *columns)


def worst(costs: RayCosts, key: str, count: int) -> NDArray[np.int64]:
    """Indices of the rays with the largest steps or tests, the largest first; of equal ones the first."""
    return np.argsort(-costs.values(key), kind="stable")[:count]


def block_times(structure: Structure, costs: RayCosts) -> F64:
    """(b,), the nanoseconds per ray of each block of BLOCK consecutive rays, the last of which may have fewer."""
    starts = range(0, len(costs), BLOCK)
    blocks = [np.arange(start, min(start + BLOCK, len(costs))) for start in starts]
    return _timed(structure, [costs.rays.take(np.tile(block, REPEATS)) for block in blocks]) if blocks else np.zeros(0)


def ranked(costs: RayCosts, key: str, nanoseconds: F64) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(n,) the indices of all rays from the worst on, and (n,) the rank of each, from 1.

    nanoseconds: from `block_times`. By TIME the rays of a block share its rank; the one with most steps and tests is
    the first of them.
    """
    if key != "TIME":
        return worst(costs, key, len(costs)), np.arange(1, len(costs) + 1)
    place = np.empty(len(nanoseconds), np.int64)
    place[np.argsort(-nanoseconds, kind="stable")] = np.arange(1, len(nanoseconds) + 1)
    ranks = place[np.arange(len(costs)) // BLOCK]
    order = np.lexsort((-(costs.steps + costs.tests), ranks))
    return order, ranks[order]


def slowest(costs: RayCosts, nanoseconds: F64, count: int) -> tuple[NDArray[np.int64], F64]:
    """The first ray of each of the `count` first ranks by TIME, and the nanoseconds per ray of their blocks."""
    order, ranks = ranked(costs, "TIME", nanoseconds)
    found = order[np.unique(ranks, return_index=True)[1]][:count]
    return found, nanoseconds[found // BLOCK]


def _timed(structure: Structure, parts: list[rays.RaySet]) -> F64:
    """(p,), nanoseconds per ray of each part on one thread, the shortest of ROUNDS, without the cost of the call."""
    best, call = np.full(len(parts), np.inf), np.inf
    nothing: Any = np.zeros((1, 3), np.float32)
    for _ in range(ROUNDS):
        call = min(call, _seconds(lambda: structure.closest(nothing, nothing, threads=1)))
        for i, part in enumerate(parts):
            trace = structure.occluded if part.any_hit else structure.closest
            best[i] = min(best[i], _seconds(lambda: trace(part.origins, part.directions, **part.options(1))))  # noqa: B023
    nanoseconds: F64 = 1e9 * np.maximum(best - call, 0.0) / np.array([len(part) for part in parts])
    return nanoseconds


def _seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start

# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected cost, end-point overlap and fitted time of each level of a tree.

Time is measured for blocks of 64 camera rays, which need not be tiles, and fitted as a sum over visited nodes
and triangle tests (Hoobergs 2019, eq. 3.1). Levels share the mean time of a ray by the steps and tests that a sample of
rays has on each of them: no clock runs on a level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import F64
from ..measure import costmap, counting
from ..measure.analysis import fitting
from ..overlay import cells
from ..scene.rays import RaySet
from ..scene.workload import Workload
from ..tree import location
from ..tree.table import LEAF, Table
from . import replay as replaying
from .ray_costs import BLOCK, RayCosts

if TYPE_CHECKING:
    from ..base.interface import Structure

CERTAIN = 0.8
"""R² from which the two prices are taken for those of nodes and of tests (chosen)."""

LEAST_EXPLAINED = 0.5
"""R² below which the fit explains too little for times of levels (chosen)."""

SAMPLE, SEED = 192, 7
"""Number of camera rays whose steps are counted by level, and the seed of their choice."""


@dataclass(frozen=True)
class Level:
    """One level. sah: expected cost, and sah_share of the whole tree's. overlap: end-point overlap. steps, tests: of a
    camera ray, mean over the sample. fitted_nanoseconds: of a camera ray, by the fitted prices; None if the fit
    explains less than LEAST_EXPLAINED.
    """

    level: int
    nodes: int
    leaves: int
    triangles: int
    sah: float
    sah_share: float
    overlap: float
    steps: float
    tests: float
    fitted_nanoseconds: float | None


@dataclass(frozen=True)
class Prices:
    """Fitted nanoseconds of a step and of a test, of `measured` nanoseconds per ray; explained: R² of the fit.

    ends: the lower and upper ends of the intervals of both, where they may be negative.
    """

    step: float
    test: float
    measured: float
    explained: float
    ends: tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Levels:
    """All levels of a tree, from the root. overlap_error: standard error of the sum of overlaps."""

    levels: tuple[Level, ...]
    prices: Prices
    overlap_error: float

    def rows(self, wrong: int, compared: int) -> Iterator[dict[str, float | None]]:
        """The levels as dictionaries, for files: each with the quality of the fit and the errors of the structure."""
        errors = {"explained": self.prices.explained, "wrong_answers": wrong, "compared_answers": compared}
        for level in self.levels:
            yield asdict(level) | errors


def measure(structure: Structure, table: Table, workload: Workload, primary: RayCosts) -> Levels:
    """The levels of a structure over the workload's triangles. primary: the costs of its camera rays."""
    points, owners = location.surface(workload.vertices, workload.triangles)
    overlap = location.overlap(table, points, owners)
    depth = len(overlap)
    steps, tests = _by_level(structure, table, primary, depth)
    prices = _prices(structure, replace(primary.rays, order="none"))
    # Share the measured time by the fitted prices.
    weights = prices.step * steps + prices.test * tests
    fits = weights.sum() > 0 and prices.explained >= LEAST_EXPLAINED
    shared = prices.measured * weights / weights.sum() if fits else None
    costs, triangles = (np.bincount(table.depth, weights, depth) for weights in (table.costs, table.counts))
    leaves = np.bincount(table.depth[table.kind == LEAF], minlength=depth)
    nodes = np.bincount(table.depth, minlength=depth)
    whole = float(costs.sum())
    means = overlap.mean(axis=1) if len(points) else np.zeros(depth)
    found = tuple(
        Level(
            level,
            int(nodes[level] - leaves[level]),
            int(leaves[level]),
            int(triangles[level]),
            float(costs[level]),
            float(costs[level]) / whole if whole else 0.0,
            float(means[level]),
            float(steps[level]),
            float(tests[level]),
            None if shared is None else float(shared[level]),
        )
        for level in range(depth)
    )
    sums = overlap.sum(axis=0)
    error = float(sums.std() / np.sqrt(len(sums))) if len(sums) else 0.0
    return Levels(found, prices, error)


def _by_level(structure: Structure, table: Table, primary: RayCosts, depth: int) -> tuple[F64, F64]:
    """Steps and tests per level of a ray, means over a sample of the rays."""
    rng = np.random.default_rng(SEED)
    chosen = rng.choice(len(primary), min(SAMPLE, len(primary)), replace=False)
    steps, tests = np.zeros(depth), np.zeros(depth)
    for index in chosen:
        origin, direction = (part[index].tolist() for part in (primary.rays.origins, primary.rays.directions))
        found = replaying.replay(table, cells.follow(structure, origin, direction))
        for step in found.steps:
            steps[step.depth] += 1
            tests[step.depth] += step.tests
    count = max(len(chosen), 1)
    return steps / count, tests / count


def _prices(structure: Structure, view: RaySet) -> Prices:
    """The fit of the measured time of each block of rays."""
    nanoseconds, counters = costmap.nanoseconds(structure, view), counting.counters(structure, view, 0)
    blocks = len(nanoseconds)
    if not blocks:
        return Prices(0.0, 0.0, 0.0, 0.0, ((-np.inf, np.inf), (-np.inf, np.inf)))
    both = (counters[name][: blocks * BLOCK].reshape(blocks, BLOCK) for name in ("visits", "tests"))
    counts = [values.mean(axis=1, dtype=np.float64) for values in both]
    columns, wanted = np.stack(counts, axis=1), nanoseconds.astype(np.float64)
    fitted = fitting.positive(columns, wanted)
    spread = float(((wanted - wanted.mean()) ** 2).sum())
    rest = float(((wanted - columns @ fitted) ** 2).sum())
    step, test = ((float(low), float(high)) for low, high in fitting.intervals(columns, wanted))
    explained = 1 - rest / spread if spread else 1.0
    return Prices(float(fitted[0]), float(fitted[1]), float(wanted.mean()), explained, (step, test))


def sentences(found: Levels, wrong: int | None = None, checked: int = 0) -> Sequence[str]:
    """The sums of the levels in words. wrong: of `checked` answers, because every time is shown with its errors."""
    prices = found.prices
    answers = "" if wrong is None else f"; {wrong:,} of {checked:,} answers wrong"
    total = sum(level.overlap for level in found.levels)
    step, test = (
        fitting.told(price, *ends) for price, ends in zip((prices.step, prices.test), prices.ends, strict=True)
    )
    fitted = f"Fitted: a node {step}, a test {test} (R² = {prices.explained:.2f})"
    if prices.explained < LEAST_EXPLAINED:
        fitted = f"No time per level: nodes and tests explain too little of it (R² = {prices.explained:.2f})"
    elif prices.explained < CERTAIN:
        fitted += ": the fit cannot separate nodes from tests"
    return (
        f"A camera ray takes {prices.measured:,.0f} ns{answers}",
        fitted,
        f"SAH cost {sum(level.sah for level in found.levels):,.1f}, overlap {total:,.1f} ± {found.overlap_error:.1f}",
    )

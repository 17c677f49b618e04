# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of a step and of a triangle test on this machine, fitted to the measured times of all structures of a scene,
and how well the surface area heuristic orders these times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..measure import counting, yardstick
from ..measure.analysis import field, fitting
from ..measure.rows import Row, agrees

PARTS = {
    "steps_axis": "axis steps",
    "steps_oblique": "oblique steps",
    "steps_boxes": "box steps",
    "leaves": "leaf visits",
    "tests": "triangle tests",
}
"""Counters that take part in the fit, with their labels. It is eq. 3.1 of Hoobergs (2019), which sums steps and tests,
with the visits of leaves.
"""

LEAST_FREEDOM = 2
"""Number of structures beyond that of the parts that occur, at least, for a fit: the intervals come from the residuals.
"""

ALONE, GROUPS = "one by one", "in groups"
"""How rays go: a step of a group is shared, so it has another cost than one of a single ray."""


@dataclass(frozen=True)
class Fit:
    """A linear cost model of the rays that go in one way, ALONE or GROUPS. nanoseconds: cost of one of each of PARTS
    that occur. intervals: of the same costs where they may be negative. measured: (rows,) ns per ray, mean over the ray
    sets. parts: (rows, len(nanoseconds)) ns.

    explained: the share of the variance of the measured times that the fit explains, R². residual: root mean square of
    the relative residuals.
    """

    rays: str
    specs: tuple[str, ...]
    nanoseconds: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    measured: NDArray[np.float64]
    parts: NDArray[np.float64]
    explained: float
    residual: float

    def told(self, key: str) -> str:
        """The cost of a part with its interval."""
        return fitting.told(self.nanoseconds[key], *self.intervals[key])


def fits(rows: Sequence[Row]) -> list[Fit]:
    """The fits of rays that go alone and of rays in groups, over those of one scene's rows whose counters belong to the
    timed traversal; without those of too few rows, see LEAST_FREEDOM.
    """
    return [found for rays in (ALONE, GROUPS) if (found := _fit(rows, rays)) is not None]


def _fit(rows: Sequence[Row], rays: str) -> Fit | None:
    # Collect counts and times per ray of the rows that have both.
    found = [(row["spec"], *_per_ray(row, rays)) for row in rows if row["rays"] and not lacks_timed_counts(row, rays)]
    kept = [(spec, counts, time) for spec, counts, time in found if counts is not None and time > 0]
    if not kept:
        return None
    counts = np.array([one for _, one, _ in kept], np.float64)
    times = np.array([time for _, _, time in kept])
    occur = counts.any(axis=0)
    if len(kept) < int(occur.sum()) + LEAST_FREEDOM:
        return None
    # Minimize relative errors, so that the slowest structure does not dominate.
    counts = counts[:, occur]
    relative, ones = counts / times[:, None], np.ones(len(times))
    prices = fitting.positive(relative, ones)
    ends = [(float(low), float(high)) for low, high in fitting.intervals(relative, ones)]
    parts = counts * prices
    spread = float(((times - times.mean()) ** 2).sum())
    explained = 1.0 - float(((parts.sum(axis=1) - times) ** 2).sum()) / spread if spread else 0.0
    residual = float(np.sqrt((((parts.sum(axis=1) - times) / times) ** 2).mean()))
    keys = [key for key, one in zip(PARTS, occur, strict=True) if one]
    return Fit(
        rays,
        tuple(spec for spec, _, _ in kept),
        dict(zip(keys, map(float, prices), strict=True)),
        dict(zip(keys, ends, strict=True)),
        times,
        parts,
        explained,
        residual,
    )


def lacks_timed_counts(row: Row, rays: str) -> bool:
    """Whether some rays that go in this way were counted in another traversal than the timed one, so that counts and
    times do not match.
    """
    return not all(counting.counts_timed_traversal(row, name) for name in _timed(row, rays))


def _timed(row: Row, rays: str) -> list[str]:
    """The timed ray sets of a row whose rays go in this way; those of rows without ways go alone."""
    ways = row["ways"] or {}
    grouped = {name for name, way in ways.items() if way["rays"] not in ("single", "flight")}
    return [name for name, one in row["rays"].items() if one["mrays_s"] and (name in grouped) == (rays == GROUPS)]


def _per_ray(row: Row, rays: str) -> tuple[NDArray[np.float64] | None, float]:
    """Counts and nanoseconds per ray, each the mean over the ray sets."""
    sets = [(name, row["rays"][name]) for name in _timed(row, rays)]
    found = [[_count(row, name, key) for key in PARTS] for name, _ in sets]
    kept = [(counts, one) for counts, (_, one) in zip(found, sets, strict=True) if None not in counts]
    if not kept:
        return None, 0.0
    counts = np.array([counts for counts, _ in kept], np.float64)
    return counts.mean(axis=0), float(np.mean([1e3 / one["mrays_s"]["med"] for _, one in kept]))


def _count(row: Row, name: str, key: str) -> float | None:
    """The mean number of a part per ray of a set; None if it was not counted. Not all kernels count leaves."""
    known: Any = dict(row["rays"][name]).get(key)
    if known is None:
        known = field.value(row, "rays", name, key, "mean")
    if known is None:
        return 0.0 if key == "leaves" else None
    return float(known)


LEAST_CORRELATED = 3
"""Smallest number of structures for a correlation."""


@dataclass(frozen=True)
class Correlation:
    """Expected cost and measured nanoseconds per ray of the structures of a scene.

    pearson: of the values; spearman: of their ranks; NaN where all values are equal.
    """

    specs: tuple[str, ...]
    expected: NDArray[np.float64]
    measured: NDArray[np.float64]
    pearson: float
    spearman: float


def nanoseconds(row: Row) -> float:
    """Nanoseconds per ray, mean over the ray sets; 0 without times."""
    times = [1e3 / one["mrays_s"]["med"] for one in (row["rays"] or {}).values() if one["mrays_s"]]
    return float(np.mean(times)) if times else 0.0


def expected_cost(row: Row) -> float | None:
    """Expected cost of a random ray in the thesis's units; None if the structure reports none."""
    cost = field.value(row, "tree", "sah") or (row["statistics"] or {}).get("sah_cost")
    return float(cost) if cost else None


def correlation(rows: Sequence[Row]) -> Correlation | None:
    """The correlation over the rows with right answers; None with fewer than LEAST_CORRELATED of them."""
    found = [
        (row["spec"], cost, time)
        for row in rows
        if not yardstick.is_foreign(row["spec"])
        and agrees(row)
        and (cost := expected_cost(row)) is not None
        and (time := nanoseconds(row)) > 0
    ]
    if len(found) < LEAST_CORRELATED:
        return None
    expected, measured = (np.array([one[i] for one in found]) for i in (1, 2))
    return Correlation(
        tuple(spec for spec, _, _ in found),
        expected,
        measured,
        pearson(expected, measured),
        pearson(ranks(expected), ranks(measured)),
    )


def pearson(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Pearson's correlation; NaN where either is constant."""
    with np.errstate(invalid="ignore"):
        return float(np.corrcoef(x, y)[0, 1])


def ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranks from 1; equal values share the mean of theirs."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    means: NDArray[np.float64] = last - (counts - 1) / 2
    return means[inverse]

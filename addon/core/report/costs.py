# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of a step and of a triangle test on this machine, fitted to the measured times of all structures of a scene."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..measure import counting
from ..measure.analysis import field
from ..measure.rows import Row
from ..measure.timing import COUNTERS

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

OPTIONAL = ("steps_boxes", "leaves")
"""Counters that rows of earlier versions lack; they then count as 0."""

LEAST_ROWS = 4
"""Smallest number of structures for a fit."""


@dataclass(frozen=True)
class Fit:
    """A linear cost model. nanoseconds: cost of one of each of PARTS. measured: (rows,) ns per ray, mean over the ray
    sets. parts: (rows, parts) ns.

    explained: the share of the variance of the measured times that the fit explains, R². residual: root mean square of
    the relative residuals.
    """

    specs: tuple[str, ...]
    nanoseconds: dict[str, float]
    measured: NDArray[np.float64]
    parts: NDArray[np.float64]
    explained: float
    residual: float

    def priced(self) -> list[tuple[str, float]]:
        """Singular label and nanoseconds of each part that takes time."""
        return [(PARTS[key].removesuffix("s"), each) for key, each in self.nanoseconds.items() if each > 0]


def fit(rows: Sequence[Row]) -> Fit | None:
    """The fit over those of one scene's rows whose counters belong to the timed traversal.

    None with fewer such rows than LEAST_ROWS, or with no more of them than parts that occur.
    """
    assert set(PARTS) <= {*COUNTERS, *OPTIONAL}
    # Collect counts and times per ray of the rows that have both.
    found = [(row["spec"], *_per_ray(row)) for row in rows if row["rays"] and not lacks_timed_counts(row)]
    kept = [(spec, counts, time) for spec, counts, time in found if counts is not None and time > 0]
    if len(kept) < LEAST_ROWS:
        return None
    counts = np.array([one for _, one, _ in kept], np.float64)
    times = np.array([time for _, _, time in kept])
    if len(kept) <= int(counts.any(axis=0).sum()):
        return None
    # Minimize relative errors, so that the slowest structure does not dominate.
    prices = least_squares(counts / times[:, None], np.ones(len(times)))
    parts = counts * prices
    spread = float(((times - times.mean()) ** 2).sum())
    explained = 1.0 - float(((parts.sum(axis=1) - times) ** 2).sum()) / spread if spread else 0.0
    residual = float(np.sqrt((((parts.sum(axis=1) - times) / times) ** 2).mean()))
    specs = tuple(spec for spec, _, _ in kept)
    return Fit(specs, dict(zip(PARTS, prices, strict=True)), times, parts, explained, residual)


def lacks_timed_counts(row: Row) -> bool:
    """Whether some rays were counted in another traversal than the timed one, so that counts and times do not match."""
    timed = (name for name, one in row["rays"].items() if one["mrays_s"])
    return not all(counting.counts_timed_traversal(row, name) for name in timed)


def _per_ray(row: Row) -> tuple[NDArray[np.float64] | None, float]:
    """Counts and nanoseconds per ray, each the mean over the ray sets."""
    sets = [(name, one) for name, one in row["rays"].items() if one["mrays_s"]]
    found = [[_count(row, name, key) for key in PARTS] for name, _ in sets]
    kept = [(counts, one) for counts, (_, one) in zip(found, sets, strict=True) if None not in counts]
    if not kept:
        return None, 0.0
    counts = np.array([counts for counts, _ in kept], np.float64)
    return counts.mean(axis=0), float(np.mean([1e3 / one["mrays_s"]["med"] for _, one in kept]))


def _count(row: Row, name: str, key: str) -> float | None:
    """The mean number of a part per ray of a set; None if it was not counted."""
    known: Any = dict(row["rays"][name]).get(key)
    if known is None:
        known = field.value(row, "rays", name, key, "mean")
    if known is None:
        return 0.0 if key in OPTIONAL else None
    return float(known)


def least_squares(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """The x >= 0 that minimizes |matrix x - right|, by trying all subsets of its few components."""
    columns = range(matrix.shape[1])
    best, best_error = np.zeros(matrix.shape[1]), float((right**2).sum())
    for size in range(1, matrix.shape[1] + 1):
        for chosen in itertools.combinations(columns, size):
            x = np.zeros(matrix.shape[1])
            x[list(chosen)] = np.linalg.lstsq(matrix[:, chosen], right, rcond=None)[0]
            error = float(((matrix @ x - right) ** 2).sum())
            if (x >= 0).all() and error < best_error:
                best, best_error = x, error
    return best

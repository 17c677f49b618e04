# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected and measured cost: how well the surface area heuristic orders the structures of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..measure import yardstick
from ..measure.analysis import field
from ..measure.rows import Row, agrees

LEAST_ROWS = 3
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
    """The correlation over the rows with right answers; None with fewer than LEAST_ROWS of them."""
    found = [
        (row["spec"], cost, time)
        for row in rows
        if row["spec"] != yardstick.SPEC
        and agrees(row)
        and (cost := expected_cost(row)) is not None
        and (time := nanoseconds(row)) > 0
    ]
    if len(found) < LEAST_ROWS:
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
    dx, dy = x - x.mean(), y - y.mean()
    both = math.sqrt(float((dx**2).sum() * (dy**2).sum()))
    return float((dx * dy).sum()) / both if both > 0 else math.nan


def ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranks from 1; equal values share the mean of theirs."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    means: NDArray[np.float64] = last - (counts - 1) / 2
    return means[inverse]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear fits of costs: least squares without negative coefficients, and what the measurements say about each."""

from __future__ import annotations

import itertools
from statistics import NormalDist

import numpy as np

from ...base.arrays import F64

CONFIDENCE = 0.95
"""Probability that an interval contains its coefficient."""

SINGULAR = 1e-9
"""Share of the largest singular value below which columns depend on each other (chosen)."""


def positive(matrix: F64, right: F64) -> F64:
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


def intervals(matrix: F64, right: F64) -> F64:
    """(columns, 2): the interval of each coefficient of least squares, which may be negative here.

    Infinite where the columns do not determine a coefficient, or no row is left to estimate the residuals.
    """
    norms = np.linalg.norm(matrix, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    columns = matrix / scale
    inverse = np.linalg.pinv(columns, rcond=SINGULAR)
    freedom = len(right) - int(np.linalg.matrix_rank(columns, tol=SINGULAR))
    found = inverse @ right
    # A coefficient is determined if no other combination of columns replaces its column.
    determined = np.einsum("ij,ji->i", inverse, columns) > 1 - 1e-6
    half = np.full(len(found), np.inf)
    if freedom > 0:
        variance = float(((right - columns @ found) ** 2).sum()) / freedom
        half[determined] = student(freedom) * np.sqrt(variance * (inverse**2).sum(axis=1)[determined])
    return np.stack([found - half, found + half], axis=1) / scale[:, None]


def student(freedom: int) -> float:
    """Half the width of the central CONFIDENCE of Student's t distribution, within 1 % for two degrees of freedom or
    more (Abramowitz and Stegun 1964, 26.7.5).
    """
    z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
    terms = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return float(sum(term / float(freedom) ** power for power, term in enumerate(terms)))


def told(price: float, low: float, high: float) -> str:
    """A fitted price in nanoseconds with its interval as text. One whose interval contains zero is not identifiable:
    the measurements do not exclude that it costs nothing.
    """
    span = "" if np.isinf(low) or np.isinf(high) else f" ({low:.1f} to {high:.1f})".replace("-", "−")
    return f"{price:.1f} ns{span}" if low > 0 else f"not identifiable{span}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear fits of costs: least squares without negative coefficients, and what the measurements say about each."""

from __future__ import annotations

import itertools

import numpy as np

from ...base.arrays import F64
from .. import inference

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
    """(columns, 2): the 95 % interval of each coefficient of least squares, which may be negative here.

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
        half[determined] = inference.student_quantile(inference.CONFIDENCE, freedom) * np.sqrt(
            variance * (inverse**2).sum(axis=1)[determined]
        )
    return np.stack([found - half, found + half], axis=1) / scale[:, None]


def told(price: float, low: float, high: float) -> str:
    """A fitted price in nanoseconds with its interval as text. One whose interval contains zero is not identifiable:
    the measurements do not exclude that it costs nothing.
    """
    span = "" if np.isinf(low) or np.isinf(high) else f" ({low:.1f} to {high:.1f})".replace("-", "−")
    return f"{price:.1f} ns{span}" if low > 0 else f"not identifiable{span}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""A false-colour scale from 0 to 1 with monotonically increasing brightness."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import F32, F64

ANCHORS = np.array(
    [
        (0.03, 0.03, 0.12),
        (0.20, 0.10, 0.45),
        (0.50, 0.14, 0.52),
        (0.79, 0.26, 0.40),
        (0.95, 0.48, 0.22),
        (0.98, 0.74, 0.25),
        (0.99, 0.98, 0.78),
    ],
    np.float32,
)
"""Evenly spaced colours of the scale, as displayed (sRGB)."""

CELLS_FROM = 0.3
"""Start of the scale for cells, so that the darkest stay visible in a dark viewport."""


def false_colour(values: NDArray[Any]) -> F32:
    """(..., 3) float32 display values of (...) numbers; values are clamped to 0 to 1, NaN counts as 0."""
    place = np.clip(np.nan_to_num(np.asarray(values, np.float64)), 0, 1) * (len(ANCHORS) - 1)
    below = np.minimum(place.astype(np.int64), len(ANCHORS) - 2)
    part = (place - below)[..., None]
    mixed = ANCHORS[below] * (1 - part) + ANCHORS[below + 1] * part
    made: F32 = mixed.astype(np.float32)
    return made


def of_counts(counts: NDArray[Any]) -> F32:
    """(n, 3) colours of counts on a logarithmic scale: the largest is the brightest, the smallest the darkest."""
    return false_colour(CELLS_FROM + (1 - CELLS_FROM) * shares(counts))


def shares(counts: NDArray[Any]) -> F64:
    """(n,) positions of counts on a logarithmic scale, smallest at 0, largest at 1; all 1 if they are equal."""
    logs: F64 = np.log(np.maximum(counts, 1).astype(np.float64))
    if not len(logs) or logs.min() == logs.max():
        return np.ones(len(logs))
    return (logs - logs.min()) / (logs.max() - logs.min())

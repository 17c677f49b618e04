# SPDX-License-Identifier: GPL-3.0-or-later
"""Histograms of the pixels of maps, with a range: pixels outside of it are shown without colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base import colours
from ..base.arrays import F32, F64

BINS = 64
"""Number of bins of a histogram."""

GREY = 0.35
"""Brightness of pixels outside of the range, relative to their colour's."""


BACK, DARKEST = 0.08, 0.22
"""Brightness behind the bars of an icon, and of the darkest of them."""


@dataclass(frozen=True, eq=False)
class Histogram:
    """counts: (BINS,) pixels in equal parts of 0 to `end`; larger values are in the last."""

    counts: NDArray[np.int64]
    end: float


def histogram(values: F64, end: float) -> Histogram:
    """The histogram of a map on a scale from 0 to `end`."""
    place = np.clip((values.ravel() / end * BINS).astype(np.int64), 0, BINS - 1)
    return Histogram(np.bincount(place, minlength=BINS), end)


def within(values: F64, low: float, high: float, end: float) -> NDArray[np.bool_]:
    """Whether each value is in [low, high]; a range that reaches the end of the scale includes all larger values."""
    inside: NDArray[np.bool_] = (values >= low) & ((values <= high) | (high >= end))
    return inside


def ranged(values: F64, low: float, high: float, end: float) -> F32:
    """(h, w, 3) false colours of a map; pixels outside of [low, high] are dark and grey."""
    made = colours.false_colour(values / end)
    outside = ~within(values, low, high, end)
    made[outside] = GREY * made[outside].mean(axis=1, keepdims=True)
    return made


def sentence(values: F64, low: float, high: float, end: float) -> str:
    """The share of pixels in a range, and of the map's sum that they make up."""
    inside = within(values, low, high, end)
    whole = float(values.sum(dtype=np.float64))
    part = float(values[inside].sum(dtype=np.float64)) / whole if whole else 0.0
    return f"{inside.mean():.1%} of the pixels, {part:.1%} of the sum"


def icon(values: F64, low: float, high: float, end: float, side: int) -> F32:
    """(side, side, 4) display values, rows from the bottom: the histogram of a map in the colours of its scale, without
    colour outside of [low, high], which two lines mark. Heights are square roots of numbers.
    """
    counts = histogram(values, end).counts
    heights = np.sqrt(counts / max(int(counts.max()), 1))
    place = (np.arange(side) + 0.5) / side
    column = np.minimum((place * BINS).astype(int), BINS - 1)
    drawn = np.full((side, side, 4), BACK, np.float32)
    drawn[..., 3] = 1.0
    filled = place[:, None] <= heights[column][None, :]
    bars = np.maximum(ranged((place * end)[None, :], low, high, end), DARKEST)
    drawn[filled, :3] = np.broadcast_to(bars, (side, side, 3))[filled]
    for mark in (low, high):
        drawn[:, min(int(mark / end * side), side - 1)] = 1.0
    return drawn

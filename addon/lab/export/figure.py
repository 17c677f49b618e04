# SPDX-License-Identifier: GPL-3.0-or-later
"""A figure as data, which each format draws in its own way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...core.report.marks import Mark


@dataclass(frozen=True)
class Axis:
    """An axis. ticks: places with their labels; empty where the format chooses them. low, high: limits, or None."""

    label: str
    is_log: bool = False
    ticks: tuple[tuple[float, str], ...] = ()
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Series:
    """The points of one configuration. x, y: of equal length. joined: whether a line joins them. hollow: whether marks
    are empty.
    """

    mark: Mark
    x: tuple[float, ...]
    y: tuple[float, ...]
    joined: bool = True
    hollow: bool = False


@dataclass(frozen=True)
class Figure:
    """A figure with one pair of axes. name: of its file, without scene and suffix. note: a line inside the axes."""

    name: str
    caption: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]
    note: str = ""


def logarithmic(label: str, values: Sequence[float]) -> tuple[Axis, float]:
    """A logarithmic axis for values of at least 0, and the place at which zeros are drawn.

    Zeros get a tick of their own, a decade below the decade of the smallest other value.
    """
    above = [value for value in values if value > 0]
    if not above:
        return Axis(label, is_log=True, ticks=((1.0, "0"),), low=0.3, high=3.0), 1.0
    low, high = min(above) / MARGIN, max(above) * MARGIN
    zero = 10.0 ** (math.floor(math.log10(min(above))) - 1)
    if len(above) == len(values):
        return Axis(label, is_log=True, ticks=_ticks(low, high), low=low, high=high), zero
    ticks = ((zero, "0"), *_ticks(zero * 9.99, high))
    return Axis(label, is_log=True, ticks=ticks, low=zero / 2, high=high), zero


MARGIN = 1.2
"""Factor between the outermost value and the end of a logarithmic axis."""

MOST_TICKS = 7


def _ticks(low: float, high: float) -> tuple[tuple[float, str], ...]:
    """Round places between two limits: 1, 2, 5, 10, ... over less than two decades, else powers of ten."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    if high < 100 * low:
        places = [digit * 10.0**power for power in range(first, last + 1) for digit in (1, 2, 5)]
        places = [place for place in places if low <= place <= high]
        if len(places) > 1:
            return tuple((place, f"{place:g}") for place in places)
        # Within a factor of about two: equal steps.
        step = 10.0 ** math.floor(math.log10((high - low) / 2))
        step *= 5 if (high - low) / step > 12 else 2 if (high - low) / step > 5 else 1
        start = math.ceil(low / step)
        return tuple((step * n, f"{step * n:g}") for n in range(start, math.floor(high / step) + 1))
    powers = [power for power in range(first, last + 1) if low <= 10.0**power <= high]
    powers = powers[:: 1 + len(powers) // (MOST_TICKS + 1)]
    return tuple((10.0**power, f"10^{power}") for power in powers)


def counting(label: str, most: int) -> Axis:
    """An axis of whole numbers from 0 to `most`, with whole numbers as ticks."""
    step = next(step for step in (1, 2, 5, 10, 20, 50, 100, 1 + most) if most <= (MOST_TICKS + 3) * step)
    return Axis(
        label, ticks=tuple((float(n), str(n)) for n in range(0, most + 1, step)), low=-0.03 * most, high=1.03 * most
    )

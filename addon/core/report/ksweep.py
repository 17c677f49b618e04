# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps over k: trace times relative to the kd-tree's, as medians over the seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..measure.rows import Row
from ..measure.thesis import base_of, configuration, labels, percent, spread
from ..structures.specs import structure_of


@dataclass(frozen=True)
class Line:
    """One configuration of a sweep: smallest, median and largest time over the seeds for each k, in percent of the
    base.

    label: its name in the plot's legend.
    """

    structure: str
    k: tuple[int, ...]
    low: tuple[float, ...]
    median: tuple[float, ...]
    high: tuple[float, ...]
    label: str


def lines(rows: Sequence[Row]) -> tuple[str, list[Line]]:
    """The base's configuration, and a line for each configuration of one scene that was measured with two or more k.

    Times are relative to the anchor's in the same round, so that rows of different hours and machines are comparable.
    Returns an empty name and no lines when no row can serve as the base.
    """
    base = base_of(rows)
    if base is None:
        return "", []
    # Group the times by configuration and k.
    found: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        time = percent(row, base)
        if row["k"] is not None and time is not None:
            found.setdefault(configuration(row), {}).setdefault(row["k"], []).append(time)
    # Make a line of each configuration with several k.
    names = labels(rows)
    made = []
    for one, by_k in found.items():
        if len(by_k) > 1:
            ks = sorted(by_k)
            low, median, high = zip(*(spread(by_k[k]) for k in ks), strict=True)
            made.append(Line(structure_of(one), tuple(ks), low, median, high, names[one]))
    return base["spec"], made

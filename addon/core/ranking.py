# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of two configurations is faster, as far as the noise of the machine lets anyone say so.

Two rows of the same rounds are compared round by round: one is faster when it is so in every round, and by more than
the machine's noise. By chance that happens once in 2**(rounds - 1) times, so fewer than six rounds rank nothing. Rows
of different rounds are compared through their anchor: then the slowest round of one must beat the fastest of the other.
Without a common anchor such rows are not compared: they may come from different machines.
What answers wrongly is not ranked at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rows import Row, agrees

LEAST_ROUNDS = 6
"""With six rounds the chance of an order that is none is three in a hundred."""


@dataclass(frozen=True)
class Ranking:
    """One ray set of one scene. best: fastest by the median; equal: what cannot be told from it, itself left out.

    second: the fastest that can, how many times slower it is, and between which rounds. noise: of the machine while
    these were timed, relative. rounds: the fewest of any row. apart: rows that nothing relates to the others, which
    are no part of all this.
    """

    best: Row
    equal: list[Row]
    second: Row | None
    times: float
    low: float
    high: float
    noise: float
    rounds: int
    apart: list[Row]

    @property
    def ranked(self) -> bool:
        """Whether there were rounds enough to say anything."""
        return self.rounds >= LEAST_ROUNDS


def rank(rows: Sequence[Row], name: str) -> Ranking | None:
    """The ranking of the right ones of a scene's rows for one ray set; None when fewer than two can be compared."""
    able = [row for row in rows if agrees(row) and (row["rays"].get(name) or {}).get("rounds")]
    units: dict[tuple[str, Any], list[Row]] = {}
    for row in able:
        units.setdefault(_unit(row, name), []).append(row)
    timed = max(units.values(), key=len, default=[])
    if len(timed) < 2:
        return None
    first, *others = sorted(timed, key=lambda row: -float(np.median(speeds(row, name))))
    equal = [row for row in others if not faster(first, row, name)]
    slower = [row for row in others if row not in equal]
    ratios = against(first, slower[0], name) if slower else np.ones(1)
    return Ranking(
        first,
        equal,
        slower[0] if slower else None,
        float(np.median(ratios)),
        float(ratios.min()),
        float(ratios.max()),
        max(noise(row, name) for row in (first, *equal, *slower[:1])),
        min(len(row["rays"][name]["rounds"]) for row in timed),
        [row for row in able if row not in timed],
    )


def _unit(row: Row, name: str) -> tuple[str, str | None]:
    """What a row's speeds are measured by: its anchor, or without one its rounds. Rows of equal units are related."""
    if row["anchor"] is not None and row["rays"][name]["anchor_rounds"]:
        return "anchor", row["anchor"]
    return "round", row["round_id"]


def related(a: Row, b: Row, name: str) -> bool:
    """Whether one's speed can be divided by the other's: timed together, or each beside the same anchor."""
    unit = _unit(a, name)
    return together(a, b) or (unit == _unit(b, name) and unit[0] == "anchor")


def speeds(row: Row, name: str) -> NDArray[np.float64]:
    """Per round, in units of the anchor's speed in the same round, so that rows of all rounds can be put in order."""
    one = row["rays"][name]
    rates = np.array(one["rounds"], np.float64)
    return rates / np.array(one["anchor_rounds"]) if one["anchor_rounds"] else rates


def noise(row: Row, name: str) -> float:
    """The relative difference between two times of the same thing; none where nobody measured it."""
    return float(row["rays"][name].get("noise") or 0.0)


def against(a: Row, b: Row, name: str) -> NDArray[np.float64]:
    """How many times as fast `a` is as `b`: per round where they share rounds, else of all pairs of rounds.

    Raises ValueError for rows that are not related.
    """
    if not related(a, b, name):
        raise ValueError(f"nothing relates {a['spec']} to {b['spec']}: neither their rounds nor an anchor are the same")
    if together(a, b):
        rates = [np.array(row["rays"][name]["rounds"]) for row in (a, b)]
        return np.asarray(rates[0] / rates[1])
    return np.asarray(np.divide.outer(speeds(a, name), speeds(b, name)).ravel())


def together(a: Row, b: Row) -> bool:
    """Whether the rounds of both rows are the same ones."""
    return a["round_id"] is not None and a["round_id"] == b["round_id"]


def faster(a: Row, b: Row, name: str) -> bool:
    """Whether `a` is faster than `b` beyond noise; never where they are not related."""
    if not related(a, b, name):
        return False
    rounds = min(len(row["rays"][name]["rounds"]) for row in (a, b))
    ratios = against(a, b, name)
    floor = 1.0 + max(noise(a, name), noise(b, name))
    return rounds >= LEAST_ROUNDS and bool((ratios > 1.0).all()) and float(np.median(ratios)) > floor

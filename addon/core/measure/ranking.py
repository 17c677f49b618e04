# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of two configurations is faster, as far as the noise of the machine lets anyone say so.

Two rows of the same rounds are compared round by round: one is faster when it is so in every round, and by more than
the machine's noise. By chance that happens once in 2**(rounds - 1) times, so fewer than six rounds rank nothing. Rows
of different rounds are compared through their anchor: then the slowest round of one must beat the fastest of the other.
Without a common anchor such rows are not compared: they may come from different machines.
What answers wrongly is not ranked at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .rows import Bound, RayColumns, Row, agrees, building

LEAST_ROUNDS = 6
"""With six rounds the chance of an order that is none is three in a hundred."""

CHANCE = 32
"""Once in so many times an order may be none."""

PICTURE = "build and picture"
TRACING = "build and rays"
"""What is ranked besides single ray sets: these with the build."""


@dataclass(frozen=True)
class Ranking:
    """One ray set of one scene, PICTURE or TRACING. best: fastest by the median; equal: what cannot be told from it.

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
    """The ranking of those of a scene's rows whose answers are right; None when fewer than two can be compared.

    name: of a ray set, PICTURE or TRACING.
    """
    able = [row for row in rows if agrees(row) and part(row, name)]
    units: dict[tuple[str, Any, int], list[Row]] = {}
    for row in able:
        units.setdefault(_unit(row, name), []).append(row)
    timed = max(units.values(), key=len, default=[])
    if len(timed) < 2:
        return None
    ranked = set(map(id, timed))
    first, *others = sorted(timed, key=lambda row: -float(np.median(speeds(row, name))))
    equal: list[Row] = []
    slower: list[Row] = []
    for row in others:
        (slower if faster(first, row, name) else equal).append(row)
    ratios = against(first, slower[0], name) if slower else np.ones(1)
    return Ranking(
        first,
        equal,
        slower[0] if slower else None,
        float(np.median(ratios)),
        float(ratios.min()),
        float(ratios.max()),
        max(noise(row, name) for row in (first, *equal, *slower[:1])),
        min(len(_known(row, name)["rounds"]) for row in timed),
        [row for row in able if id(row) not in ranked],
    )


Part = dict[str, Any]
"""rounds: speeds, one per round; anchor_rounds: of the anchor in the same ones, or nothing; anchor: its name or None;
noise: of the machine, relative, or None. Only ratios of speeds mean anything."""


def part(row: Row, name: str, build: Bound = "med") -> Part | None:
    """What of a row is ranked: a ray set, PICTURE or TRACING; None where it was not timed in rounds.

    build: whether the least, the median or the most of its builds counts.
    """
    if name == PICTURE:
        image = row.get("image")
        if not image or not row["build_s"]:
            return None
        built = building(row, build)
        own = [1.0 / (built + seconds) for seconds in image["rounds_s"]]
        others = [1.0 / seconds for seconds in image["anchor_rounds_s"]]
        # What a picture takes besides its samples weighs more in one of fewer.
        size = f"{image['samples']} samples, {image.get('pixels')} pixels"
        anchor = None if image["anchor"] is None else f"{image['anchor']} with {size}"
        return {"rounds": own, "anchor_rounds": others, "anchor": anchor, "noise": image["noise"]}
    if name == TRACING:
        return _tracing(row, build)
    one = (row["rays"] or {}).get(name)
    return {**one, "anchor": row["anchor"]} if one and one["rounds"] else None


def _tracing(row: Row, build: Bound) -> Part | None:
    """One million rays of each set, and the build."""
    known: dict[str, RayColumns] = row["rays"] or {}
    sets = {name: one for name, one in known.items() if one["rounds"]}
    if not sets or not row["build_s"]:
        return None
    seconds = building(row, build) + _one_of_each(sets.values(), "rounds")
    others: list[float] = []
    if row["anchor"] is not None and all(one["anchor_rounds"] for one in sets.values()):
        others = list(1.0 / _one_of_each(sets.values(), "anchor_rounds"))
    noise = max(float(one.get("noise") or 0.0) for one in sets.values())
    # Over other sets it would be another quantity.
    anchor = None if row["anchor"] is None else f"{row['anchor']} over {', '.join(sets)}"
    return {"rounds": list(1.0 / seconds), "anchor_rounds": others, "anchor": anchor, "noise": noise}


def _one_of_each(sets: Iterable[RayColumns], key: Literal["rounds", "anchor_rounds"]) -> NDArray[np.float64]:
    """Seconds of one million rays of each set together, per round."""
    return np.sum([1.0 / np.array(one[key], np.float64) for one in sets], axis=0, dtype=np.float64)


def _known(row: Row, name: str, build: Bound = "med") -> Part:
    found = part(row, name, build)
    assert found is not None, "it was timed"
    return found


def _unit(row: Row, name: str) -> tuple[str, str | None, int]:
    """What a row's speeds are measured by: its anchor, or without one its rounds; on so many threads. Rows of equal
    units are related.
    """
    one = _known(row, name)
    if one["anchor"] is not None and one["anchor_rounds"]:
        return "anchor", one["anchor"], row["threads"]
    return "round", row["round_id"], row["threads"]


def related(a: Row, b: Row, name: str) -> bool:
    """Whether one's speed can be divided by the other's: timed together, or each beside the same anchor."""
    unit = _unit(a, name)
    return together(a, b) or (unit == _unit(b, name) and unit[0] == "anchor")


def speeds(row: Row, name: str, build: Bound = "med") -> NDArray[np.float64]:
    """Per round, in units of the anchor's speed in the same round, so that rows of all rounds can be put in order."""
    one = _known(row, name, build)
    rates = np.array(one["rounds"], np.float64)
    return rates / np.array(one["anchor_rounds"]) if one["anchor_rounds"] else rates


def noise(row: Row, name: str) -> float:
    """The relative difference between two times of the same thing; none where nobody measured it."""
    return float(_known(row, name).get("noise") or 0.0)


def against(
    a: Row, b: Row, name: str, *, paired: bool = True, builds: tuple[Bound, Bound] = ("med", "med")
) -> NDArray[np.float64]:
    """How many times as fast `a` is as `b`: per round where they share rounds, else of all pairs of rounds.

    paired: with False of all pairs in any case. builds: which of their builds count. Raises ValueError for rows that
    are not related.
    """
    if not related(a, b, name):
        raise ValueError(f"nothing relates {a['spec']} to {b['spec']}: neither their rounds nor an anchor are the same")
    if together(a, b) and paired:
        rates = [np.array(_known(row, name, build)["rounds"]) for row, build in zip((a, b), builds, strict=True)]
        return np.asarray(rates[0] / rates[1])
    return np.asarray(np.divide.outer(speeds(a, name, builds[0]), speeds(b, name, builds[1])).ravel())


def together(a: Row, b: Row) -> bool:
    """Whether the rounds of both rows are the same ones."""
    return a["round_id"] is not None and a["round_id"] == b["round_id"]


def faster(a: Row, b: Row, name: str, *, among: int = 1) -> bool:
    """Whether `a` is faster than `b` beyond noise, even with its longest build against the other's shortest.

    Never where they are not related. among: `a` was picked as the fastest of so many. Each of them had a chance to be
    lucky, so then all of its rounds must be faster than all of the other's: of n rounds each that happens to one of
    them by chance once in (2n choose n) times.
    """
    if part(a, name) is None or part(b, name) is None or not related(a, b, name):
        return False
    rounds = min(len(_known(row, name)["rounds"]) for row in (a, b))
    if rounds < LEAST_ROUNDS or (among > 1 and among * CHANCE > math.comb(2 * rounds, rounds)):
        return False
    ratios = against(a, b, name, paired=among == 1, builds=("max", "min"))
    floor = 1.0 + max(noise(a, name), noise(b, name))
    return bool((ratios > 1.0).all()) and float(np.median(ratios)) > floor

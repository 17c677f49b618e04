# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistical ranking: which of two configurations is faster beyond the noise of the machine.

Two rows of the same rounds are compared round by round: one is faster if the 95 % interval of the median of the
ratios of their speeds (`inference.interval`) lies above 1, and the median above the machine's noise. Fewer than six
rounds have no interval and rank nothing. Rows of different rounds are compared through their anchor: then the intervals
of both speeds must not overlap.
Without a common anchor such rows are not compared, because they may come from different machines. Rows of different
tables (single rays, the fastest traversals) are never compared. Rows with wrong answers are not ranked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .inference import LEAST_ROUNDS, interval
from .rows import Bound, RayColumns, Row, agrees, building

CHANCE = 32
"""Inverse of the accepted probability of a false order."""

PICTURE = "build and picture"
TRACING = "build and rays"
"""Ranked quantities besides single ray sets; both include the build."""


@dataclass(frozen=True)
class Ranking:
    """Ranking of one ray set of one scene, PICTURE or TRACING. best: fastest by the median; equal: rows not
    distinguishable from it.

    second: the fastest distinguishable row; times, low, high: its slowdown, as the median over the rounds and its 95 %
    interval. noise: relative noise of the machine while these were timed. rounds: the fewest of any row. apart: rows
    that share no anchor or round with the others and are excluded.
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
        """Whether there were enough rounds for a ranking."""
        return self.rounds >= LEAST_ROUNDS


def rank(rows: Sequence[Row], name: str) -> Ranking | None:
    """The ranking of a scene's rows with correct answers; None if fewer than two are comparable.

    name: of a ray set, PICTURE or TRACING.
    """
    able = [row for row in rows if agrees(row) and part(row, name)]
    # Rank the largest group of comparable rows of one table.
    units: dict[tuple[str, tuple[str, Any, int]], list[Row]] = {}
    for row in able:
        for table in row["tables"]:
            units.setdefault((table, _unit(row, name)), []).append(row)
    timed = max(units.values(), key=len, default=[])
    if len(timed) < 2:
        return None
    ranked = set(map(id, timed))
    # Split the rows into those equal to the fastest within noise and those slower.
    first, *others = sorted(timed, key=lambda row: -float(np.median(speeds(row, name))))
    equal: list[Row] = []
    slower: list[Row] = []
    for row in others:
        (slower if faster(first, row, name) else equal).append(row)
    ratios = against(first, slower[0], name) if slower else np.ones(1)
    low, high = between(first, slower[0], name) if slower else (1.0, 1.0)
    return Ranking(
        first,
        equal,
        slower[0] if slower else None,
        float(np.median(ratios)),
        low,
        high,
        max(noise(row, name) for row in (first, *equal, *slower[:1])),
        min(len(_known(row, name)["rounds"]) for row in timed),
        [row for row in able if id(row) not in ranked],
    )


Part = dict[str, Any]
"""Ranked speeds of a row. rounds: speeds, one per round; anchor_rounds: the anchor's in the same rounds, or empty;
anchor: its name or None; noise: of the machine, relative, or None. Only ratios of speeds are meaningful.
"""


def part(row: Row, name: str, build: Bound = "med") -> Part | None:
    """The ranked part of a row: a ray set, PICTURE or TRACING; None if it was not timed in rounds.

    build: which of its builds counts: "min", "med" or "max".
    """
    if name == PICTURE:
        image = row.get("image")
        if not image or not row["build_s"]:
            return None
        built = building(row, build)
        own = [1.0 / (built + seconds) for seconds in image["rounds_s"]]
        others = [1.0 / seconds for seconds in image["anchor_rounds_s"]]
        # The constant cost of a picture weighs more at fewer samples, so anchors of different sizes are not comparable.
        size = f"{image['samples']} samples, {image.get('pixels')} pixels"
        anchor = None if image["anchor"] is None else f"{image['anchor']} with {size}"
        return {"rounds": own, "anchor_rounds": others, "anchor": anchor, "noise": image["noise"]}
    if name == TRACING:
        return _tracing(row, build)
    one = (row["rays"] or {}).get(name)
    return {**one, "anchor": row["anchor"]} if one and one["rounds"] else None


def _tracing(row: Row, build: Bound) -> Part | None:
    """Speeds of building and tracing one million rays of each set."""
    known: dict[str, RayColumns] = row["rays"] or {}
    sets = {name: one for name, one in known.items() if one["rounds"]}
    if not sets or not row["build_s"]:
        return None
    seconds = building(row, build) + _one_of_each(sets.values(), "rounds")
    others: list[float] = []
    if row["anchor"] is not None and all(one["anchor_rounds"] for one in sets.values()):
        others = list(1.0 / _one_of_each(sets.values(), "anchor_rounds"))
    noise = max(float(one.get("noise") or 0.0) for one in sets.values())
    # Over other sets the anchor's time would be a different quantity.
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
    """The unit of a row's speeds: its anchor, or without one its round, and its number of threads. Rows with equal
    units are comparable.
    """
    one = _known(row, name)
    if one["anchor"] is not None and one["anchor_rounds"]:
        return "anchor", one["anchor"], row["threads"]
    return "round", row["round_id"], row["threads"]


def by_table(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """The rows of each table, single rays first; a row of two tables is in both."""
    listed = list(rows)
    found = {table: [row for row in listed if table in row["tables"]] for table in ("single", "fastest", "chosen")}
    return {table: own for table, own in found.items() if own}


def related(a: Row, b: Row, name: str) -> bool:
    """Whether the ratio of two rows' speeds is meaningful: both of one table, and timed together or each with the same
    anchor.
    """
    if not set(a["tables"]) & set(b["tables"]):
        return False
    unit = _unit(a, name)
    return together(a, b) or (unit == _unit(b, name) and unit[0] == "anchor")


def speeds(row: Row, name: str, build: Bound = "med") -> NDArray[np.float64]:
    """Speeds per round, relative to the anchor's in the same round where there is one."""
    one = _known(row, name, build)
    rates = np.array(one["rounds"], np.float64)
    return rates / np.array(one["anchor_rounds"]) if one["anchor_rounds"] else rates


def noise(row: Row, name: str) -> float:
    """The relative difference between two times of the same work; 0 if it was not measured."""
    return float(_known(row, name).get("noise") or 0.0)


def against(
    a: Row, b: Row, name: str, *, paired: bool = True, builds: tuple[Bound, Bound] = ("med", "med")
) -> NDArray[np.float64]:
    """Speed of `a` relative to `b`: per round if they share rounds, else for all pairs of rounds.

    paired: if False, all pairs in any case. builds: which of their builds count. Raises ValueError for rows that are
    not comparable.
    """
    if not related(a, b, name):
        shared = "they share no table, or neither rounds nor an anchor"
        raise ValueError(f"{a['spec']} and {b['spec']} are not comparable: {shared}")
    if together(a, b) and paired:
        rates = [np.array(_known(row, name, build)["rounds"]) for row, build in zip((a, b), builds, strict=True)]
        return np.asarray(rates[0] / rates[1])
    return np.asarray(np.divide.outer(speeds(a, name, builds[0]), speeds(b, name, builds[1])).ravel())


def between(a: Row, b: Row, name: str, builds: tuple[Bound, Bound] = ("med", "med")) -> tuple[float, float]:
    """The 95 % interval of the speed of `a` relative to `b`: of the ratios per round if they share rounds, else from
    the ends of the intervals of both. From the smallest to the largest ratio where there are too few rounds. Raises
    ValueError for rows that are not comparable.
    """
    ratios = against(a, b, name, builds=builds)
    if together(a, b):
        return interval(ratios) or (float(ratios.min()), float(ratios.max()))
    first, second = (interval(speeds(row, name, build)) for row, build in zip((a, b), builds, strict=True))
    if first is None or second is None:
        return float(ratios.min()), float(ratios.max())
    return first[0] / second[1], first[1] / second[0]


def together(a: Row, b: Row) -> bool:
    """Whether both rows were measured in the same rounds."""
    return a["round_id"] is not None and a["round_id"] == b["round_id"]


def faster(a: Row, b: Row, name: str, *, among: int = 1) -> bool:
    """Whether `a` is faster than `b` beyond noise, even with its longest build against the other's shortest.

    False if they are not comparable. among: `a` was selected as the fastest of this number of rows. Each of them could
    be lucky, so all of its rounds must then be faster than all of the other's: with n rounds each that happens by
    chance once in (2n choose n) cases.
    """
    if part(a, name) is None or part(b, name) is None or not related(a, b, name):
        return False
    # Require enough rounds for the error probability, also after a selection among several.
    rounds = min(len(_known(row, name)["rounds"]) for row in (a, b))
    if rounds < LEAST_ROUNDS or (among > 1 and among * CHANCE > math.comb(2 * rounds, rounds)):
        return False
    builds: tuple[Bound, Bound] = ("max", "min")
    ratios = against(a, b, name, paired=among == 1, builds=builds)
    floor = 1.0 + max(noise(a, name), noise(b, name))
    least = between(a, b, name, builds)[0] if among == 1 else float(ratios.min())
    return least > 1.0 and float(np.median(ratios)) > floor

# SPDX-License-Identifier: GPL-3.0-or-later
"""The answer of a benchmark: the quickest structure of a scene in one sentence, with its uncertainty and its errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..measure import ranking, yardstick
from ..measure.rows import Row, agrees
from .report import IMAGE, names, seconds_text

QUANTITIES = {
    ranking.PICTURE: f"the build and one picture of {IMAGE}",
    ranking.TRACING: "the build and one million rays of each set",
}
"""What is ranked, the most useful first."""


def answer(rows: Sequence[Row]) -> str:
    """The quickest structure of a scene's rows, and the errors of all; "" without two comparable rows."""
    found = winner(rows)
    return f"{found} {_answers(rows)}".strip() if found else ""


def winner(rows: Sequence[Row]) -> str:
    """The quickest structure of a scene's rows in one sentence; "" without two comparable rows."""
    ours = [row for row in rows if row["spec"] != yardstick.SPEC and row["rays"] and agrees(row)]
    tables = ranking.by_table(ours)
    # The best of all is that which goes as fast as it can; rows of earlier versions have no table.
    own = next((tables[name] for name in ("fastest", "", "chosen", "single") if name in tables), [])
    for name, what in QUANTITIES.items():
        found = ranking.rank(own, name)
        if found is not None:
            return _sentence(found, name, what)
    return ""


def _sentence(found: ranking.Ranking, name: str, what: str) -> str:
    """The ranking as a sentence: one winner, or several that the rounds do not separate."""
    best = found.best["spec"]
    low, median, high = _spread(found.best, name)
    took = f"{seconds_text(median)} ({seconds_text(low)} to {seconds_text(high)} over {found.rounds} rounds)"
    if not found.ranked:
        return f"{best} has the best median for {what}, {took}: fewer than {ranking.LEAST_ROUNDS} rounds rank nothing."
    text = f"{best} is the quickest for {what}: {took}"
    if found.equal:
        equal = [found.best, *found.equal]
        text = (
            f"{names(equal)} cannot be told apart for {what}: {took} with {best}, the best median, and a noise of "
            f"{100 * found.noise:.1f} %"
        )
    if found.second is not None:
        times = f"{found.times:.2f} times as long ({found.low:.2f} to {found.high:.2f})"
        text += f"; the next, {found.second['spec']}, takes {times}"
    return text + "."


def _spread(row: Row, name: str) -> tuple[float, float, float]:
    """Smallest, median and largest seconds of a ranked quantity over the rounds."""
    part = ranking.part(row, name)
    assert part is not None, "it was ranked"
    seconds = 1.0 / np.array(part["rounds"], np.float64)
    return float(seconds.min()), float(np.median(seconds)), float(seconds.max())


def _answers(rows: Sequence[Row]) -> str:
    """The number of answers compared, and of structures with wrong ones."""
    compared = [row for row in rows if row["errors"] and row["spec"] != yardstick.SPEC]
    if not compared:
        return ""
    wrong = [row for row in compared if not agrees(row)]
    rays = max(row["errors"]["rays"] for row in compared)
    text = f"Up to {rays:,} answers of each were compared"
    return f"{text}: all are right." if not wrong else f"{text}: {names(wrong)} gave wrong ones and are not ranked."

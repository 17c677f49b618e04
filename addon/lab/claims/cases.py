# SPDX-License-Identifier: GPL-3.0-or-later
"""The operations of kd-tree traversals in each case of ray and split plane (Havran, Kopal, Bittner and Žára 1997).

The counts are those of the forms as published: `native/papers/src/ta_b_1997.rs` and `origin.rs`. They do
not include the fetch of the node and the stack.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from .claims import Chart

CASES = tuple(f"case_{kind}" for kind in ("n1", "n2", "n3", "n4", "n5", "p1", "p2", "p3", "p4", "p5", "z1", "z2", "z3"))
"""Names of the counters of the cases."""

BOTH = ("case_n4", "case_p4")
"""The cases in which the ray crosses the plane inside the cell and visits both children."""


class Operations(NamedTuple):
    """Numbers of operations at one inner node."""

    comparisons: float
    additions: float
    products: float
    divisions: float

    @property
    def arithmetic(self) -> float:
        """Additions, products and divisions together."""
        return self.additions + self.products + self.divisions


COMPARED = Operations(2, 0, 0, 0)
"""TA-B where one child is visited: entry and exit are compared with the plane."""

CROSSED = Operations(2, 3, 2, 1)
"""TA-B where both are visited: also the distance (a difference and a quotient), and two coordinates of the crossing."""


def ta_b(case: str) -> Operations:
    """The operations of TA-B in a case."""
    return CROSSED if case in BOTH else COMPARED


def by_distance(case: str, *, division: bool) -> Operations:
    """The operations of Sung's algorithm (with a division) or Arvo's (with a product of the reciprocal) in a case.

    The distance is computed at every node. Comparisons: origin and plane; distance and exit; sign of the distance;
    distance and entry. A comparison that decides ends them.
    """
    needed = {"1": 3, "2": 2, "3": 2}.get(case[-1], 4) if case[-2] != "z" else 4
    return Operations(needed, 1, int(not division), int(division))


def means(counters: Mapping[str, float]) -> dict[str, Operations]:
    """Mean operations per inner node of TA-B, Sung and Arvo, from the mean number of each case per ray."""
    shares = histogram(counters)
    found = {}
    for name, count in (
        ("ta-b", ta_b),
        ("sung", lambda case: by_distance(case, division=True)),
        ("arvo", lambda case: by_distance(case, division=False)),
    ):
        columns = zip(*([share * number for number in count(case)] for case, share in shares.items()), strict=True)
        found[name] = Operations(*map(sum, columns)) if shares else Operations(0, 0, 0, 0)
    return found


def histogram(counters: Mapping[str, float]) -> dict[str, float]:
    """The share of each case among all inner nodes; empty if none was counted."""
    whole = sum(counters[name] for name in CASES)
    return {name: counters[name] / whole for name in CASES} if whole > 0 else {}


def chart(configuration: str, scenes: Mapping[str, Mapping[str, float]]) -> Chart:
    """Bars of the share of each case in percent, a colour per scene. scenes: histograms by the name of the scene."""
    lines = {
        name: [(float(place), 100.0 * shares.get(case, 0.0)) for place, case in enumerate(CASES)]
        for name, shares in scenes.items()
    }
    named = ", ".join(f"{place} {case[5:].upper()}" for place, case in enumerate(CASES))
    return Chart(f"{configuration}: cases of ray and plane", named, "% of the inner nodes", lines, bars=True)

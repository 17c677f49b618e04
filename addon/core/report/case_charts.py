# SPDX-License-Identifier: GPL-3.0-or-later
"""The histogram of the cases of ray and split plane that TA-B meets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..measure.analysis import field
from ..measure.rows import Row
from . import marks as marking

CAPTION = (
    "Share of the inner nodes that each case of ray and split plane takes (Havran, Kopal, Bittner and Žára 1997). N: "
    "origin below the plane, P above, Z in it; 1 away from it, 2 along it, 3 the cell ends before it, 4 through it "
    "inside the cell, 5 through it before the cell. Only N4 and P4 visit both children and compute a distance."
)


def with_cases(rows: Sequence[Row]) -> list[tuple[Row, str]]:
    """The rows whose cases are counted, each with the name of its ray sets that have them."""
    return [(row, name) for row in rows for name in row["rays"] if field.value(row, "rays", name, "cases")]


def height(rows: Sequence[Row]) -> float:
    """Height of the figure in inches."""
    return 1.8 + 1.5 * len({name for _, name in with_cases(rows)})


def draw(figure: Any, rows: Sequence[Row]) -> None:
    """One panel of bars per ray set, one colour per configuration."""
    found = with_cases(rows)
    sets = list(dict.fromkeys(name for _, name in found))
    cases = sorted({case for row, name in found for case in field.value(row, "rays", name, "cases")})
    panels = figure.subplots(len(sets), 1, squeeze=False, sharex=True)[:, 0]
    for panel, chosen in zip(panels, sets, strict=True):
        drawn = [row for row, name in found if name == chosen]
        width = 0.8 / len(drawn)
        for number, row in enumerate(drawn):
            shares = field.value(row, "rays", chosen, "cases")
            places = [place + number * width for place in range(len(cases))]
            heights = [100 * shares.get(case, 0.0) for case in cases]
            colour = marking.COLOURS[number % len(marking.COLOURS)]
            panel.bar(places, heights, width * 0.92, color=colour, label=row["spec"])
        panel.set_ylabel(f"{chosen}, %")
    middle = 0.4 - 0.4 / max(1, len([row for row, name in found if name == sets[-1]]))
    panels[-1].set_xticks([place + middle for place in range(len(cases))], [case.upper() for case in cases])
    panels[0].legend(frameon=False)

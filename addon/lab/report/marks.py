# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks of configurations in plots: at most eight in colour, each with a name, and all others in grey."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...core.measure import yardstick
from ...core.measure.offsets import is_unguarded
from ...core.measure.rows import Row, agrees
from ...core.structures.specs import structure_of

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#6f4ea1")
"""Distinguishable with any kind of colour vision (after Okabe and Ito 2008), and dark enough for white paper."""

MARKERS = "osD^vPX"

INK = "#1c1f24"
GREY = "#8a93a3"
PALE = "#c3cad6"
WRONG = "#d55e00"

MOST = len(COLOURS)
"""Largest number of configurations in colour; Embree, the yardstick, is an eighth, in black."""

HANDLE_WIDTH, LETTER_WIDTH = 0.6, 0.066
"""Inches of an entry of a legend: its handle with the gaps around it, and each letter of its name."""

LONG = 30
"""Longest name in a legend, in characters."""


class About(NamedTuple):
    """A figure: name of its files without the scene, title, and caption with how to read it."""

    name: str
    title: str
    caption: str


@dataclass(frozen=True)
class Mark:
    """How a configuration is drawn. order: among the layers of a plot; label: None without an entry in legends."""

    colour: str
    marker: str
    label: str | None
    size: float
    width: float
    order: int

    @property
    def is_chosen(self) -> bool:
        """Whether it is drawn in colour, or is the yardstick."""
        return self.label is not None

    def line(self) -> dict[str, Any]:
        """The keyword arguments of a line with markers."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "markersize": self.size,
            "linewidth": self.width,
            "label": self.label,
            "zorder": self.order,
        }


OTHER = Mark(PALE, ".", None, 3.5, 0.7, 2)
"""The mark of all that are not chosen."""

YARDSTICK = Mark(INK, "*", "Embree", 9.0, 1.4, 5)


def marks(rows: Sequence[Row], seconds: Sequence[float]) -> dict[str, Mark]:
    """The mark of each configuration, the same in all plots of a scene.

    In colour are the fastest of each family with and without error bounds, and of these the fastest. Rows with wrong
    answers and brute force are never chosen. seconds: of tracing, one per row, 0 if unknown.
    """
    best: dict[tuple[str, bool], tuple[float, str]] = {}
    for row, taken in zip(rows, seconds, strict=True):
        right = yardstick.is_foreign(row["spec"]) or agrees(row)
        if row["spec"] in (yardstick.SPEC, "brute") or not taken or not right:
            continue
        family = _family(row["spec"]), is_unguarded(row["spec"])
        best[family] = min(best.get(family, (taken, row["spec"])), (taken, row["spec"]))
    chosen = [spec for _, spec in sorted(best.values())[:MOST]]
    # The order of the rows decides the colour, so that the kd-tree has the same one everywhere.
    chosen = [row["spec"] for row in rows if row["spec"] in chosen]
    found = {row["spec"]: OTHER for row in rows}
    for number, spec in enumerate(dict.fromkeys(chosen)):
        found[spec] = Mark(COLOURS[number], MARKERS[number], short(spec), 5.5, 1.6, 4)
    if yardstick.SPEC in found:
        found[yardstick.SPEC] = YARDSTICK
    return found


def _family(spec: str) -> str:
    if yardstick.is_foreign(spec):
        return spec
    return structure_of(spec).partition("-")[0].rstrip("0123456789")


def short(spec: str) -> str:
    """A configuration's name, shortened in the middle so that structure and last parameter stay."""
    if len(spec) <= LONG:
        return spec
    half = (LONG - 1) // 2
    return f"{spec[: LONG - 1 - half]}…{spec[-half:]}"


def ordered(rows: Sequence[Row], marks: dict[str, Mark]) -> list[Row]:
    """The rows with the grey ones first, so that they are drawn beneath."""
    return sorted(rows, key=lambda row: marks[row["spec"]].is_chosen)


def unnamed(rows: Sequence[Row], marks: dict[str, Mark]) -> int:
    """Number of configurations without an entry in the legend."""
    return sum(not marks[row["spec"]].is_chosen for row in rows)


def legend(where: Any, handles_of: Any = None, *, others: int = 0, more: Sequence[Any] = ()) -> None:
    """A legend below a figure with one entry for all grey configurations.

    where: a figure. handles_of: axes whose entries it shows, all if None. others: number of grey configurations.
    more: further handles.
    """
    from matplotlib.lines import Line2D

    handles, labels = (handles_of or where).get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    found = list(entries.values())
    if others:
        label = f"{others} other{'s' if others > 1 else ''}"
        found.append(Line2D([], [], color=OTHER.colour, marker=OTHER.marker, linewidth=OTHER.width, label=label))
    found += more
    if found:
        # As many columns as fit next to each other, by the longest name.
        column = HANDLE_WIDTH + LETTER_WIDTH * max(len(str(handle.get_label())) for handle in found)
        fitting = max(1, int(where.get_size_inches()[0] / column))
        where.legend(handles=found, loc="outside lower center", ncols=min(4, fitting, len(found)), columnspacing=1.6)

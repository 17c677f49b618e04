# SPDX-License-Identifier: GPL-3.0-or-later
"""The meaning of the overlay's colours, as lines of a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..base import colours
from . import cells, planes

LABELS = {
    "X": "plane across X",
    "Y": "plane across Y",
    "Z": "plane across Z",
    "OBLIQUE": "oblique plane",
    "SLABS": "slabs around a child",
    "OCTANTS": "planes of octants",
    "BOXES": "box of a child",
}
"""The kinds of planes in words."""

assert tuple(LABELS) == planes.KINDS

RAMP = 5
"""Number of colours of a scale."""


@dataclass(frozen=True)
class Entry:
    """A line: one colour, or several for a scale, and its meaning. Red, green and blue as displayed."""

    colours: tuple[tuple[float, ...], ...]
    text: str


def of_planes(
    kinds: Sequence[str], depths: tuple[int, int], tints: Mapping[str, Sequence[float]], across: int = -1
) -> list[Entry]:
    """The kinds that are shown, and the levels, or the axis across which one layer of cells is shown."""
    entries = [Entry((tuple(tints[kind]),), LABELS[kind]) for kind in kinds]
    levels = (
        f"level {depths[0]}" if depths[0] == depths[1] else f"levels {depths[0]} to {depths[1]}, deeper ones fainter"
    )
    if across >= 0:
        levels = f"one layer of cells across {planes.KINDS[across]}"
    return [*entries, Entry((), levels)] if entries else []


def of_cells(least: int, most: int) -> list[Entry]:
    """Leaves with numbers of triangles between these."""
    return [Entry(_ramp(), f"leaves of {least:,} to {most:,} triangles" if least < most else f"leaves of {most:,}")]


def of_ray() -> list[Entry]:
    """The path of a ray."""
    return [
        Entry((cells.RAY_RGB,), "ray"),
        Entry(_ramp(), "leaves in the order tested"),
        Entry((cells.PASSED_RGB,), "leaves passed"),
        Entry((cells.TESTED_RGB,), "triangles tested"),
        Entry((cells.HIT_RGB,), "triangle hit"),
    ]


def of_step(rgb: Sequence[float]) -> list[Entry]:
    """The node of the current step."""
    return [Entry((tuple(rgb),), "node of this step")]


def of_node(rgb: Sequence[float]) -> list[Entry]:
    """A node and its children."""
    return [Entry((tuple(rgb),), "node"), Entry(_ramp(), "its children, brighter where they cost more")]


def of_beam() -> list[Entry]:
    """The tile of rays."""
    return [Entry(_ramp(), "leaves, brighter where more rays of the beam visit them")]


def _ramp() -> tuple[tuple[float, ...], ...]:
    places = np.linspace(colours.CELLS_FROM, 1.0, RAMP)
    return tuple(tuple(float(part) for part in rgb) for rgb in colours.false_colour(places))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The meaning of the overlay's colours, as lines of a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..base import colours
from ..base.arrays import I32
from . import cells, planes, polygons
from .planes import Planes
from .polygons import PolygonBeam

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


def of_planes(shown: Planes, tints: Mapping[str, Sequence[float]]) -> list[Entry]:
    """The kinds that are shown, the levels, or the axis across which one layer of cells is shown, and what is marked.

    tints: red, green and blue of each kind.
    """
    if not len(shown):
        return []
    plain = len(shown) - shown.marked
    labels, boxes = dict(LABELS), shown.body is not None
    if boxes:
        labels["OBLIQUE"] = f"turned boxes{_levels(shown.depth[plain:])}" if shown.marked else labels["OBLIQUE"]
    elif shown.marked and shown.across < 0:
        labels["OBLIQUE"] = f"highest oblique planes{_levels(shown.depth[plain:])}"
    kinds = [name for number, name in enumerate(planes.KINDS) if (shown.kind == number).any()]
    if shown.across >= 0:
        counts = [Entry(_ramp(), "cells with triangles, brighter with more")] if shown.marked else []
        kinds = [name for number, name in enumerate(planes.KINDS) if (shown.kind[:plain] == number).any()]
        entries = [Entry((tuple(tints[kind]),), LABELS[kind]) for kind in kinds]
        step = planes.left_out(shown)
        walls = f", one in {step} walls drawn" if step > 1 and entries else ""
        return [*entries, *counts, Entry((), f"one layer of cells across {planes.KINDS[shown.across]}{walls}")]
    entries = [Entry((tuple(tints[kind]),), labels[kind]) for kind in kinds]
    order = "larger ones fainter" if boxes else "deeper ones fainter"
    several = len(np.unique(shown.depth[:plain])) > 1
    text = _levels(shown.depth[:plain]).removeprefix(", ")
    lines = [Entry((), f"{text}, {order}" if several else text)] if plain else []
    return [*entries, *lines, *([Entry((), CUTS)] if shown.cuts is not None and len(shown.cuts.owner) else [])]


CUTS = "bold where a plane cuts the scene"


def _levels(depths: I32) -> str:
    """Their range in words, after a comma."""
    low, high = int(depths.min(initial=10**6)), int(depths.max(initial=0))
    return f", level {high}" if low >= high else f", levels {low} to {high}"


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


def of_node(rgb: Sequence[float], children: int, triangles: int) -> list[Entry]:
    """A node with these numbers of children and of drawn triangles; a leaf has no children."""
    entries = [Entry((tuple(rgb),), "node" if children else "leaf")]
    if children:
        entries.append(Entry(_ramp(), "its children, brighter where they cost more"))
    if triangles:
        number = f"its {triangles:,} triangles" if triangles > 1 else "its triangle"
        entries.append(Entry((cells.TESTED_RGB,), number))
    return entries


def of_beam() -> list[Entry]:
    """The tile of rays."""
    return [Entry(_ramp(), "leaves, brighter where more rays of the beam visit them")]


ACTIONS = {
    polygons.HANDED_ON: "beam handed on whole to the next cell",
    polygons.CLIPPED: "clipped by the cell's faces",
    polygons.SPLIT: "split among smaller cells",
    polygons.ENDED: "ended: every ray has hit",
    polygons.SINGLES: "goes on as single rays",
    polygons.LEFT: "leaves the tree",
}
"""What becomes of a beam in words."""


def of_polygons(shown: PolygonBeam) -> list[Entry]:
    """Beams of polygons, by what becomes of them."""
    entries = [Entry((polygons.RGB[action],), text) for action, text in ACTIONS.items() if shown.count(action)]
    return [*entries, *([Entry((cells.TESTED_RGB,), "cell with triangles")] if shown.path["tested"].any() else [])]


def _ramp() -> tuple[tuple[float, ...], ...]:
    places = np.linspace(colours.CELLS_FROM, 1.0, RAMP)
    return tuple(tuple(float(part) for part in rgb) for rgb in colours.false_colour(places))

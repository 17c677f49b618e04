# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of numbers of two structures for the same ray, the same rays or the same level, as text."""

from __future__ import annotations

from collections.abc import Sequence

from ..overlay.cells import Path
from .csv_files import Times
from .levels import Level, Levels
from .ray_costs import BLOCK, RayCosts

Row = tuple[str, str, str]
"""A counter, and its number in the first and in the second structure."""

NOTHING = "–"
"""Text of an unknown number."""

COLUMNS = {"NODES": "Nodes", "SAH": "SAH", "OVERLAP": "EPO", "TIME": "ns, fitted"}
"""The quantities of a level, with their titles."""


def of_paths(first: Path, second: Path) -> list[Row]:
    """The counts of one ray in two structures: nodes, planes crossed, leaves tested and passed, triangles tested."""
    counts = [
        (
            path.steps,
            len(path.crossings),
            int(path.tested.sum()),
            int((~path.tested).sum()),
            path.tests,
        )
        for path in (first, second)
    ]
    names = ("Inner nodes", "Planes", "Leaves", "Passed", "Tests")
    return [(name, f"{a:,}", f"{b:,}") for name, a, b in zip(names, *counts, strict=True)]


def of_times(first: Times, second: Times, index: int) -> list[Row]:
    """The time of the block of neighbours of the ray at `index`, and the errors of each structure."""
    a, b = (f"{one.nanoseconds[index // BLOCK]:,.0f}" for one in (first, second))
    wrong = [f"{one.wrong:,} of {one.compared:,}" for one in (first, second)]
    return [("ns, 64 neighbours", a, b), ("Wrong", wrong[0], wrong[1])]


def of_rays(first: RayCosts, second: RayCosts, index: int) -> list[Row]:
    """The counts of the ray at `index` of a set, and the means over the set. Raises ValueError for sets of different
    rays.
    """
    if len(first) != len(second) or (first.rays.origins != second.rays.origins).any():
        raise ValueError(f"{second.rays.name}: expected the same rays in both structures")
    rows = []
    for name in ("steps", "tests", "wasted"):
        a, b = getattr(first, name), getattr(second, name)
        rows.append((name.capitalize(), f"{a[index]:,}", f"{b[index]:,}"))
        rows.append(("… mean", f"{a.mean():,.1f}", f"{b.mean():,.1f}"))
    return rows


def of_levels(first: Levels, second: Levels, key: str) -> list[Row]:
    """One quantity of COLUMNS of each level of both trees, to the depth of the deeper one."""
    depth = max(len(first.levels), len(second.levels))
    return [(str(level), _cell(first, level, key), _cell(second, level, key)) for level in range(depth)]


def _cell(found: Levels, level: int, key: str) -> str:
    return cell(found.levels[level], key) if level < len(found.levels) else ""


def cell(level: Level, key: str) -> str:
    """A quantity of COLUMNS of a level as text; NOTHING for a time that could not be fitted."""
    if key == "NODES":
        return f"{level.nodes + level.leaves:,}"
    if key == "SAH":
        return f"{level.sah_share:.1%}" if level.sah_share < 0.9995 else "100%"
    if key == "OVERLAP":
        return f"{level.overlap:.3g}"
    return NOTHING if level.fitted_nanoseconds is None else f"{level.fitted_nanoseconds:.1f}"


def titles(specs: Sequence[str]) -> list[str]:
    """Names of structures that differ: without their parameters where that is enough."""
    short = [spec.partition(":")[0] for spec in specs]
    return short if len(set(short)) == len(short) else list(specs)

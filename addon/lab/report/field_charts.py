# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of the statistics of the field: shapes of trees, work of rays, cases of ray and plane, expected cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...core.measure.analysis import field
from ...core.measure.rows import Row
from ...core.report.costs import Correlation
from . import marks as marking
from .charts import logarithmic, plain_numbers
from .marks import About, Mark, legend, ordered, unnamed

SHAPES = About(
    "tree-shapes",
    "Shapes of the trees",
    "Leaves at each depth (the root has depth 0) and by the number of triangles that they hold; inner nodes and "
    "distinct directions of planes, along axes and oblique, at each level. Boxes have no planes.",
)
WORK = About(
    "ray-work",
    "Work of the rays",
    "Rays by the number of nodes that they visit and of triangles that they test, each ray on its own.",
)
EXPECTED = About(
    "sah-time",
    "Expected and measured cost",
    "Cost of a random ray by the surface area heuristic, and measured time of a ray, mean over the ray sets.",
)
CASES = About(
    "cases",
    "Cases of ray and plane",
    "Share of the inner nodes that each case of ray and split plane takes (Havran, Kopal, Bittner and Žára 1997). N: "
    "origin below the plane, P above, Z in it; 1 away from it, 2 along it, 3 the cell ends before it, 4 through it "
    "inside the cell, 5 through it before the cell. Only N4 and P4 visit both children and compute a distance.",
)


def shapes(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Depths and sizes of leaves, and nodes and directions per level. rows: one for each tree."""
    panels = figure.subplots(2, 2)
    depths, sizes, nodes, directions = panels.flat
    for row in ordered(rows, marks):
        style, levels = marks[row["spec"]].line(), field.value(row, "tree", "levels")
        depths.plot(_percent(field.value(row, "tree", "depths")), **style)
        sizes.plot(_percent(field.value(row, "tree", "size", "histogram")), **style)
        nodes.plot(levels["nodes"], **style)
        directions.plot(np.add(levels["directions_axis"], levels["directions_oblique"]), **style)
    _bins(sizes, [field.value(row, "tree", "size", "histogram") for row in rows])
    for axes, label in ((nodes, "inner nodes"), (directions, "directions of planes")):
        axes.set(xlabel="level", ylabel=label)
        if math.isfinite(axes.dataLim.minposy):
            axes.set_yscale("log", nonpositive="mask")
            plain_numbers(axes.yaxis)
    depths.set(xlabel="depth of a leaf", ylabel="leaves, %")
    sizes.set(xlabel="triangles in a leaf", ylabel="leaves, %")
    for axes in (depths, nodes, directions):
        axes.xaxis.get_major_locator().set_params(integer=True)
    _finish(figure, panels, rows, marks)


def work(figure: Any, rows: Sequence[Row], marks: dict[str, Mark], sets: Sequence[str]) -> None:
    """One line of panels per ray set: nodes visited and triangles tested."""
    panels = figure.subplots(len(sets), 2, squeeze=False)
    for line, name in zip(panels, sets, strict=True):
        for axes, key in zip(line, ("steps", "tests"), strict=True):
            known = {row["spec"]: field.value(row, "rays", name, key, "histogram") for row in ordered(rows, marks)}
            for spec, histogram in known.items():
                if histogram:
                    axes.plot(_percent(histogram), **marks[spec].line())
            _bins(axes, known.values())
        line[0].set_ylabel(f"{name}, %")
    panels[-1][0].set_xlabel("nodes visited by a ray")
    panels[-1][1].set_xlabel("triangles tested by a ray")
    _finish(figure, panels, rows, marks)


def expected(figure: Any, found: Correlation, marks: dict[str, Mark]) -> None:
    """Expected cost against measured time, with their correlations."""
    axes = figure.subplots()
    for spec, x, y in zip(found.specs, found.expected, found.measured, strict=True):
        axes.plot(x, y, **marks[spec].line() | {"linestyle": "none"})
    if not math.isnan(found.pearson):
        note = f"Pearson {found.pearson:.2f}, Spearman {found.spearman:.2f}".replace("-", "−")
        axes.set_title(note)
    logarithmic(axes)
    axes.set(xlabel="SAH cost, axis steps", ylabel="nanoseconds per ray")
    legend(figure, axes, others=sum(not marks[spec].is_chosen for spec in found.specs))


def _finish(figure: Any, panels: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Grids, and one legend for all panels."""
    for axes in panels.flat:
        axes.grid(visible=True, which="major")
        axes.set_axisbelow(True)
    legend(figure, panels.flat[0], others=unnamed(rows, marks))


def _percent(counts: Sequence[int]) -> Any:
    return 100.0 * np.array(counts) / sum(counts)


def _bins(axes: Any, histograms: Iterable[Sequence[int] | None]) -> None:
    """The ticks of histograms of 0, 1, 2–3, 4–7, 8–15, ..."""
    longest = max((len(one) for one in histograms if one), default=0)
    names = ["0", "1"] + [f"{1 << power}–{(2 << power) - 1}" for power in range(1, longest)]
    places = range(0, longest, 1 + longest // 9)
    axes.set_xticks(places, [names[place] for place in places])


def with_cases(rows: Sequence[Row]) -> list[tuple[Row, str]]:
    """The rows whose cases are counted, each with the name of its ray sets that have them."""
    return [(row, name) for row in rows for name in row["rays"] if field.value(row, "rays", name, "cases")]


def height_of_cases(rows: Sequence[Row]) -> float:
    """Height of the figure in inches."""
    return 1.8 + 1.5 * len({name for _, name in with_cases(rows)})


def cases(figure: Any, rows: Sequence[Row]) -> None:
    """One panel of bars per ray set, one colour per configuration."""
    found = with_cases(rows)
    sets = list(dict.fromkeys(name for _, name in found))
    kinds = sorted({case for row, name in found for case in field.value(row, "rays", name, "cases")})
    panels = figure.subplots(len(sets), 1, squeeze=False, sharex=True)[:, 0]
    for panel, chosen in zip(panels, sets, strict=True):
        drawn = [row for row, name in found if name == chosen]
        width = 0.8 / len(drawn)
        for number, row in enumerate(drawn):
            shares = field.value(row, "rays", chosen, "cases")
            places = [place + number * width for place in range(len(kinds))]
            heights = [100 * shares.get(case, 0.0) for case in kinds]
            colour = marking.COLOURS[number % len(marking.COLOURS)]
            panel.bar(places, heights, width * 0.92, color=colour, label=row["spec"])
        panel.set_ylabel(f"{chosen}, %")
    middle = 0.4 - 0.4 / max(1, len([row for row, name in found if name == sets[-1]]))
    panels[-1].set_xticks([place + middle for place in range(len(kinds))], [case.upper() for case in kinds])
    panels[0].legend(frameon=False)

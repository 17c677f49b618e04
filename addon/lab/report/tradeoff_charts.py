# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors against the time of a ray, as scatter plots with a row of their own for zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ...core.measure.analysis.tradeoff import FAR, GRID, HERE
from ...core.measure.rows import Row
from .charts import pareto, plain_numbers
from .marks import GREY, INK, PALE, About, Mark, legend

Kind = Literal["wrong", "ulp"]

FIRST = "wrong-time"

PLACES = {HERE: "in place", FAR: "100,000 sizes away", GRID: "touching boxes"}

NARROW = 5.0
"""Inches below which there is one panel per line, not two."""

KINDS: dict[Kind, About] = {
    "wrong": About(
        FIRST,
        "Wrong answers against the time of a ray",
        "Wrong answers against the time of a ray: hits missed, invented, or on a triangle at another distance. Full"
        " marks keep their error bounds, hollow ones do without (robust=none; Embree's default mode). The lowest "
        "row is none at all; above the dotted line an error rate would have been seen with 95 % confidence. Ringed:"
        " no other is both faster and righter. Far away positions keep seven bits, and bounds as wide as that let "
        "many triangles through to the exact test. Bars: 95 % intervals of the median time.",
    ),
    "ulp": About(
        "ulp-time",
        "Error of the distance against the time of a ray",
        "Error of the distance t, in units in the last place, against the time of a ray: the 999th of 1,000 hits, "
        "and in a thin line up to the largest. The lowest row is exact for every ray. Any-hit rays have no "
        "distance.",
    ),
}
"""The figure of each kind of error."""


class Dot(NamedTuple):
    """A point of a panel. value, high: 0 in the row of zeros. fast, slow: 95 % interval of its time, or the time."""

    spec: str
    bounds: bool
    ns: float
    fast: float
    slow: float
    value: float
    high: float


def dots(rows: Sequence[Row], place: str, name: str, kind: Kind) -> list[Dot]:
    """The points of one panel."""
    found = []
    for row in rows:
        for point in row.get("tradeoff") or ():
            if point["place"] != place or point["set"] != name or point["ns"] is None or not point["rays"]:
                continue
            if kind == "wrong":
                value = high = 1e6 * point["wrong"] / point["rays"]
            elif point["ulp_max"] is None or point["ulp_p999"] is None:
                continue
            else:
                value, high = float(point["ulp_p999"]), float(point["ulp_max"])
            ns = point["ns"]
            between = ns.get("low", ns["med"]), ns.get("high", ns["med"])
            found.append(Dot(row["spec"], point["bounds"], ns["med"], *between, value, high))
    return found


def panels_of(rows: Sequence[Row], kind: Kind) -> list[tuple[str, str]]:
    """The scenes and ray sets that are drawn: those with points, for wrong answers those with any."""
    found = _measured(rows, kind)
    return [pair for pair in found if kind != "wrong" or any(dot.value for dot in dots(rows, *pair, kind))]


def without_errors(rows: Sequence[Row]) -> str:
    """The scenes and ray sets on which no answer was wrong, in a sentence; "" without any."""
    drawn = panels_of(rows, "wrong")
    right: dict[str, list[str]] = {}
    for place, name in _measured(rows, "wrong"):
        if (place, name) not in drawn:
            right.setdefault(place, []).append(name)
    counted = [point for row in rows for point in row.get("tradeoff") or () if point["rays"]]
    told = []
    for place, names in right.items():
        own = [point for point in counted if point["place"] == place and point["set"] in names]
        tracers = len({(row["spec"], point["bounds"]) for row in rows for point in row.get("tradeoff") or ()})
        fewest = min(point["rays"] for point in own)
        times = [point["ns"]["med"] for point in own if point["ns"]]
        told.append(
            f"No wrong answer {PLACES[place]}, {', '.join(names)}: {tracers} tracers, at least {fewest:,} rays each, "
            f"{min(times):.0f} to {max(times):.0f} ns a ray."
        )
    return " ".join(told)


def _measured(rows: Sequence[Row], kind: Kind) -> list[tuple[str, str]]:
    """The scenes and ray sets with points, scene by scene."""
    known = dict.fromkeys((point["place"], point["set"]) for row in rows for point in row.get("tradeoff") or ())
    return [pair for pair in sorted(known, key=lambda pair: list(PLACES).index(pair[0])) if dots(rows, *pair, kind)]


def height(rows: Sequence[Row], kind: Kind, width: float = 2 * NARROW) -> float:
    """Height of a figure of this width in inches."""
    return 2.35 * -(-len(panels_of(rows, kind)) // _columns(rows, kind, width)) + 0.75


def _columns(rows: Sequence[Row], kind: Kind, width: float) -> int:
    """Number of panels in a line."""
    pairs = panels_of(rows, kind)
    if kind == "wrong":
        return 1 if width < NARROW else min(2, max(len(pairs), 1))
    places = [place for place, _ in pairs]
    return max(map(places.count, places), default=1)


def draw(figure: Any, rows: Sequence[Row], marks: dict[str, Mark], kind: Kind) -> None:
    """One panel per scene and ray set."""
    pairs = panels_of(rows, kind)
    columns = _columns(rows, kind, figure.get_size_inches()[0])
    lines = -(-len(pairs) // columns)
    outer = figure.add_gridspec(lines, columns)
    for number, (place, name) in enumerate(pairs):
        line, column = divmod(number, columns)
        found = dots(rows, place, name, kind)
        inner = outer[line, column].subgridspec(2, 1, height_ratios=(6, 1), hspace=0.06)
        upper, lower = figure.add_subplot(inner[0]), figure.add_subplot(inner[1])
        lower.sharex(upper)
        _panel(upper, lower, found, marks)
        upper.set_title(f"{name.capitalize()}, {PLACES[place]}", fontsize=9)
        if kind == "wrong":
            _detectable(upper, lower, rows, place, name)
        if column == 0:
            upper.set_ylabel("wrong per million" if kind == "wrong" else "error of t, ulp")
        if number + columns >= len(pairs):
            lower.set_xlabel("ns per ray")
    _legend(figure, rows, marks)


def _panel(upper: Any, lower: Any, found: Sequence[Dot], marks: dict[str, Mark]) -> None:
    """The points of one panel: `upper` is logarithmic, `lower` the row of zeros; the broken axis joins them."""
    best = pareto([(dot.ns, dot.value) for dot in found])
    for dot in sorted(found, key=lambda dot: marks[dot.spec].is_chosen):
        mark = marks[dot.spec]
        axes = upper if dot.value > 0 else lower
        style = mark.line() | {"label": None, "linestyle": "none", "clip_on": False}
        axes.plot(dot.ns, dot.value, **style, markerfacecolor=mark.colour if dot.bounds else "white")
        if mark.is_chosen:
            axes.plot([dot.fast, dot.slow], [dot.value] * 2, "-", color=mark.colour, linewidth=1, zorder=2)
        if dot.high > dot.value > 0:
            upper.plot([dot.ns, dot.ns], [dot.value, dot.high], "-", color=mark.colour, linewidth=0.7, zorder=1)
        if (dot.ns, dot.value) in best:
            axes.plot(dot.ns, dot.value, "o", color="none", markeredgecolor=INK, markersize=11, zorder=6, clip_on=False)
    _scales(upper, lower, found)


def _scales(upper: Any, lower: Any, found: Sequence[Dot]) -> None:
    """Logarithmic time; logarithmic errors above the break, and a single tick at 0 below it."""
    times = [dot.ns for dot in found]
    errors = [value for dot in found for value in (dot.value, dot.high) if value > 0]
    upper.set_xscale("log")
    upper.set_xlim(min(times) / 1.25, max(times) * 1.25)
    plain_numbers(lower.xaxis, narrow=True)
    upper.set_yscale("log")
    low, high = (min(errors), max(errors)) if errors else (1.0, 1e6)
    upper.set_ylim(10 ** np.floor(np.log10(low) - 0.3), 10 ** np.ceil(np.log10(high) + 0.1))
    upper.tick_params(labelbottom=False, bottom=False, which="both")
    upper.spines["bottom"].set_visible(False)
    upper.grid(visible=True, axis="both")
    lower.grid(visible=True, axis="x")
    lower.set_ylim(-1, 1)
    lower.set_yticks([0], ["0"])
    lower.axhspan(-1, 1, color="#f4f6f9", zorder=0)
    # Two short strokes mark the broken axis.
    stroke = {"marker": [(-1, -0.5), (1, 0.5)], "markersize": 7, "linestyle": "none", "color": INK, "clip_on": False}
    upper.plot([0], [0], transform=upper.transAxes, **stroke)
    lower.plot([0], [1], transform=lower.transAxes, **stroke)
    if not errors:
        upper.text(0.5, 0.5, "no errors", transform=upper.transAxes, ha="center", va="center", color=GREY)


def _detectable(upper: Any, lower: Any, rows: Sequence[Row], place: str, name: str) -> None:
    """The error rate that the number of rays excludes where none was wrong: rule of three, 95 % confidence."""
    counts = [
        point["rays"]
        for row in rows
        for point in row.get("tradeoff") or ()
        if (point["place"], point["set"]) == (place, name)
    ]
    rate = 3e6 / min(counts)
    low, high = upper.get_ylim()
    if rate < low:
        upper.set_ylim(10 ** np.floor(np.log10(rate)), high)
    upper.axhline(rate, color=PALE, linestyle=":", linewidth=1.2)
    # Between both axes, where no point lies.
    lower.text(1.0, 1.12, f"none of {min(counts):,}", transform=lower.transAxes, ha="right", va="bottom", fontsize=6.5)


def _legend(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """The chosen configurations, and what full and hollow marks mean."""
    from matplotlib.lines import Line2D

    shown = [marks[row["spec"]] for row in rows if row.get("tradeoff")]
    found = [
        Line2D([], [], color=mark.colour, marker=mark.marker, markersize=mark.size, linestyle="none", label=mark.label)
        for mark in shown
        if mark.is_chosen
    ]
    style: dict[str, Any] = {"color": GREY, "marker": "o", "markersize": 5.5, "linestyle": "none"}
    found += [
        Line2D([], [], **style, label="with bounds"),
        Line2D([], [], **style, markerfacecolor="white", label="without"),
    ]
    legend(figure, figure.axes[0], others=len(shown) - len(found) + 2, more=found)

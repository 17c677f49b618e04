# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the report, drawn with matplotlib. Each function takes a figure and the rows of one scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..measure import costmap, curve
from ..measure.offsets import is_unguarded
from ..measure.rows import Row, agrees
from ..measure.thesis import Published
from ..structures.specs import structure_of
from . import ksweep
from .costs import PARTS, Fit

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b6472")
"""Distinguishable with any kind of colour vision (Okabe and Ito 2008), without the yellow that vanishes on white."""

MARKERS = "osD^vP*Xh<>pd8"

WRONG = "#d55e00"
INK = "#1c1f24"
GREY = "#8a93a3"

LABELLED = 12
"""Largest number of lines with a legend beside the plot; beyond it the legend stands in columns below."""

LONG = 24
"""Longest name, in characters, that fits beside a plot."""

SPEEDS = (
    "Speed of each ray set: median, and from the slowest to the fastest round. Structures are in the order of their "
    "summed time, Embree in grey; a cross marks answers that differ from the reference."
)
BUILD = (
    "Build against tracing, both in seconds. Along a grey line the sum of both is the same; the black line joins the "
    "structures that no other beats in both (the Pareto front). For more rays the front moves up, for fewer down."
)
ERROR = (
    "Error against run time, against a converged picture. All structures render the same picture, so at equal samples "
    "their points lie at one height and only the time differs. Dotted: the slope of independent samples, −1/2 for RMSE "
    "and −1 for its square; well spread samples are steeper. Where a few pixels hold rare bright light, as behind "
    "glass, they decide RMSE and make it flatter; relMSE leaves the worst out."
)
SCALING = (
    "Time against the number of primary rays: the same view in more and more pixels. A line flatter than the dotted "
    "one gains from denser rays. A structure that is too slow for a view has no point there."
)
K_SWEEP = (
    "Time relative to the kd-tree against k, median over the seeds, from the smallest to the largest. Dashed: the "
    "medians that Hoobergs (2019) published for the most similar scene, if their file is present."
)
COSTS = (
    "Measured time per ray, and its fit by the steps and tests of all structures: the bars use the same cost per step "
    "and per test for every structure. The distance of a dot from the end of its bar is not explained by these counts."
)
OFFSETS = (
    "Wrong answers on the grid of touching boxes, moved away from the origin: with the error bounds that every "
    "structure has, and with the same traversal without them. A triangle at the bottom marks no wrong ray; it lies at "
    "the rate that this number of rays excludes with 95 % confidence."
)

APART = ("embree", "brute")
"""The yardstick and the reference, drawn in grey."""

MAPS = (
    "Nodes visited and triangles tested by the ray of each pixel, all on one scale, in the order of their means. The "
    "rays of a tile or a beam share its work evenly; those of traversal=auto are counted one by one."
)
MAP_COLUMNS = 7

Styles = dict[str, tuple[str, str]]
"""Configuration to colour and marker."""


def styles(rows: Sequence[Row]) -> Styles:
    """A colour and a marker for each configuration, the same in all plots of a scene. Families of names
    share a colour.
    """
    families = [name for name in dict.fromkeys(_family(row["spec"]) for row in rows) if name not in APART]
    found: Styles = {}
    members: dict[str, int] = {}
    for row in rows:
        family = _family(row["spec"])
        number = members.setdefault(family, 0)
        members[family] += 1
        colour = GREY if family in APART else COLOURS[families.index(family) % len(COLOURS)]
        found[row["spec"]] = colour, MARKERS[number % len(MARKERS)]
    return found


def _family(spec: str) -> str:
    return structure_of(spec).partition("-")[0].rstrip("0123456789")


def speeds(figure: Any, rows: Sequence[Row]) -> None:
    """A dot for each structure and set, with whiskers over the rounds; one panel per set, one line per structure."""
    sets = list(dict.fromkeys(name for row in rows for name in row["rays"]))
    ordered = sorted(rows, key=lambda row: -tracing_seconds(row))
    panels = figure.subplots(1, len(sets), sharey=True, squeeze=False)[0]
    # Draw one panel per ray set, slowest structure at the bottom.
    for axes, name in zip(panels, sets, strict=True):
        for place, row in enumerate(ordered):
            speed = (row["rays"].get(name) or {}).get("mrays_s")
            if speed:
                wrong = row["spec"] != "embree" and not agrees(row)
                colour = WRONG if wrong else GREY if row["spec"] == "embree" else COLOURS[0]
                axes.plot([speed["min"], speed["max"]], [place, place], "-", color=colour, linewidth=2, alpha=0.5)
                axes.plot(speed["med"], place, "X" if wrong else "o", color=colour, markersize=4.5)
        axes.set_xscale("log")
        axes.set_title(name)
        axes.set_xlabel("million rays/s")
        axes.grid(visible=True, axis="both")
        axes.set_axisbelow(True)
        _plain_numbers(axes.xaxis)
    panels[0].set_yticks(range(len(ordered)), [row["spec"] for row in ordered])
    panels[0].set_ylim(-0.7, len(ordered) - 0.3)


def tracing_seconds(row: Row) -> float:
    """Seconds to trace one million rays of each set, summed."""
    return float(sum(1.0 / one["mrays_s"]["med"] for one in row["rays"].values() if one["mrays_s"]))


def build_against_tracing(figure: Any, rows: Sequence[Row], styles: Styles) -> None:
    """Build seconds against the seconds to trace one million rays of each set."""
    axes = figure.subplots()
    points = [(row["spec"], row["build_s"]["med"], tracing_seconds(row)) for row in rows if tracing_seconds(row)]
    for spec, build, tracing in points:
        colour, marker = styles[spec]
        axes.plot(max(build, 1e-5), tracing, marker, color=colour, markersize=7, label=spec, zorder=3)
    logarithmic(axes)
    # Draw the Pareto front of build against tracing.
    low, high = axes.get_xlim(), axes.get_ylim()
    front = pareto([(max(build, 1e-5), tracing) for _, build, tracing in points])
    axes.plot(*zip(*front, strict=True), "-", color=INK, linewidth=1.2, zorder=2)
    # Draw lines of equal total time, labelled at their right end inside the axes.
    xs = np.geomspace(low[0], low[1], 200)
    for total in (digit * 10.0**power for power in range(-5, 5) for digit in (1, 2, 5)):
        inside = (xs < total) & (total - xs < high[1]) & (total - xs > high[0])
        if inside.sum() > 1:
            ys = total - xs[inside]
            axes.plot(xs[inside], ys, color="#c3cad6", linewidth=0.8, zorder=1)
            axes.annotate(f"{total:g} s", (xs[inside][-1], ys[-1]), (2, 3), textcoords="offset points", color=GREY)
    axes.set_xlim(low)
    axes.set_ylim(high)
    # Name the structures on the front.
    for spec, build, tracing in points:
        if (max(build, 1e-5), tracing) in front:
            axes.annotate(spec, (max(build, 1e-5), tracing), (5, 5), textcoords="offset points", fontsize=8)
    axes.set_xlabel("build, seconds")
    axes.set_ylabel("one million rays of each set, seconds")
    _legend(axes, len(points))


def pareto(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other point beats in both coordinates, from left to right."""
    front: list[tuple[float, float]] = []
    for x, y in sorted(points):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front


def error_against_time(figure: Any, rows: Sequence[Row], styles: Styles) -> None:
    """RMSE against seconds, without and with the build, and relMSE, with reference slopes −1/2 and −1."""
    kinds = (("rmse", False), ("rmse", True), ("relmse", False))
    panels = figure.subplots(1, len(kinds))
    longest = max((row["curve"] for row in rows), key=len)
    for axes, (key, with_build) in zip(panels, kinds, strict=True):
        for row in rows:
            build = row["build_s"]["med"] if with_build else 0.0
            seconds = [point["seconds"] + build for point in row["curve"]]
            colour, marker = styles[row["spec"]]
            errors = [point[key] for point in row["curve"]]
            axes.plot(seconds, errors, marker + "-", color=colour, label=row["spec"], markersize=5, linewidth=1)
        # Draw the slope of independent samples through the longest curve.
        power = -0.5 if key == "rmse" else -1.0
        if len(longest) > 1 and not with_build:
            ends = [longest[i]["seconds"] for i in (0, -1)]
            line = [0.75 * longest[0][key] * (x / ends[0]) ** power for x in ends]
            axes.plot(ends, line, ":", color=INK)
            axes.set_title(f"fitted slope {curve.slope(longest, key):.2f}".replace("-", "−"))
        logarithmic(axes)
        axes.set_xlabel("build and render, seconds" if with_build else "render, seconds")
        axes.set_ylabel({"rmse": "RMSE", "relmse": "relMSE, the worst 0.1 % left out"}[key])
    _legend(figure, len(rows), panels[0])


def time_against_rays(figure: Any, rows: Sequence[Row], styles: Styles) -> None:
    """Seconds against primary rays, log-log."""
    axes = figure.subplots()
    for row in rows:
        colour, marker = styles[row["spec"]]
        counts = [point["rays"] for point in row["scaling"]]
        seconds = [point["seconds"] for point in row["scaling"]]
        axes.plot(counts, seconds, marker + "-", color=colour, label=row["spec"], markersize=5, linewidth=1)
    # Draw a line of constant time per ray below the fastest structure.
    fastest = min(rows, key=lambda row: row["scaling"][-1]["seconds"] / row["scaling"][-1]["rays"])["scaling"]
    first, last = fastest[0]["rays"], fastest[-1]["rays"]
    start = 0.7 * fastest[-1]["seconds"] * first / last
    axes.plot([first, last], [start, start * last / first], ":", color=INK)
    logarithmic(axes)
    axes.set_xlabel("primary rays")
    axes.set_ylabel("seconds")
    _legend(axes, len(rows))


def k_sweep(figure: Any, scene: str, base: str, lines: Sequence[ksweep.Line], published: Published | None) -> None:
    """Percent of the base's time against k, with the published medians dashed."""
    axes = figure.subplots()
    for number, line in enumerate(lines):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number // len(COLOURS) % len(MARKERS)]
        axes.fill_between(line.k, line.low, line.high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(line.k, line.median, marker + "-", color=colour, label=line.label, markersize=5)
        other = published.medians(scene, line.structure) if published is not None else {}
        if other:
            axes.plot(sorted(other), [other[k] for k in sorted(other)], "--", color=colour, linewidth=1)
    axes.axhline(100, color=GREY, linewidth=1)
    axes.set_xlabel("k, directions per node")
    axes.set_ylabel(f"time, percent of {base}")
    axes.grid(visible=True)
    _legend(axes, len(lines))


def fitted_costs(figure: Any, fit: Fit) -> None:
    """Stacked bars of the fitted parts, and dots at the measured times."""
    axes = figure.subplots()
    order = np.argsort(fit.measured)[::-1]
    places = np.arange(len(order))
    left = np.zeros(len(order))
    for number, (key, label) in enumerate(PARTS.items()):
        width = fit.parts[order, number]
        if width.any():
            each = fit.nanoseconds[key]
            axes.barh(places, width, 0.7, left, color=COLOURS[number], label=f"{label}, {each:.1f} ns each")
            left = left + width
    # Mark the measured times, which the stacked bars approximate.
    axes.plot(fit.measured[order], places, "o", color=INK, markersize=4, label="measured")
    axes.set_yticks(places, [fit.specs[i] for i in order])
    axes.set_ylim(-0.7, len(order) - 0.3)
    axes.set_xlabel(
        f"nanoseconds per ray, mean over the ray sets; the fit explains {100 * max(fit.explained, 0):.0f} %"
    )
    axes.grid(visible=True, axis="x")
    axes.set_axisbelow(True)
    figure.legend(loc="outside lower center", ncols=4)


def wrong_against_offset(figure: Any, rows: Sequence[Row], styles: Styles) -> None:
    """Share of wrong rays against the offset; no wrong ray is a triangle at the rate excluded with 95 % confidence."""
    axes = figure.subplots()
    places = {point["offset"]: number for number, point in enumerate(rows[0]["offsets"])}
    bounded = [row for row in rows if not is_unguarded(row["spec"])]
    # Draw a line for each traversal without error bounds. Rule of three: 0 wrong of n rays excludes a rate above 3/n.
    for row in rows:
        key = "wrong" if is_unguarded(row["spec"]) else "wrong_unguarded"
        points = [point for point in row["offsets"] if point[key] is not None]
        if points:
            colour, marker = styles[row["spec"]]
            shares = [max(p[key], 3.0 * (not p[key])) / p["rays"] for p in points]
            xs = [places[p["offset"]] for p in points]
            axes.plot(xs, shares, marker + "-", color=colour, markersize=5, linewidth=1, label=row["spec"])
    rays = rows[0]["offsets"][0]["rays"]
    # Draw the worst of all structures with error bounds as one series.
    if bounded:
        worst = {offset: max(row["offsets"][place]["wrong"] for row in bounded) for offset, place in places.items()}
        for offset, wrong in worst.items():
            axes.plot(
                places[offset], (wrong or 3) / rays, "X" if wrong else "v", color=WRONG if wrong else INK, markersize=8
            )
        label = f"with bounds: all {len(bounded)}" if len(bounded) > 1 else "with bounds"
        axes.plot([], [], "v", color=INK, label=label)
    axes.set_yscale("log")
    axes.set_xticks(list(places.values()), [_plain(offset) for offset in places])
    axes.yaxis.set_major_formatter(lambda share, _: f"{100 * share:g} %")
    axes.set_xlabel("distance from the origin, in boxes")
    axes.set_ylabel(f"wrong answers to {rays:,} rays")
    axes.grid(visible=True)
    _legend(axes, len(rows), title="without bounds")


def cost_maps(figure: Any, rows: Sequence[Row]) -> None:
    """A picture for each structure, all on one colour scale."""
    maps = sorted(((costmap.unpacked(row["map"]), row["spec"]) for row in rows), key=lambda one: one[0].mean())
    high = costmap.scale_end([values for values, _ in maps])
    columns = min(MAP_COLUMNS, len(maps))
    panels = figure.subplots(-(-len(maps) // columns), columns, squeeze=False)
    image = None
    for place, axes in enumerate(panels.flat):
        axes.set_axis_off()
        if place < len(maps):
            values, spec = maps[place]
            image = axes.imshow(values, cmap="inferno", vmin=0, vmax=high, origin="lower", interpolation="nearest")
            axes.set_title(f"{_short(spec)}\n{costmap.summary(values)}", fontsize=6.5, fontweight="normal")
    bar = figure.colorbar(image, ax=panels, location="bottom", fraction=0.02, pad=0.02, aspect=60)
    bar.set_label("steps and tests per ray")


def _short(spec: str) -> str:
    """A name short enough for a small picture's title."""
    return spec if len(spec) <= LONG else f"{spec[: LONG - 1]}…"


def cost_map_height(rows: Sequence[Row]) -> float:
    """Height in inches of the maps of all rows."""
    columns = min(MAP_COLUMNS, len(rows))
    height, width = rows[0]["map"]["height"], rows[0]["map"]["width"]
    return -(-len(rows) // columns) * (9.6 / columns * float(height / width) + 0.32) + 0.7


def logarithmic(axes: Any) -> None:
    """Make both axes logarithmic, with plain numbers and a grid; an axis with only zeros stays linear."""
    for name, axis, least in (("x", axes.xaxis, axes.dataLim.minposx), ("y", axes.yaxis, axes.dataLim.minposy)):
        if not axes.has_data() or np.isfinite(least):
            axes.set(**{f"{name}scale": "log"})
            _plain_numbers(axis)
    axes.grid(visible=True, which="major")
    axes.set_axisbelow(True)


def _plain(value: float) -> str:
    return f"{value:,g}" if value < 1e6 else f"{value / 1e6:,g} million"


def _plain_numbers(axis: Any) -> None:
    """Label an axis 0.1, 1, 10 instead of with powers of ten, and label minor ticks if it spans one decade or less."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    plain = FuncFormatter(lambda value, _: _plain(value))
    axis.set_major_formatter(plain)
    low, high = axis.get_view_interval()
    narrow = high < 30 * low
    axis.set_minor_locator(LogLocator(subs=(2, 3, 5) if narrow else (2, 5)))
    axis.set_minor_formatter(plain if narrow else NullFormatter())


def _legend(where: Any, count: int, handles_of: Any = None, *, title: str | None = None) -> None:
    """Place the legend beside the plot if it is short, else in columns below it."""
    handles, labels = (handles_of or where).get_legend_handles_labels()
    below = where if hasattr(where, "subplots") else where.figure
    if below is where or count > LABELLED or max(map(len, labels)) > LONG:
        below.legend(handles, labels, loc="outside lower center", ncols=_columns(labels), title=title)
    else:
        where.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5), title=title)


def _columns(labels: Sequence[str]) -> int:
    """Number of legend columns that fit the page."""
    return max(1, min(5, 150 // (max(map(len, labels)) + 6)))


def room_for_legend(labels: Sequence[str]) -> float:
    """Height in inches that this legend takes below a plot."""
    if len(labels) <= LABELLED and max(map(len, labels)) <= LONG:
        return 0.0
    return 0.17 * -(-len(labels) // _columns(labels))

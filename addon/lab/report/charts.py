# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the report, drawn with matplotlib. Each function takes a figure and the rows of one scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.measure import costmap, inference, yardstick
from ...core.measure.offsets import is_unguarded
from ...core.measure.rows import Row, agrees
from ...core.report.costs import PARTS, Fit
from .marks import COLOURS, GREY, INK, MARKERS, WRONG, About, Mark, legend, ordered, short, unnamed
from .thesis import Line, Published

SPEEDS = About(
    "speed",
    "Speed",
    "Speed of each ray set: median, and its 95 % interval over the rounds (bootstrap), thin from the slowest to the "
    "fastest round. Structures are in the order of their summed time, Embree in grey; a cross marks answers that "
    "differ from the reference.",
)
BUILD = About(
    "build-trace",
    "Build against tracing",
    "Build against tracing, both in seconds. Along a grey line the sum of both is the same; the black line joins the "
    "structures that no other beats in both (the Pareto front). For more rays the front moves up, for fewer down. "
    "Crosses: 95 % intervals.",
)
SCALING = About(
    "number-of-rays",
    "Time against the number of rays",
    "Time of a primary ray against their number: the same view in more and more pixels. A falling line gains from rays "
    "that lie closer together. A structure that is too slow for a view has no point there. Bands: 95 % intervals of "
    "the medians.",
)
K_SWEEP = About(
    "directions",
    "How many directions",
    "Time relative to the kd-tree against k, median over the seeds, from the smallest to the largest. Dashed: the "
    "medians that Hoobergs (2019) published for the most similar scene, if their file is present.",
)
COSTS = About(
    "fitted-costs",
    "Fitted costs",
    "Measured time per ray, and its fit by the steps and tests of all structures, apart for rays that go one by one "
    "and in groups: the bars use the same cost per step and per test for every structure. The distance of a dot from "
    "the end of its bar is not explained by these counts. In brackets the 95 % interval of each cost where costs may "
    "be negative; a cost is not identifiable if it contains zero.",
)
OFFSETS = About(
    "offsets",
    "Wrong answers far from the origin",
    "Wrong answers on the grid of touching boxes, moved away from the origin: with the error bounds that every "
    "structure has, and with the same traversal without them. A triangle at the bottom marks no wrong ray; it lies at "
    "the rate that this number of rays excludes with 95 % confidence.",
)

MAPS = About(
    "cost-maps",
    "What each pixel costs",
    "Nodes visited and triangles tested by the ray of each pixel, in the order of their means. Each map has its own "
    "scale, from the 1st to the 99th percentile of its pixels, which are above it. The rays of a tile or a beam share "
    "its work evenly.",
)
ONE_SCALE = "one scale for all maps"
"""Label of the switch to maps that can be compared by their colours."""

OWN_SCALE = (1, 99)
"""Percentiles of a map's pixels at the ends of its own scale."""

MAP_COLUMNS = 7


def speeds(figure: Any, rows: Sequence[Row]) -> None:
    """A dot for each structure and set, with whiskers over the rounds; one panel per set, one line per structure."""
    sets = list(dict.fromkeys(name for row in rows for name in row["rays"]))
    slowest_first = sorted(rows, key=lambda row: -tracing_seconds(row))
    panels = figure.subplots(1, len(sets), sharey=True, squeeze=False)[0]
    # Draw one panel per ray set, slowest structure at the bottom.
    for axes, name in zip(panels, sets, strict=True):
        for place, row in enumerate(slowest_first):
            speed = (row["rays"].get(name) or {}).get("mrays_s")
            if speed:
                wrong = row["spec"] != yardstick.SPEC and not agrees(row)
                colour = WRONG if wrong else GREY if row["spec"] == "embree" else COLOURS[0]
                axes.plot([speed["min"], speed["max"]], [place, place], "-", color=colour, linewidth=0.8, alpha=0.5)
                if "low" in speed:
                    axes.plot([speed["low"], speed["high"]], [place, place], "-", color=colour, linewidth=3, alpha=0.5)
                axes.plot(speed["med"], place, "X" if wrong else "o", color=colour, markersize=4.5)
        axes.set_xscale("log")
        axes.set_title(name)
        axes.set_xlabel("million rays/s")
        axes.grid(visible=True, axis="both")
        axes.set_axisbelow(True)
        plain_numbers(axes.xaxis)
    panels[0].set_yticks(range(len(slowest_first)), [row["spec"] for row in slowest_first])
    panels[0].set_ylim(-0.7, len(slowest_first) - 0.3)


def tracing_seconds(row: Row) -> float:
    """Seconds to trace one million rays of each set, summed."""
    return float(sum(1.0 / one["mrays_s"]["med"] for one in row["rays"].values() if one["mrays_s"]))


def build_against_tracing(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Build seconds against the seconds to trace one million rays of each set."""
    axes = figure.subplots()
    points = [(row["spec"], row["build_s"]["med"], tracing_seconds(row)) for row in rows if tracing_seconds(row)]
    for spec, build, tracing in points:
        line = marks[spec].line() | {"linestyle": "none", "markersize": marks[spec].size + 1.5}
        axes.plot(max(build, 1e-5), tracing, **line)
    for row in rows:
        low_high, mark = _intervals(row), marks[row["spec"]]
        if low_high is not None and mark.is_chosen:
            (left, right), (below, above) = low_high
            axes.plot([left, right], [tracing_seconds(row)] * 2, "-", color=mark.colour, linewidth=1)
            axes.plot([max(row["build_s"]["med"], 1e-5)] * 2, [below, above], "-", color=mark.colour, linewidth=1)
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
            axes.annotate(short(spec), (max(build, 1e-5), tracing), (5, 5), textcoords="offset points", fontsize=8)
    axes.set_xlabel("build, seconds")
    axes.set_ylabel("one million rays of each set, seconds")
    legend(figure, axes, others=unnamed(rows, marks))


def _intervals(row: Row) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """95 % intervals of the build and of tracing one million rays of each set; None where one has too few rounds."""
    build, timed = row["build_s"], [one["rounds"] for one in row["rays"].values() if one["rounds"]]
    if "low" not in build or len(set(map(len, timed))) != 1:
        return None
    tracing = inference.interval(sum(1.0 / np.array(rounds) for rounds in timed))
    return None if tracing is None else ((build["low"], build["high"]), tracing)


def pareto(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other point beats in both coordinates, from left to right."""
    front: list[tuple[float, float]] = []
    for x, y in sorted(points):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front


def time_against_rays(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Nanoseconds per ray against primary rays, log-log."""
    axes = figure.subplots()
    for row in ordered(rows, marks):
        counts = [point["rays"] for point in row["scaling"]]
        nanoseconds = [1e9 * point["seconds"] / point["rays"] for point in row["scaling"]]
        band = [point for point in row["scaling"] if "low" in point]
        if band and marks[row["spec"]].is_chosen:
            ends = [[1e9 * point[key] / point["rays"] for point in band] for key in ("low", "high")]
            axes.fill_between(
                [point["rays"] for point in band], *ends, color=marks[row["spec"]].colour, alpha=0.15, linewidth=0
            )
        axes.plot(counts, nanoseconds, **marks[row["spec"]].line())
    logarithmic(axes)
    axes.set_xlabel("primary rays of one view")
    axes.set_ylabel("nanoseconds per ray")
    legend(figure, axes, others=unnamed(rows, marks))


def k_sweep(figure: Any, scene: str, base: str, lines: Sequence[Line], published: Published | None) -> None:
    """Percent of the base's time against k, with the published medians dashed."""
    axes = figure.subplots()
    for number, line in enumerate(lines):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number // len(COLOURS) % len(MARKERS)]
        axes.fill_between(line.k, line.low, line.high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(line.k, line.median, marker + "-", color=colour, label=line.label, markersize=5)
        other = published.by_k(scene, line.structure) if published is not None else {}
        if other:
            axes.plot(sorted(other), [other[k] for k in sorted(other)], "--", color=colour, linewidth=1)
    axes.axhline(100, color=GREY, linewidth=1)
    axes.set_xlabel("k, directions per node")
    axes.set_ylabel(f"time, percent of {base}")
    axes.grid(visible=True)
    legend(figure, axes)


def fitted_costs(figure: Any, fits: Sequence[Fit]) -> None:
    """A panel for each way of rays: stacked bars of the fitted parts, and dots at the measured times."""
    heights = [costs_height([fit]) for fit in fits]
    for panel, fit in zip(
        figure.subfigures(len(fits), 1, squeeze=False, height_ratios=heights).flat, fits, strict=True
    ):
        axes = panel.subplots()
        order = np.argsort(fit.measured)[::-1]
        places = np.arange(len(order))
        left = np.zeros(len(order))
        # Draw the bars of each part; one of zero width has a label, which states that its cost is not identifiable.
        for number, key in enumerate(fit.nanoseconds):
            width = fit.parts[order, number]
            colour = COLOURS[list(PARTS).index(key)]
            axes.barh(places, width, 0.7, left, color=colour, label=f"{PARTS[key]}: {fit.told(key)}")
            left = left + width
        # Mark the measured times, which the stacked bars approximate.
        axes.plot(fit.measured[order], places, "o", color=INK, markersize=4, label="measured")
        axes.set_title(f"Rays {fit.rays}")
        axes.set_yticks(places, [fit.specs[i] for i in order])
        axes.set_ylim(-0.7, len(order) - 0.3)
        axes.set_xlabel(
            f"nanoseconds per ray, mean over the ray sets; the fit explains {100 * max(fit.explained, 0):.0f} %"
        )
        axes.grid(visible=True, axis="x")
        axes.set_axisbelow(True)
        panel.legend(loc="outside lower center", ncols=3)


def costs_height(fits: Sequence[Fit]) -> float:
    """Height in inches of the fitted costs."""
    return sum(2.0 + 0.2 * len(fit.specs) for fit in fits)


def wrong_against_offset(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Share of wrong rays against the offset; no wrong ray is a triangle at the rate excluded with 95 % confidence."""
    axes = figure.subplots()
    places = {point["offset"]: number for number, point in enumerate(rows[0]["offsets"])}
    bounded = [row for row in rows if not is_unguarded(row["spec"])]
    # Draw a line for each traversal without error bounds. Rule of three: 0 wrong of n rays excludes a rate above 3/n.
    for row in ordered(rows, marks):
        key = "wrong" if is_unguarded(row["spec"]) else "wrong_unguarded"
        points = [point for point in row["offsets"] if point[key] is not None]
        if points:
            shares = [max(p[key], 3.0 * (not p[key])) / p["rays"] for p in points]
            axes.plot([places[p["offset"]] for p in points], shares, **marks[row["spec"]].line())
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
    legend(figure, axes, others=unnamed(rows, marks))


def cost_maps(figure: Any, rows: Sequence[Row], *, common: bool = False) -> None:
    """A picture for each structure. common: all on one colour scale from 0, instead of each on its own."""
    maps = sorted(((costmap.unpacked(row["map"]), row["spec"]) for row in rows), key=lambda one: one[0].mean())
    high = costmap.scale_end([values for values, _ in maps])
    columns = min(MAP_COLUMNS, len(maps))
    panels = figure.subplots(-(-len(maps) // columns), columns, squeeze=False)
    image = None
    for place, axes in enumerate(panels.flat):
        axes.set_axis_off()
        if place < len(maps):
            values, spec = maps[place]
            low, end = (0.0, high) if common else map(float, np.percentile(values, OWN_SCALE))
            told = costmap.summary(values) if common else f"{costmap.number(low)} to {costmap.number(end)}"
            # In shares of its scale, so that the bar of one map serves all.
            shown = (values - low) / max(end - low, 1e-9)
            image = axes.imshow(shown, cmap="inferno", vmin=0, vmax=1, origin="lower", interpolation="nearest")
            axes.set_title(f"{short(spec)}\n{told}", fontsize=6.5, fontweight="normal")
    bar = figure.colorbar(image, ax=panels, location="bottom", fraction=0.02, pad=0.02, aspect=60)
    bar.set_label("steps and tests per ray")
    if common:
        ends = costmap.ticks(high)
        bar.set_ticks([end / high for end in ends], labels=[costmap.number(end) for end in ends])
    else:
        bar.set_ticks([0, 1], labels=[f"percentile {percent} of each map" for percent in OWN_SCALE])


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
            plain_numbers(axis)
    axes.grid(visible=True, which="major")
    axes.set_axisbelow(True)


def _plain(value: float) -> str:
    return f"{value:,g}" if value < 1e6 else f"{value / 1e6:,g} million"


def plain_numbers(axis: Any, *, narrow: bool = False) -> None:
    """Label an axis 0.1, 1, 10 instead of with powers of ten, and label minor ticks if it spans few decades.

    narrow: whether there is room for few labels.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    plain = FuncFormatter(lambda value, _: _plain(value))
    axis.set_major_formatter(plain)
    low, high = axis.get_view_interval()
    labelled = high < 100 * low
    axis.set_minor_locator(LogLocator(subs=(2, 3, 5) if high < 30 * low and not narrow else (2, 5)))
    axis.set_minor_formatter(plain if labelled else NullFormatter())

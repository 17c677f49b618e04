# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of the report as SVG. They need matplotlib, which Blender lacks; without it there are none."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from ..base.native import first_line
from ..base.notes import few
from ..measure import counting, yardstick
from ..measure.rows import Row, agrees
from ..measure.thesis import Published
from . import case_charts, charts, costs, ksweep, picture_charts, tradeoff_charts
from . import marks as marking
from .marks import Mark

STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "halfspace",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8a93a3",
    "axes.labelcolor": "#3c4453",
    "xtick.color": "#3c4453",
    "ytick.color": "#3c4453",
    "grid.color": "#dfe3ea",
    "legend.frameon": False,
    "legend.fontsize": 8,
}


MOST_DRAWN = 48
"""Largest number of configurations that are all drawn; beyond it only the fastest of each structure."""

FIRST = "Error of pictures against run time"
"""Title of the figure that a report begins with."""

LEAD, NARROW = 6.4, 3.8
"""Widths of that figure in inches: next to the scene's picture, and on a telephone."""

FAR = 30.0
"""Factor over the fastest structure's time beyond which a structure is omitted, as it would compress the scale."""


@dataclass(frozen=True)
class Picture:
    """A figure of the page. svg: the element; caption: its content and how to read it. narrow: the same for a page as
    narrow as a telephone; "" where the wide one scrolls instead.
    """

    title: str
    svg: str
    caption: str
    narrow: str = ""


@cache
def problem() -> str | None:
    """The reason why there are no plots, or None."""
    if not importlib.util.find_spec("matplotlib"):
        return "matplotlib is not installed in this Python"
    try:
        import matplotlib.backends.backend_svg
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        # As where no memory is left for its libraries.
        return f"matplotlib cannot be loaded ({first_line(error)})"
    return None


def scene_figures(rows: Sequence[Row], published: Published | None = None) -> list[Picture]:
    """The figures for one scene's rows; those without data are left out."""
    everything = [row for row in rows if row["rays"]]
    if problem() or not everything:
        return []
    # Select the rows of each figure.
    measured = _fastest_of_each(everything) if len(everything) > MOST_DRAWN else everything
    marks = marking.marks(measured, [charts.tracing_seconds(row) for row in measured])
    ours = [row for row in measured if row["spec"] != yardstick.SPEC]
    close, far = _without_outliers(measured)
    remark = f" Too slow to be drawn in scale: {few(far)}." if far else ""
    if len(measured) < len(everything):
        remark += " Of each structure its fastest configuration is drawn."
    # Only *Speed* marks wrong answers; in other figures their times would look valid.
    ours_close = [row for row in close if row["spec"] != yardstick.SPEC and agrees(row)]
    curves = [row for row in ours if row["curve"] and agrees(row)]
    views = [row for row in close if row["scaling"] and len(row["scaling"]) > 1 and _is_comparable(row)]
    mapped = [row for row in ours if row.get("map")]
    moved = [row for row in ours if row["offsets"]]
    base, lines = ksweep.lines([row for row in everything if row["spec"] != yardstick.SPEC])
    counted = [row for row in everything if case_charts.with_cases([row])]
    fitted = costs.fit(ours_close)
    found = []

    def add(title: str, caption: str, height: float, draw: Callable[[Any], None]) -> None:
        found.append(Picture(title, svg(draw, height), caption))

    # Add the figures that have data, in the order of the page.
    if curves:
        draw = partial(picture_charts.error_against_time, rows=curves, marks=marks)
        wide, narrow = svg(draw, 4.4, LEAD), svg(draw, 4.4, NARROW)
        found.append(Picture(FIRST, wide, picture_charts.caption(curves), narrow))
        draw = partial(picture_charts.other_errors, rows=curves, marks=marks)
        add("Other errors of pictures", picture_charts.OTHERS, 3.6, draw)
    found += _tradeoffs(measured, marks)
    add("Speed", charts.SPEEDS + remark, 1.1 + 0.22 * len(close), lambda f: charts.speeds(f, close))
    if len(ours_close) > 1:
        draw = partial(charts.build_against_tracing, rows=ours_close, marks=marks)
        add("Build against tracing", charts.BUILD + remark, 5.2, draw)
    # Add the figures of optional measurements.
    if lines:
        draw = partial(charts.k_sweep, scene=rows[0]["scene"], base=base, lines=lines, published=published)
        add("How many directions", charts.K_SWEEP, 4.6 + 0.17 * -(-len(lines) // 4), draw)
    if views:
        draw = partial(charts.time_against_rays, rows=views, marks=marks)
        add("Time against the number of rays", charts.SCALING, 4.6, draw)
    if mapped:
        add(
            "What each pixel costs", charts.MAPS, charts.cost_map_height(mapped), partial(charts.cost_maps, rows=mapped)
        )
    if moved:
        draw = partial(charts.wrong_against_offset, rows=moved, marks=marks)
        add("Wrong answers far from the origin", charts.OFFSETS, 4.2, draw)
    if counted:
        draw = partial(case_charts.draw, rows=counted)
        add("Cases of ray and plane", case_charts.CAPTION, case_charts.height(counted), draw)
    if fitted is not None:
        height = 1.6 + 0.2 * len(fitted.specs)
        excluded = [row["spec"] for row in ours_close if costs.lacks_timed_counts(row)]
        note = f" Left out, as their rays are {counting.ONE_BY_ONE}: {few(excluded)}." if excluded else ""
        add("Fitted costs", charts.COSTS + note + remark, height, partial(charts.fitted_costs, fit=fitted))
    return found


def _tradeoffs(rows: Sequence[Row], marks: dict[str, Mark]) -> list[Picture]:
    """Wrong answers and errors of the distance against the time of a ray."""
    kinds: tuple[tuple[tradeoff_charts.Kind, str, str], ...] = (
        ("wrong", "Wrong answers against the time of a ray", tradeoff_charts.WRONG),
        ("ulp", "Error of the distance against the time of a ray", tradeoff_charts.DISTANCES),
    )
    found = []
    for kind, title, caption in kinds:
        if tradeoff_charts.panels_of(rows, kind):
            draw = partial(tradeoff_charts.draw, rows=rows, marks=marks, kind=kind)
            found.append(Picture(title, svg(draw, tradeoff_charts.height(rows, kind)), caption))
    return found


def _fastest_of_each(rows: Sequence[Row]) -> list[Row]:
    """The fastest configuration of each structure; one with wrong answers only if there is no other."""
    best: dict[str, Row] = {}
    for row in rows:
        known = best.setdefault(row["structure"], row)
        if _order(row) < _order(known):
            best[row["structure"]] = row
    return list(best.values())


def _order(row: Row) -> tuple[bool, float]:
    """Sort key: comparable rows first, then by the time of tracing."""
    return not _is_comparable(row), charts.tracing_seconds(row)


def _is_comparable(row: Row) -> bool:
    """Whether a row's times are comparable: the yardstick's, or those of correct answers."""
    return row["spec"] == yardstick.SPEC or agrees(row)


def _without_outliers(rows: Sequence[Row]) -> tuple[list[Row], list[str]]:
    """The rows whose tracing takes at most FAR times the fastest, and the names of the others."""
    times = [charts.tracing_seconds(row) for row in rows]
    right = [time for row, time in zip(rows, times, strict=True) if time and _is_comparable(row)]
    limit = FAR * min(right or [time for time in times if time], default=0.0)
    close = [row for row, time in zip(rows, times, strict=True) if 0 < time <= limit]
    return close, [row["spec"] for row in rows if row not in close]


def figure(draw: Callable[[Any], None], height: float) -> str:
    """One plot as an SVG element. draw: called with the axes. height: inches, at a width of 9.6."""
    return svg(lambda page: draw(page.add_subplot()), height)


def svg(draw: Callable[[Any], None], height: float, width: float = 9.6) -> str:
    """A figure as an SVG element. draw: called with the figure. height, width: inches."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Figures of two widths stand in one page, so their ids must differ.
    with mpl.rc_context({**STYLE, "svg.hashsalt": f"halfspace {width:g}"}):
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    found = text.getvalue()
    # Drop the XML prologue, which only belongs to files.
    return found[found.index("<svg") :]

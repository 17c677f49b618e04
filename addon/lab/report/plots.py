# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the report, as SVG on its page and as files. They need matplotlib; without it there are none."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import IO, Any, Literal

from ...core.base.native import first_line
from ...core.base.notes import few
from ...core.measure import counting, ranking, yardstick
from ...core.measure.analysis import field, tradeoff
from ...core.measure.rows import Row, agrees, set_names
from ...core.report import costs
from ...core.report.page import Picture
from . import charts, field_charts, picture_charts, thesis, tradeoff_charts
from . import marks as marking
from .marks import About, Mark

STYLE: Any = {
    "svg.fonttype": "none",
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

WIDTH, LEAD, NARROW = 9.6, 6.4, 3.8
"""Widths in inches: of a figure on the page, of the first one next to the scene's picture, and on a telephone."""

FAR = 30.0
"""Factor over the fastest structure's time beyond which a structure is omitted, as it would compress the scale."""


@dataclass(frozen=True)
class Figure:
    """A figure that is not drawn yet. height: inches. draw: called with a figure of matplotlib; None where there is
    nothing to draw, which the caption explains. narrow_height: inches on a narrow page. other: label of a switch, and
    the drawing that it shows instead.
    """

    about: About
    height: float
    draw: Callable[[Any], None] | None
    remark: str = ""
    other: tuple[str, Callable[[Any], None]] | None = None
    narrow_height: float = 0.0

    @property
    def caption(self) -> str:
        """The caption, with a remark on these rows."""
        return self.about.caption + self.remark

    @property
    def leads(self) -> bool:
        """Whether a report begins with it."""
        return self.about.name in (picture_charts.FIRST, tradeoff_charts.FIRST)


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


def pictures(rows: Sequence[Row], published: thesis.Published | None = None) -> list[Picture]:
    """The figures of one scene's rows as SVG."""
    found = []
    for one in scene_figures(rows, published):
        wide = svg(one.draw, one.height, LEAD if one.leads else WIDTH) if one.draw else ""
        narrow = svg(one.draw, one.narrow_height or one.height, NARROW) if one.draw and one.leads else ""
        other = None if one.other is None else (one.other[0], svg(one.other[1], one.height, salt=" other"))
        found.append(Picture(one.about.title, wide, one.caption, narrow, one.leads, other))
    return found


def scene_figures(rows: Sequence[Row], published: thesis.Published | None = None) -> list[Figure]:
    """The figures for one scene's rows; those without data are left out."""
    everything = [row for row in rows if row["rays"]]
    if problem() or not everything:
        return []
    # Select the rows of each figure.
    measured = _drawable(everything)
    marks = _marks(measured)
    ours = [row for row in measured if not yardstick.is_foreign(row["spec"])]
    close, far = _without_outliers(measured)
    remark = f" Too slow to be drawn in scale: {few(far)}." if far else ""
    if len(measured) < len(everything):
        remark += " Of each structure its fastest configuration is drawn."
    # Only *Speed* marks wrong answers; in other figures their times would look valid.
    right = [row for row in close if not yardstick.is_foreign(row["spec"]) and agrees(row)]
    curves = [row for row in ours if row["curve"] and agrees(row)]
    views = [row for row in close if row["scaling"] and len(row["scaling"]) > 1 and _is_comparable(row)]
    mapped = [row for row in ours if row.get("map")]
    moved = [row for row in ours if row["offsets"]]
    base, lines = thesis.sweeps([row for row in everything if not yardstick.is_foreign(row["spec"])])
    counted = [row for row in everything if field_charts.with_cases([row])]
    fitted = costs.fits(right)
    found: list[Figure] = []

    def add(about: About, height: float, draw: Callable[..., None], remark: str = "", **given: Any) -> None:
        found.append(Figure(about, height, partial(draw, **given), remark))

    # Add the figures that have data, in the order of the page; the first two are on each.
    found.append(_pictures(curves, marks))
    found.append(_wrong(everything, measured, marks))
    if curves:
        add(picture_charts.OTHERS, 3.6, picture_charts.other_errors, rows=curves, marks=marks)
    if tradeoff_charts.panels_of(measured, "ulp"):
        height = tradeoff_charts.height(measured, "ulp")
        about = tradeoff_charts.KINDS["ulp"]
        add(about, height, tradeoff_charts.draw, rows=measured, marks=marks, kind="ulp")
    add(charts.SPEEDS, 1.1 + 0.22 * len(close), charts.speeds, remark, rows=close)
    if len(right) > 1:
        add(charts.BUILD, 5.2, charts.build_against_tracing, remark, rows=right, marks=marks)
    # Add the figures of optional measurements.
    if lines:
        draw = partial(charts.k_sweep, scene=rows[0]["scene"], published=published)
        add(charts.K_SWEEP, 4.6 + 0.17 * -(-len(lines) // 4), draw, base=base, lines=lines)
    if views:
        add(charts.SCALING, 4.6, charts.time_against_rays, rows=views, marks=marks)
    if mapped:
        own, common = (partial(charts.cost_maps, rows=mapped, common=one) for one in (False, True))
        found.append(Figure(charts.MAPS, charts.cost_map_height(mapped), own, "", (charts.ONE_SCALE, common)))
    if moved:
        add(charts.OFFSETS, 4.2, charts.wrong_against_offset, rows=moved, marks=marks)
    found += _of_field(everything)
    if counted:
        add(field_charts.CASES, field_charts.height_of_cases(counted), field_charts.cases, rows=counted)
    if fitted:
        excluded = [row["spec"] for row in right if any(costs.lacks_timed_counts(row, fit.rays) for fit in fitted)]
        note = f" Left out, as their rays are {counting.ONE_BY_ONE}: {few(excluded)}." if excluded else ""
        add(charts.COSTS, charts.costs_height(fitted), charts.fitted_costs, note + remark, fits=fitted)
    return found


def _pictures(rows: Sequence[Row], marks: dict[str, Mark]) -> Figure:
    """The first figure of a report, or why it is missing."""
    if not rows:
        reason = "Left out: no pictures were rendered (--curve none, or a structure too slow for the smallest number)."
        return Figure(About(picture_charts.FIRST, "Error of pictures against run time", reason), 0.0, None)
    draw = partial(picture_charts.error_against_time, rows=rows, marks=marks)
    return Figure(picture_charts.about(rows), 4.0, draw, narrow_height=6.4)


def _wrong(everything: Sequence[Row], rows: Sequence[Row], marks: dict[str, Mark]) -> Figure:
    """The second figure of a report. Ray sets without wrong answers are a sentence below it."""
    about = tradeoff_charts.KINDS["wrong"]
    counted = [row for row in rows if row.get("tradeoff")]
    if not counted:
        reason = "Left out: not measured with --only-rays, nor in two levels."
        return Figure(About(about.name, about.title, reason), 0.0, None)
    remark = f" {tradeoff_charts.without_errors(counted)}".rstrip()
    if not any(point["place"] == tradeoff.FAR for row in counted for point in row["tradeoff"]):
        remark += " Left out: the scene far away, with more than 16 configurations."
    if missing := len(everything) - len(counted):
        remark += f" Left out: {missing} configurations, of each tree all but the usually quickest."
    if not tradeoff_charts.panels_of(counted, "wrong"):
        return Figure(About(about.name, about.title, ""), 0.0, None, remark.strip())
    draw = partial(tradeoff_charts.draw, rows=counted, marks=marks, kind="wrong")
    wide, narrow = (tradeoff_charts.height(counted, "wrong", width) for width in (LEAD, NARROW))
    return Figure(about, wide, draw, remark, narrow_height=narrow)


def _of_field(rows: Sequence[Row]) -> Iterator[Figure]:
    """Shapes of the trees, distributions of the work of single rays, and expected against measured cost."""
    # Nodes and traversals share a tree: draw it once, by its own name.
    trees = _fastest_of_each([row for row in rows if field.value(row, "tree")], "tree")
    if trees:
        marks = _marks(trees)
        for row in trees:
            mark = marks[row["spec"]]
            marks[row["spec"]] = replace(mark, label=mark.label and marking.short(row["tree"]))
        yield Figure(field_charts.SHAPES, 5.6, partial(field_charts.shapes, rows=trees, marks=marks))
    # Rays that go together share the counts of their group.
    single = _drawable(ranking.by_table(rows).get("single") or rows)
    marks = _marks(single)
    sets = [name for name in set_names(single) if any(field.value(row, "rays", name, "steps") for row in single)]
    if sets:
        draw = partial(field_charts.work, rows=single, marks=marks, sets=sets)
        yield Figure(field_charts.WORK, 0.8 + 1.9 * len(sets), draw)
    expected = costs.correlation(single)
    if expected is not None:
        yield Figure(field_charts.EXPECTED, 4.6, partial(field_charts.expected, found=expected, marks=marks))


def _marks(rows: Sequence[Row]) -> dict[str, Mark]:
    return marking.marks(rows, [charts.tracing_seconds(row) for row in rows])


def _drawable(rows: Sequence[Row]) -> Sequence[Row]:
    return _fastest_of_each(rows) if len(rows) > MOST_DRAWN else rows


def _fastest_of_each(rows: Sequence[Row], key: Literal["structure", "tree"] = "structure") -> list[Row]:
    """The fastest configuration of each structure or tree; one with wrong answers only if there is no other."""
    best: dict[str, Row] = {}
    for row in rows:
        known = best.setdefault(row.get(key) or row["spec"], row)
        if _order(row) < _order(known):
            best[row.get(key) or row["spec"]] = row
    return list(best.values())


def _order(row: Row) -> tuple[bool, float]:
    """Sort key: comparable rows first, then by the time of tracing."""
    return not _is_comparable(row), charts.tracing_seconds(row)


def _is_comparable(row: Row) -> bool:
    """Whether a row's times are comparable: the yardstick's, or those of correct answers."""
    return yardstick.is_foreign(row["spec"]) or agrees(row)


def _without_outliers(rows: Sequence[Row]) -> tuple[list[Row], list[str]]:
    """The rows whose tracing takes at most FAR times the fastest, and the names of the others."""
    times = [charts.tracing_seconds(row) for row in rows]
    right = [time for row, time in zip(rows, times, strict=True) if time and _is_comparable(row)]
    limit = FAR * min(right or [time for time in times if time], default=0.0)
    close = [row for row, time in zip(rows, times, strict=True) if 0 < time <= limit]
    return close, [row["spec"] for row in rows if row not in close]


def svg(draw: Callable[[Any], None], height: float, width: float = WIDTH, salt: str = "") -> str:
    """A figure as an SVG element. draw: called with the figure. height, width: inches. salt: another one for each
    figure of the same width and content.
    """
    text = io.StringIO()
    # Figures of two widths are in one page, so their ids must differ.
    style = {"svg.hashsalt": f"halfspace {width:g}{salt}"}
    save(draw, (width, height), text, style, format="svg", metadata={"Date": None})
    found = text.getvalue()
    # Drop the XML prologue, which only belongs to files.
    return found[found.index("<svg") :]


def save(
    draw: Callable[[Any], None], size: tuple[float, float], target: Path | IO[Any], style: Any, **given: Any
) -> None:
    """Draw a figure of this width and height in inches into a file. style: of matplotlib, over STYLE. given: arguments
    of `savefig`.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, **style}):
        figure = Figure(figsize=size, layout="constrained")
        draw(figure)
        figure.savefig(target, **given)

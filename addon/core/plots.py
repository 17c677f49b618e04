# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the report as SVG. They need matplotlib, which Blender lacks; without it there are none."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import charts, costs, ksweep, yardstick
from .charts import Styles
from .rows import Row

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


@dataclass(frozen=True)
class Picture:
    """A figure of the page. svg: the element; caption: what it shows and how to read it."""

    svg: str
    caption: str


def problem() -> str | None:
    """Why there are no plots, or None."""
    return None if importlib.util.find_spec("matplotlib") else "matplotlib is not installed in this Python"


def scene_figures(rows: Sequence[Row], published: Any = None) -> list[Picture]:
    """The figures for one scene's rows; those without data are left out."""
    measured = [row for row in rows if row["rays"]]
    if problem() or not measured:
        return []
    styles = charts.styles(measured)
    ours = [row for row in measured if row["spec"] != yardstick.SPEC]
    found = [_figure(lambda f: charts.speeds(f, measured), 1.1 + 0.22 * len(measured), charts.SPEEDS)]
    if len([row for row in ours if row["build_s"]]) > 1:
        found.append(_figure(lambda f: charts.build_against_tracing(f, ours, styles), 5.2, charts.BUILD))
    curves = [row for row in ours if row["curve"]]
    if curves:
        found.append(_figure(lambda f: charts.error_against_time(f, curves, styles), 4.8, charts.ERROR))
    views = [row for row in measured if row["scaling"] and len(row["scaling"]) > 1]
    if views:
        found.append(_figure(lambda f: charts.time_against_rays(f, views, styles), 4.8, charts.SCALING))
    base, lines = ksweep.lines(ours)
    if lines:
        scene = rows[0]["scene"]
        found.append(_figure(lambda f: charts.k_sweep(f, scene, base, lines, published), 4.4, charts.K_SWEEP))
    fitted = costs.fit(ours)
    if fitted is not None:
        found.append(_figure(lambda f: charts.fitted_costs(f, fitted), 1.2 + 0.2 * len(fitted.specs), charts.COSTS))
    moved = [row for row in ours if row["offsets"]]
    if moved:
        found.append(_figure(lambda f: charts.wrong_against_offset(f, moved, styles), 4.2, charts.OFFSETS))
    return found


def _figure(draw: Callable[[Any], None], height: float, caption: str) -> Picture:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, height), layout="constrained")
        draw(figure)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    # Inside a page, the element alone; the prologue belongs to files.
    return Picture(svg[svg.index("<svg") :], caption)


__all__ = ["Picture", "Styles", "problem", "scene_figures"]

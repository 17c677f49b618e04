# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the report as SVG. They need matplotlib, which Blender lacks; without it there are none."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .benchmark import Row

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#999999", "#f0e442")
"""Told apart by people with any kind of colour vision (Okabe and Ito 2008)."""

MARKERS = "osD^vPX*"

Styles = dict[str, tuple[str, str]]
"""Configuration to colour and marker."""


def problem() -> str | None:
    """Why there are no plots, or None."""
    return None if importlib.util.find_spec("matplotlib") else "matplotlib is not installed in this Python"


def scene_figures(rows: Sequence[Row]) -> list[str]:
    """The SVG elements for one scene's rows."""
    if problem():
        return []
    measured = [row for row in rows if row["rays"]]
    if not measured:
        return []
    # A configuration keeps its colour and marker in all plots of a scene.
    styles = {row["spec"]: (COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]) for i, row in enumerate(measured)}
    figures = [figure(lambda axes: _speeds(axes, measured, styles), 4.0)]
    ours = [row for row in measured if row["bytes"]]
    if len(ours) > 1:
        figures.append(figure(lambda axes: _build_against_speed(axes, ours, styles), 4.5))
    curves = [row for row in rows if row["curve"]]
    if curves:
        figures.append(figure(lambda axes: _error_against_time(axes, curves, styles), 4.5))
    return figures


def figure(draw: Callable[[Any], None], height: float) -> str:
    """One plot as an SVG element. draw: told the axes. height: inches, at a width of nine."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    style: Any = {"svg.fonttype": "none", "svg.hashsalt": "halfspace", "font.size": 10}
    style |= {"axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style):
        figure = Figure(figsize=(9.0, height), layout="constrained")
        draw(figure.subplots())
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    # Inside a page, the element alone; the prologue belongs to files.
    return svg[svg.index("<svg") :]


def _speeds(axes: Any, rows: Sequence[Row], styles: Styles) -> None:
    """Bars of the medians with whiskers from the slowest to the fastest repeat, on a logarithmic scale."""
    sets = list(dict.fromkeys(name for row in rows for name in row["rays"]))
    width = 0.8 / len(rows)
    for number, row in enumerate(rows):
        places, medians, below, above = [], [], [], []
        for place, name in enumerate(sets):
            speed = (row["rays"].get(name) or {}).get("mrays_s")
            if speed:
                places.append(place + (number - (len(rows) - 1) / 2) * width)
                medians.append(speed["med"])
                below.append(speed["med"] - speed["min"])
                above.append(speed["max"] - speed["med"])
        colour, _ = styles[row["spec"]]
        axes.bar(places, medians, width * 0.92, yerr=[below, above], color=colour, label=row["spec"], capsize=2)
    axes.set_xticks(range(len(sets)), sets)
    axes.set_yscale("log")
    axes.set_ylabel("million rays per second")
    axes.set_title("Speed of each ray set (more is better)")
    axes.legend(frameon=False, ncols=min(len(rows), 5), loc="upper center", bbox_to_anchor=(0.5, -0.1))


def _build_against_speed(axes: Any, rows: Sequence[Row], styles: Styles) -> None:
    """Build seconds against the time that one million rays of each set take together."""
    for row in rows:
        speeds = [one["mrays_s"]["med"] for one in row["rays"].values() if one["mrays_s"]]
        if speeds:
            seconds = float(np.sum(1.0 / np.array(speeds)))
            colour, marker = styles[row["spec"]]
            axes.plot(row["build_s"]["med"], seconds, marker, color=colour, markersize=9, label=row["spec"])
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("build, seconds")
    axes.set_ylabel("one million rays of each set, seconds")
    axes.set_title("Build against tracing (nearer to the lower left is better)")
    axes.grid(visible=True, which="both", alpha=0.25)
    axes.legend(frameon=False)


def _error_against_time(axes: Any, rows: Sequence[Row], styles: Styles) -> None:
    """RMSE against seconds, with the slope −1/2 that Monte Carlo noise follows."""
    for row in rows:
        seconds = [point["seconds"] for point in row["curve"]]
        errors = [point["rmse"] for point in row["curve"]]
        colour, marker = styles[row["spec"]]
        axes.plot(seconds, errors, marker + "-", color=colour, label=row["spec"])
    first = rows[0]["curve"]
    start, end = first[0]["seconds"], first[-1]["seconds"]
    slope = [first[0]["rmse"] * (x / start) ** -0.5 for x in (start, end)]
    axes.plot([start, end], slope, ":", color="#555555", label="slope −1/2")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("render, seconds (without the build)")
    axes.set_ylabel("RMSE against a converged picture")
    axes.set_title("Error against run time")
    axes.grid(visible=True, which="both", alpha=0.25)
    axes.legend(frameon=False)

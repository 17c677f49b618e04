# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of pictures against their time, build included, and the convergence of independent samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.measure import curve
from ...core.measure.rows import Row, building
from .charts import logarithmic
from .marks import GREY, INK, PALE, About, Mark, legend, ordered, unnamed

ERRORS = {"relmse": "relMSE", "rmse": "RMSE", "flip": "FLIP"}
"""Error measures in the order of their panels."""

FIRST = "error-time"

CAPTION = (
    "Relative error (relMSE) of whole pictures against build and render together, all against one converged picture. "
    "All structures render the same picture, so that at equal samples their points lie at one height: the farther left,"
    " the better."
)
OTHERS = About(
    "other-errors",
    "Other errors of pictures",
    "The same for RMSE and FLIP. On the right the error against the number of samples, for pictures and for means of "
    "independent ones, which in theory fall with the slope −1/2.",
)


def about(rows: Sequence[Row]) -> About:
    """The caption of the figure, with the facts of the reference."""
    text = CAPTION
    known = next((row["converged"] for row in rows if row.get("converged")), None)
    if known:
        limits = " and ".join(f"{value:g}" for value in sorted(set(known["limits"].values())))
        text += (
            f" The converged picture has {known['samples']:,} samples per pixel and an RMSE of {known['rmse']:.2g} of "
            f"its own (grey band). In it and in all others no sample adds more than {limits} times white, as in Cycles"
            f" with its clamps, which removes {100 * known['removed']:.1f} % of the light; no pixel is left out."
        )
    black = sum(point.get("not_finite") or 0 for row in rows[:1] for point in row["curve"])
    text += f" {black:,} pixels that are not finite count as black." if black else ""
    return About(FIRST, "Error of pictures against run time", text)


def error_against_time(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """relMSE against seconds, with the number of samples at the height of its error."""
    axes = figure.subplots()
    _against_time(axes, rows, marks, "relmse")
    # All structures have the same picture, so one label stands for all points of a height.
    longest = max((row["curve"] for row in rows), key=len)
    for point in _drawn(longest, "relmse"):
        text = f"{point['spp']} {'sample' if point['spp'] == 1 else 'samples'}"
        axes.axhline(point["relmse"], color=PALE, linewidth=0.8, linestyle=":", zorder=1)
        place = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
        axes.annotate(text, (1.0, point["relmse"]), (3, 0), va="center", fontsize=8, color=GREY, **place)
    pixels = next((image["pixels"] for row in rows if (image := row.get("image"))), 0)
    if pixels:
        axes.set_xlabel(f"build and render of {pixels:,} pixels, seconds")
    legend(figure, axes, others=unnamed(rows, marks))


def other_errors(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """RMSE and FLIP against seconds, and RMSE against samples."""
    panels = figure.subplots(1, 3)
    for axes, key in zip(panels, ("rmse", "flip"), strict=False):
        _against_time(axes, rows, marks, key)
    _floor(panels[0], rows)
    _convergence(panels[2], rows)
    legend(figure, panels[0], others=unnamed(rows, marks))


def _against_time(axes: Any, rows: Sequence[Row], marks: dict[str, Mark], key: str) -> None:
    """One measure of the error against the seconds of build and render together."""
    for row in ordered(rows, marks):
        points = _drawn(row["curve"], key)
        seconds = [point["seconds"] + building(row) for point in points]
        axes.plot(seconds, [point[key] for point in points], **marks[row["spec"]].line())
    theirs = _drawn(next((row["peer"] for row in rows if row.get("peer")), []), key)
    if theirs:
        seconds, values = ([point[name] for point in theirs] for name in ("seconds", key))
        axes.plot(seconds, values, "--*", color=INK, label="Cycles", zorder=6)
    _finish(axes, ERRORS[key], "build and render, seconds")
    if not axes.lines or not any(len(line.get_xdata()) for line in axes.lines):
        axes.text(0.5, 0.5, "not measured or without noise", transform=axes.transAxes, ha="center", color=GREY)


def _drawn(points: Sequence[dict[str, Any]], key: str) -> list[dict[str, Any]]:
    """The points that a logarithmic axis can show."""
    return [point for point in points if point.get(key)]


def _convergence(axes: Any, rows: Sequence[Row]) -> None:
    """RMSE against samples with fitted slopes: independent samples, and the longest curve."""
    longest = max((row["curve"] for row in rows), key=len)
    alone = next((row["independent"] for row in rows if row.get("independent")), [])
    series = ((alone, "independent samples", INK, "o"), (longest, "samples of a picture", GREY, "s"))
    for points, label, colour, marker in series:
        kept = _drawn(points, "rmse")
        if not kept:
            continue
        fitted = curve.slope(kept)
        slope = "" if math.isnan(fitted) else f": slope {fitted:.2f}".replace("-", "−")
        xs, ys = ([point[key] for point in kept] for key in ("spp", "rmse"))
        axes.plot(xs, ys, marker, color=colour, label=label + slope, markersize=5.5, zorder=3)
        if slope:
            # Draw the fitted line, so that points off it can be seen.
            offset = np.mean(np.log(ys)) - fitted * np.mean(np.log(xs))
            axes.plot(xs, np.exp(offset) * np.array(xs, float) ** fitted, "-", color=colour, linewidth=1)
    if alone and alone[0]["rmse"] > 0:
        ends = [alone[0]["spp"], max(alone[-1]["spp"], longest[-1]["spp"])]
        axes.plot(ends, [0.7 * alone[0]["rmse"] * (x / ends[0]) ** curve.SLOPE for x in ends], ":", color=PALE)
    _floor(axes, rows)
    _finish(axes, "RMSE", "samples per pixel")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left")


def _floor(axes: Any, rows: Sequence[Row]) -> None:
    """The error of the reference itself: nothing below it can be seen."""
    known = next((row["converged"] for row in rows if row.get("converged")), None)
    low, high = axes.get_ylim()
    if known and known["rmse"] > 0:
        axes.axhspan(known["rmse"] / 1e3, known["rmse"], color="#eceff4", zorder=0)
        # Show only the upper end of the band, so that it does not compress the curves.
        axes.set_ylim(min(low, 0.7 * known["rmse"]), high)


def _finish(axes: Any, label: str, below: str) -> None:
    logarithmic(axes)
    axes.set_ylabel(label)
    axes.set_xlabel(below)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of pictures against their time, build included, and the convergence of independent samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...core.measure import curve
from ...core.measure.rows import Row, building
from ...core.report import report
from .charts import logarithmic, plain_numbers
from .marks import GREY, INK, PALE, About, Mark, legend, ordered, unnamed

if TYPE_CHECKING:
    from ...core.measure.curve import Converged

ERRORS = {"relmse": "relMSE", "rmse": "RMSE", "flip": "FLIP"}
"""Error measures in the order of their panels."""

FIRST = "error-time"

NARROW = 5.0
"""Inches below which panels lie below each other."""

LEAST_SPAN = 10.0
"""Smallest ratio of the ends of an axis."""

CAPTION = (
    "Relative error (square root of relMSE) of whole pictures against their time, with the build and without. All "
    "structures render the same picture, so that at equal samples their points lie at one height: the farther left, "
    "the better. The error of independent samples falls along the dotted guide of slope −1/2. Hollow marks: times "
    "predicted from the structure's pictures of fewer samples; their errors are measured."
)
OTHERS = About(
    "other-errors",
    "Other errors of pictures",
    "The same for RMSE and FLIP. On the right the error against the number of samples, for pictures and for means of "
    "independent ones, which in theory fall with the slope −1/2.",
)


def about(rows: Sequence[Row]) -> About:
    """The caption of the figure, with the facts of the reference and what was left out."""
    text = CAPTION
    known = next((row["converged"] for row in rows if row.get("converged")), None)
    if known:
        limits = " and ".join(f"{value:g}" for value in sorted(set(known["limits"].values())))
        width, height = known["size"]
        text += (
            f" Pictures of {width} × {height} pixels; bands are 95 % intervals of the mean error of {curve.SEEDS} of "
            "them. The converged picture has"
            f" {known['samples']:,} samples per pixel, in two halves, so that its own noise (RMSE {known['rmse']:.2g}) "
            f"is not in the errors. In it and in all others no sample adds more than {limits} times white, as in Cycles"
            f" with its clamps, which removes {100 * known['removed']:.1f} % of the light; no pixel is left out."
        )
        if known["left_out"]:
            counts = ", ".join(map(str, known["left_out"]))
            text += (
                f" Left out: {counts} samples per pixel, which do not fit into {known['seconds']:g} s "
                "(--picture-seconds)."
            )
        text += _about_peer(known, next((row["peer"] for row in rows if row.get("peer")), []))
    black = sum(point.get("not_finite") or 0 for row in rows[:1] for point in row["curve"])
    text += f" {black:,} pixels that are not finite count as black." if black else ""
    return About(FIRST, "Error of pictures against run time", text)


def _about_peer(known: Converged, points: Sequence[dict[str, Any]]) -> str:
    """What is said about Cycles' curve, or why there is none."""
    found = known.get("peer")
    if not points:
        return f" Cycles is left out: {found or 'Blender is not there'}."
    apart = f"{100 * found:.2f}" if isinstance(found, float) else "?"
    missing = [str(point["spp"]) for point in known["points"] if point["spp"] > points[-1]["spp"]]
    return (
        " Cycles: whole renders, with reading the scene; its error is that about its own mean, from pairs of pictures; "
        f"its pictures differ from ours by {apart} % of their brightness (RMS) beyond noise."
        + (f" Its pictures of {', '.join(missing)} samples would have taken too long." if missing else "")
    )


class Point(NamedTuple):
    """A picture: samples, seconds without the build, squared error and the ends of its interval. measured: whether its
    time is.
    """

    spp: int
    seconds: float
    error: float
    low: float
    high: float
    measured: bool


def points_of(row: Row) -> list[Point]:
    """The pictures of a configuration: those that it rendered, and with predicted times those of more samples.

    The time is fitted as a constant and a part of each sample, to relative residuals; with one picture there is no
    constant.
    """
    timed = {int(point["spp"]): float(point["seconds"]) for point in row["curve"]}
    known = report.pictures_of(row)
    counts, seconds = np.array(list(timed)), np.array(list(timed.values()))
    fixed, each = 0.0, float(np.mean(seconds / counts))
    if len(timed) > 1:
        system = np.stack([1 / seconds, counts / seconds], axis=1)
        fixed, each = (max(float(x), 0.0) for x in np.linalg.lstsq(system, np.ones(len(counts)), rcond=None)[0])
    found = []
    for point in known:
        samples, error = int(point["spp"]), float(point["relmse"])
        if error and (samples in timed or each > 0):
            low, high = point.get("relmse_95", (error, error))
            seconds_of = timed.get(samples, fixed + each * samples)
            found.append(Point(samples, seconds_of, error, low, high, samples in timed))
    return found


def error_against_time(figure: Any, rows: Sequence[Row], marks: dict[str, Mark]) -> None:
    """Relative error against seconds with and without build; the panels lie below each other in a narrow figure."""
    is_narrow = figure.get_size_inches()[0] < NARROW
    panels = figure.subplots(*((2, 1) if is_narrow else (1, 2)), sharey=True)
    theirs = next((row["peer"] for row in rows if row.get("peer")), [])
    for axes, with_build in zip(panels, (True, False), strict=True):
        for row in ordered(rows, marks):
            _line(axes, row, marks[row["spec"]], building(row) if with_build else 0.0)
        kept = [point for point in theirs if point.get("relmse")]
        if kept:
            constant = 0.0 if with_build else _constant(kept)
            xs = [max(point["seconds"] - constant, 1e-9) for point in kept]
            label = "Cycles" if with_build else None
            axes.plot(xs, [math.sqrt(point["relmse"]) for point in kept], "--*", color=INK, label=label, zorder=6)
        _finish(axes, "relative error, root of relMSE" if with_build or is_narrow else "", "seconds")
        axes.set_title("with build" if with_build else "without build", fontsize=9)
        _wide(axes)
        _guide(axes)
    # All structures have the same picture, so one label stands for all points of a height.
    longest = max((points_of(row) for row in rows), key=len)
    for axes in panels if is_narrow else panels[1:]:
        for point in longest:
            place = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
            text = f"{point.spp} spp" if point is longest[0] else str(point.spp)
            axes.annotate(text, (1.0, math.sqrt(point.error)), (3, 0), va="center", fontsize=7, color=GREY, **place)
    for axes in panels:
        for point in longest:
            axes.axhline(math.sqrt(point.error), color=PALE, linewidth=0.6, linestyle=":", zorder=1)
    legend(figure, panels[0], others=unnamed(rows, marks))


def _line(axes: Any, row: Row, mark: Mark, build: float) -> None:
    """The pictures of a configuration: full marks are measured, hollow ones predicted, only where it is chosen."""
    points = points_of(row)
    xs, ys = ([build + point.seconds for point in points], [math.sqrt(point.error) for point in points])
    count = sum(point.measured for point in points)
    style = mark.line()
    axes.plot(xs[:count], ys[:count], **style)
    if not mark.is_chosen or not points:
        return
    axes.plot(xs[count - 1 :], ys[count - 1 :], color=mark.colour, linewidth=0.8, linestyle="--", zorder=mark.order)
    hollow = style | {"label": None, "linestyle": "none", "markerfacecolor": "white"}
    axes.plot(xs[count:], ys[count:], **hollow)
    ends = ([math.sqrt(value) for value in some] for some in zip(*((p.low, p.high) for p in points), strict=True))
    axes.fill_between(xs, *ends, color=mark.colour, alpha=0.15, linewidth=0)
    # Widen the line by the interval of the structure's time, where its pictures were timed in rounds.
    image = row.get("image_s")
    if image and "low" in image:
        low, high = ([build + point.seconds * image[end] / image["med"] for point in points] for end in ("low", "high"))
        axes.fill_betweenx(ys, low, high, color=mark.colour, alpha=0.15, linewidth=0)


def _constant(points: Sequence[dict[str, Any]]) -> float:
    """The seconds of Cycles' renders that do not depend on the samples, fitted to relative residuals."""
    if len(points) < 2:
        return 0.0
    seconds, counts = (np.array([point[key] for point in points], float) for key in ("seconds", "spp"))
    system = np.stack([1 / seconds, counts / seconds], axis=1)
    fixed = float(np.linalg.lstsq(system, np.ones(len(seconds)), rcond=None)[0][0])
    return min(max(fixed, 0.0), 0.99 * float(seconds.min()))


def _wide(axes: Any) -> None:
    """Widen logarithmic axes to a decade and more, so that each has three ticks with numbers."""
    for axis, limits in ((axes.xaxis, axes.set_xlim), (axes.yaxis, axes.set_ylim)):
        low, high = axis.get_view_interval()
        if 0 < low < high < LEAST_SPAN * low:
            more = math.sqrt(LEAST_SPAN * low / high)
            limits(low / more, high * more)
        if low > 0:
            plain_numbers(axis, narrow=True)


def _guide(axes: Any) -> None:
    """A dotted line of slope −1/2 through the middle of the axes."""
    if axes.get_xscale() != "log" or axes.get_yscale() != "log":
        return
    (left, right), (below, above) = axes.get_xlim(), axes.get_ylim()
    xs = np.geomspace(left, right, 200)
    ys = math.sqrt(below * above) * np.sqrt(math.sqrt(left * right) / xs)
    inside = (ys > below) & (ys < above)
    axes.plot(xs[inside], ys[inside], ":", color=GREY, linewidth=1.2, zorder=1, label="slope −1/2")


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
    longest = max((report.pictures_of(row) for row in rows), key=len)
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

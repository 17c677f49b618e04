# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures as vector PDF, drawn with matplotlib."""

from __future__ import annotations

import importlib.util
import io
from typing import Any

from ...core.report.marks import OTHER, legend
from ...core.report.plots import STYLE
from .figure import Axis, Figure

SIZE = 4.8, 3.6
"""Width and height in inches: one column of a paper."""

OF_PDF: Any = {"pdf.fonttype": 42, "font.size": 8, "legend.fontsize": 7}
"""Embed fonts as TrueType (type 42), whose text can be searched, as many publishers require."""


def problem() -> str | None:
    """The reason why there is no PDF, or None."""
    return None if importlib.util.find_spec("matplotlib") else "matplotlib is not installed in this Python"


def page(figure: Figure) -> bytes:
    """A PDF file of one page; equal figures give equal bytes."""
    import matplotlib as mpl
    from matplotlib import figure as of_matplotlib

    with mpl.rc_context({**STYLE, **OF_PDF}):
        drawn = of_matplotlib.Figure(figsize=SIZE, layout="constrained")
        axes = drawn.subplots()
        for series in figure.series:
            style = series.mark.line() | ({} if series.joined else {"linestyle": "none"})
            axes.plot(series.x, series.y, **style, markerfacecolor="white" if series.hollow else series.mark.colour)
        _scale(axes, axes.xaxis, "x", figure.x)
        _scale(axes, axes.yaxis, "y", figure.y)
        axes.grid(visible=True, which="major")
        axes.set_axisbelow(True)
        if figure.note:
            axes.text(0.03, 0.97, figure.note, transform=axes.transAxes, va="top")
        legend(drawn, axes, others=sum(series.mark == OTHER for series in figure.series))
        written = io.BytesIO()
        drawn.savefig(written, format="pdf", metadata={"CreationDate": None, "Title": figure.caption})
    return written.getvalue()


def _scale(axes: Any, side: Any, name: str, axis: Axis) -> None:
    """Title, scale, ticks and limits of one axis."""
    axes.set(**{f"{name}label": axis.label})
    if axis.is_log:
        axes.set(**{f"{name}scale": "log"})
    if axis.ticks:
        side.set_ticks([place for place, _ in axis.ticks], [_tick(text) for _, text in axis.ticks])
        side.set_ticks([], minor=True)
    if axis.low is not None:
        axes.set(**{f"{name}lim": (axis.low, axis.high)})


def _tick(text: str) -> str:
    """The label of a tick; powers of ten as formulas."""
    base, power, exponent = text.partition("^")
    return f"${base}^{{{exponent}}}$" if power else text

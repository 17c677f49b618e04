# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures as files for the LaTeX package pgfplots: the data and how to draw them, to include in a document.

The data stand in the file itself, so that a paper needs one file per figure. No TeX is needed to write them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from ...core.report.marks import OTHER, Mark
from .figure import Axis, Figure, Series
from .latex import escape

MARKS = {
    "o": "*",
    "s": "square*",
    "D": "diamond*",
    "^": "triangle*",
    "v": "triangle*, every mark/.append style={rotate=180}",
    "P": "pentagon*",
    "X": "x",
    "*": "star",
    ".": "*",
}
"""Marks of pgfplots for those of matplotlib."""

SIZE = 0.4
"""Radius of a mark in points, per size of matplotlib, which is a diameter."""


def picture(figure: Figure) -> str:
    """A `tikzpicture`, for documents that load the package pgfplots and set its `compat` to 1.16 or newer."""
    lines = [r"\begin{tikzpicture}", r"\begin{axis}[", *(f"  {option}," for option in _options(figure)), "]"]
    grey = False
    for series in figure.series:
        lines += _plot(series, is_first=series.mark == OTHER and not grey)
        grey = grey or series.mark == OTHER
    if figure.note:
        lines.append(f"\\node[anchor=north west] at (rel axis cs:0.02,0.98) {{{escape(figure.note)}}};")
    return "\n".join([*lines, r"\end{axis}", r"\end{tikzpicture}"]) + "\n"


def _options(figure: Figure) -> Iterator[str]:
    """The options of the axes."""
    yield r"width=\linewidth"
    yield r"height=0.62\linewidth"
    yield "grid=major"
    yield "axis lines=left"
    yield "legend style={draw=none, font=\\scriptsize, at={(0.5,-0.22)}, anchor=north}"
    yield "legend columns=2"
    yield "legend cell align=left"
    for name, axis in (("x", figure.x), ("y", figure.y)):
        yield from _axis(name, axis)


def _axis(name: str, axis: Axis) -> Iterator[str]:
    yield f"{name}label={{{escape(axis.label)}}}"
    if axis.is_log:
        yield f"{name}mode=log"
    if axis.ticks:
        yield f"{name}tick={{{','.join(_number(place) for place, _ in axis.ticks)}}}"
        yield f"{name}ticklabels={{{','.join(f'{{{_tick(text)}}}' for _, text in axis.ticks)}}}"
    for key, limit in (("min", axis.low), ("max", axis.high)):
        if limit is not None:
            yield f"{name}{key}={_number(limit)}"


def _tick(text: str) -> str:
    """The label of a tick; powers of ten as formulas."""
    base, power, exponent = text.partition("^")
    return f"${base}^{{{exponent}}}$" if power else escape(text)


def _plot(series: Series, *, is_first: bool) -> Iterator[str]:
    """One series, with its entry in the legend. is_first: of the grey ones, which share an entry."""
    mark = series.mark
    options = [f"color={_colour(mark)}", f"mark={MARKS[mark.marker]}", f"mark size={_number(SIZE * mark.size)}pt"]
    options.append(f"line width={_number(0.5 * mark.width)}pt" if series.joined else "only marks")
    if series.hollow:
        options.append("mark options={fill=white}")
    if mark.label is None and not is_first:
        options.append("forget plot")
    yield f"\\addplot[{', '.join(options)}]"
    yield r"table[row sep=\\] {x y \\"
    yield from (f"{_number(x)} {_number(y)} \\\\" for x, y in zip(series.x, series.y, strict=True))
    yield "};"
    if mark.label is not None or is_first:
        yield f"\\addlegendentry{{{'others' if mark.label is None else escape(mark.label)}}}"


def _colour(mark: Mark) -> str:
    """A colour of HTML as an expression of xcolor, which needs no definition."""
    parts = (int(mark.colour[i : i + 2], 16) for i in (1, 3, 5))
    red, green, blue = parts
    return f"{{rgb,255:red,{red};green,{green};blue,{blue}}}"


def _number(value: float) -> str:
    """A number as pgfplots reads it."""
    if not math.isfinite(value):
        raise ValueError(f"expected a finite number, got {value}")
    return f"{value:.6g}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and figures as one self-contained HTML page."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..claims.claims import FAILS, HOLDS, UNTESTED, Chart
from ..claims.report import CLASSES, draw
from .levels import Level
from .tables import NODES, NOISE, SAME_MODELS, Line, Spread

STYLE = (
    "body{font:15px/1.45 sans-serif;margin:2em auto;max-width:78em;padding:0 1em}"
    "table{border-collapse:collapse;width:100%;margin-bottom:1.5em}td,th{padding:.25em .5em;text-align:right;"
    "vertical-align:top;border-bottom:1px solid #8884}td:first-child,th:first-child,td.why{text-align:left}"
    ".holds{color:#087a55;font-weight:bold}.fails{color:#b83500;font-weight:bold}.why{color:#666;font-size:90%}"
    "svg{max-width:100%;height:auto}"
)
"""The look of the page of claims."""

PUBLISHED = "published"


def as_html(
    found: Sequence[Line],
    figures: Mapping[str, Mapping[str, Sequence[Level]]],
    census: Mapping[str, Sequence[Mapping[str, Any]]],
    machines: Mapping[str, Mapping[str, Any]],
    about: str,
) -> str:
    """The page. figures: by scene and tree the levels; census: the rows of table 2.1 by scene."""
    shown = "; ".join(", ".join(f"{key} {html.escape(str(v))}" for key, v in one.items()) for one in machines.values())
    counts = ", ".join(f"{sum(line.verdict == kind for line in found)} {kind}" for kind in (HOLDS, FAILS, UNTESTED))
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Hoobergs 2019</title><style>{STYLE}</style>'
        f"<h1>The tables of Hoobergs 2019, measured again</h1><p>{html.escape(about)} {shown}.</p>"
        f"<p>Each cell: smallest, median and largest over seeds; below it what the thesis states. A time holds if its "
        f"median is at most {NOISE:g} points above the published one, a number of nodes if it is within {NODES:.0%} "
        f"(on {', '.join(SAME_MODELS)}; the other models are not those of the thesis). Times: {counts}. "
        f"{sum(line.wrong for line in found):,} checked answers differ from brute force.</p>"
        f"{''.join(_tables(found))}{''.join(_planes(figures, census))}</html>\n"
    )


def _tables(found: Sequence[Line]) -> Iterable[str]:
    for table in sorted({line.table for line in found}):
        own = [line for line in found if line.table == table]
        title = f"Table {table}" if table[0].isdigit() else "The comparison of all structures"
        yield f"<h2>{title}: {html.escape(', '.join(dict.fromkeys(line.structure for line in own)))}</h2>"
        yield (
            "<table><tr><th>scene</th><th>tree</th><th>time, % of kd</th><th>verdict</th><th>tests nearest, %</th>"
            "<th>tests any, %</th><th>inner nodes kd</th><th>BSP</th><th>all nodes</th><th>verdict</th></tr>"
        )
        yield "".join(map(_line, own)) + "</table>"


def _line(line: Line) -> str:
    name = f"{line.structure} K={line.k}" if line.k else line.structure
    theirs = line.theirs
    published: dict[str, Sequence[float]] = {key: (theirs[key],) for key in theirs}
    if line.times is not None:
        published["time"] = line.times
    cells = {key: _cell(line.ours[key], published.get(key)) for key in line.ours}
    return (
        f"<tr><td>{html.escape(line.model)}</td><td>{html.escape(name)}</td><td>{cells['time']}</td>"
        f'<td class="{CLASSES.get(line.verdict, "")}">{line.verdict}</td><td>{cells["nearest"]}</td>'
        f"<td>{cells['any']}</td><td>{cells['nodes_axis']}</td><td>{cells['nodes_oblique']}</td>"
        f'<td>{cells["nodes"]}</td><td class="{CLASSES.get(line.nodes, "")}">{line.nodes}</td></tr>'
        f'<tr><td class="why" colspan="10">{html.escape(line.why)}</td></tr>'
    )


def _cell(ours: Spread, theirs: Sequence[float] | None) -> str:
    low, middle, high = ours
    own = _number(middle) if low == high else " ".join(map(_number, ours))
    there = "" if theirs is None else f'<div class="why">{PUBLISHED} {" ".join(map(_number, theirs))}</div>'
    return own + there


def _number(x: float) -> str:
    return f"{x / 1e3:,.0f}k" if x >= 10_000 else f"{x:.0f}"


def _planes(
    figures: Mapping[str, Mapping[str, Sequence[Level]]], census: Mapping[str, Sequence[Mapping[str, Any]]]
) -> Iterable[str]:
    for scene, trees in figures.items():
        yield f"<h2>Table 2.1, figures 2.1 and 3.1: planes that are tried, {html.escape(scene)}</h2>"
        yield (
            "<table><tr><th>tree</th><th>planes of the widest level, per triangle</th><th>by formula</th>"
            "<th>different planes, per triangle</th><th>by formula</th></tr>"
        )
        for row in census[scene]:
            yield (
                f"<tr><td>{row['kind']}</td><td>{row['widest']:.1f}</td><td>{row['per_level_formula']}</td>"
                f"<td>{row['distinct']:.1f}</td><td>{row['distinct_formula']:.1f}</td></tr>"
            )
        yield "</table>"
        for title, column in (("planes tried", "planes"), ("different planes so far", "distinct")):
            lines = {kind: [(level.depth, getattr(level, column)) for level in own] for kind, own in trees.items()}
            yield draw(Chart(f"{scene}: {title} by level", "level", "planes", lines))

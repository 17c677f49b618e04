# SPDX-License-Identifier: GPL-3.0-or-later
"""Slowdowns on extreme coordinates and shapes, as text and as one self-contained HTML page."""

from __future__ import annotations

import functools
import html
from collections.abc import Mapping, Sequence
from typing import Any

from ..report import marks, plots
from .slowdown import LIMITS, Row, slowed

INTRODUCTION = """A sphere, seen by rays from its centre and by a camera outside, nearest hits and any-hits. Each
number is a ratio to the same triangles under ordinary conditions: the same rounded vertices moved back to the origin
or scaled to size 1, the sphere without the huge triangle, triangles of good shape instead of slivers. For coincident
triangles, all of which each ray must test, it is the ratio to half as many: 2 is linear. Work is the larger ratio of
the numbers of steps and of tests, which no machine changes. Answers of both scenes are compared with brute force bit
for bit."""

CAPTION = """Each line is one configuration. Those whose ratio is largest somewhere are named; the dotted lines are the
limits up to which an offset counts as no slowdown."""

NAMED = 8
"""Number of configurations with a colour in a plot."""

KINDS = {"work": "work", "time_ratio": "time"}
"""Ratios of a row, and their titles."""


def kinds(rows: Sequence[Row]) -> list[str]:
    """The ratios that were measured."""
    return [kind for kind in KINDS if all(row[kind] is not None for row in rows)]


def table(rows: Sequence[Row], kind: str) -> str:
    """One ratio as aligned columns, configurations against cases; wrong answers are next to it."""
    cases = list(dict.fromkeys(row["case"] for row in rows))
    found = {(row["spec"], row["case"]): row for row in rows}
    specs = dict.fromkeys(row["spec"] for row in rows)
    lines = [[KINDS[kind], *cases]]
    lines += [[spec, *(cell(found.get((spec, case)), kind) for case in cases)] for spec in specs]
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return "\n".join(
        "  ".join(text.rjust(w) if i else text.ljust(w) for i, (text, w) in enumerate(zip(line, widths, strict=True)))
        for line in lines
    )


def cell(row: Row | None, kind: str) -> str:
    """A ratio with two digits after the point, and the number of wrong answers if there are any."""
    if row is None:
        return ""
    return f"{row[kind]:.2f}" + (f" ({row['wrong']} wrong)" if row["wrong"] else "")


def verdict(rows: Sequence[Row]) -> str:
    """The result in one sentence."""
    wrong = sum(bool(row["wrong"]) for row in rows)
    slow = sum(slowed(row) for row in rows)
    answers = sum(row["rays"] for row in rows)
    specs = len({row["spec"] for row in rows})
    return (
        f"{specs} configurations, {answers:,} rays: {wrong} of {len(rows)} rows have wrong answers, {slow} exceed the "
        "limits of work far from the origin or next to one huge triangle"
    )


def as_html(document: Mapping[str, Any]) -> str:
    """One self-contained page: plots and tables."""
    rows: list[Row] = document["rows"]
    parts = [f"<p>{html.escape(document['verdict'])}.</p><p>{html.escape(INTRODUCTION)}</p>"]
    for kind in kinds(rows):
        if plots.problem() is None:
            svg = plots.svg(functools.partial(draw, rows=rows, kind=kind), 5.4)
            parts.append(f"<figure><h2>{KINDS[kind].capitalize()}</h2>{svg}<figcaption>{CAPTION}</figcaption></figure>")
        parts.append(_html_table(rows, kind))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Slowdown</title>'
        "<style>body{font:15px/1.4 sans-serif;margin:2em auto;max-width:75em}table{border-collapse:collapse}"
        "td,th{padding:.15em .6em;text-align:right;border-bottom:1px solid #8884}td:first-child,th:first-child"
        "{text-align:left}.wrong{font-weight:bold}</style>"
        f"<h1>Slowdown by offset, scale and shape</h1>{''.join(parts)}</html>\n"
    )


def _html_table(rows: Sequence[Row], kind: str) -> str:
    cases = list(dict.fromkeys(row["case"] for row in rows))
    found = {(row["spec"], row["case"]): row for row in rows}
    head = "".join(f"<th>{html.escape(title)}</th>" for title in (KINDS[kind], *cases))
    body = []
    for spec in dict.fromkeys(row["spec"] for row in rows):
        cells = [f"<td>{html.escape(spec)}</td>"]
        for case in cases:
            row = found.get((spec, case))
            bad = row is not None and (row["wrong"] or slowed(row))
            cells.append(f"<td{' class=wrong' if bad else ''}>{html.escape(cell(row, kind))}</td>")
        body.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table><tr>{head}</tr>{''.join(body)}</table>"


def draw(figure: Any, rows: Sequence[Row], kind: str) -> None:
    """The ratios of all configurations against the cases of each group."""
    groups = list(dict.fromkeys(row["group"] for row in rows))
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    worst: dict[str, float] = {}
    for row in rows:
        worst[row["spec"]] = max(worst.get(row["spec"], 0.0), row[kind])
    named = sorted(worst, key=lambda spec: -worst[spec])[:NAMED]
    for axes, group in zip(panels, groups, strict=True):
        own = [row for row in rows if row["group"] == group]
        places = {case: i for i, case in enumerate(dict.fromkeys(row["case"] for row in own))}
        # Draw the named configurations last, over the others.
        for spec in sorted(worst, key=lambda spec: spec in named):
            points = [(places[row["case"]], row[kind]) for row in own if row["spec"] == spec]
            number = named.index(spec) if spec in named else None
            colour = marks.INK if number is None else marks.COLOURS[number % len(marks.COLOURS)]
            marker = "" if number is None else marks.MARKERS[number % len(marks.MARKERS)]
            style = {"color": colour, "linewidth": 1, "alpha": 0.2 if number is None else 1.0}
            x, y = [place for place, _ in points], [value for _, value in points]
            axes.plot(x, y, marker + "-", label=None if number is None else spec, **style)
        for row in own:
            if row["group"] == "offset" and row["at"] in LIMITS:
                place, limit = places[row["case"]], LIMITS[row["at"]]
                axes.plot([place - 0.3, place + 0.3], [limit, limit], ":", color=marks.INK, linewidth=1)
        axes.set_yscale("log")
        axes.set_xticks(list(places.values()), [case.removeprefix(group).strip() for case in places], rotation=30)
        axes.set_title(group)
        axes.grid(visible=True)
    panels[0].set_ylabel(f"{KINDS[kind]}, ratio")
    panels[0].legend(loc="upper left", fontsize="x-small")

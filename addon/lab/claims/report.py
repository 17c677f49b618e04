# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured claims as text and as one self-contained HTML page: published and measured values, with plots."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..report import marks, plots
from .claims import (
    BUILD_SECONDS,
    BUILDS,
    FAILS,
    HOLDS,
    LEAST_PASSES,
    MARGIN,
    PASS_SECONDS,
    REPEATS,
    VERDICTS,
    Chart,
    Checked,
    Result,
)

CLASSES = {HOLDS: "holds", FAILS: "fails"}


def as_text(result: Result) -> str:
    """A claim and its outcomes, for a terminal."""
    lines = [f"{result.claim.id}: {result.claim.statement}"]
    for outcome in result.outcomes:
        lines.append(f"  {outcome.verdict.upper()} ({outcome.configuration}): {outcome.measured}")
        lines += [f"      {line}" for line in (outcome.why, str(outcome.checked)) if line]
    return "\n".join(lines)


def summary(results: Iterable[Result]) -> str:
    """The number of outcomes of each verdict, as text."""
    counts = Counter(outcome.verdict for result in results for outcome in result.outcomes)
    return ", ".join(f"{counts[kind]} {kind}" for kind in VERDICTS)


def as_html(results: Sequence[Result], machines: Mapping[str, Mapping[str, Any]], *, quick: bool) -> str:
    """The HTML page. machines: descriptions of the measuring machines, by name."""
    shown = "; ".join(", ".join(f"{key} {html.escape(str(v))}" for key, v in one.items()) for one in machines.values())
    if len(machines) < 2:  # a single machine is named once, at the top
        results = [replace(result, machine="") for result in results]
    note = " Quick run." if quick else ""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Claims</title>'
        "<style>body{font:15px/1.45 sans-serif;margin:2em auto;max-width:64em;padding:0 1em}"
        "table{border-collapse:collapse;width:100%}td,th{padding:.3em .6em;text-align:left;vertical-align:top;"
        "border-bottom:1px solid #8884}.holds{color:#087a55;font-weight:bold}.fails{color:#b83500;font-weight:bold}"
        ".why{color:#666;font-size:90%}svg{max-width:100%;height:auto}</style>"
        f"<h1>The claims of the papers, measured again</h1><p>{summary(results)}. {method(quick=quick)} "
        f"{shown}.{note} <em>Faithful</em> is the paper's configuration, <em>best</em> ours.</p>"
        f"{''.join(_paper(name, own) for name, own in _by_paper(results).items())}</html>\n"
    )


def method(*, quick: bool) -> str:
    """One paragraph on how the numbers of a run were measured."""
    repeats = REPEATS[quick]
    return (
        f"All times are for one thread. Rays: the median of {repeats} passes after a warm-up pass, in processor time, "
        f"or of {LEAST_PASSES} and more that begin within {PASS_SECONDS[quick]} seconds. "
        f"Traversals alone: the shortest of at most {repeats + 1} passes for each chunk of rays, in wall-clock time, "
        "summed. "
        f"Builds: the median of {BUILDS[quick]}, or of those that begin within {BUILD_SECONDS[quick]} seconds, in "
        "processor time; the number of builds is given with each. A ratio of times is within the noise of its limit if "
        f"the limit lies in the 95 % interval of the median over the passes, or within {MARGIN:.0%} of the ratio."
    )


def _by_paper(results: Iterable[Result]) -> dict[str, list[Result]]:
    found: dict[str, list[Result]] = {}
    for result in results:
        found.setdefault(result.claim.paper, []).append(result)
    return found


def _paper(name: str, results: Iterable[Result]) -> str:
    return f"<h2>{html.escape(name)}</h2>" + "".join(map(_claim, results))


def _claim(result: Result) -> str:
    rows = []
    for outcome in result.outcomes:
        kind = CLASSES.get(outcome.verdict, "")
        rows.append(
            f'<tr><td class="{kind}">{outcome.verdict}</td><td>{html.escape(outcome.configuration)}</td>'
            f'<td>{html.escape(outcome.measured)}<div class="why">{html.escape(outcome.why)}</div></td>'
            f"{_errors(outcome.checked)}</tr>"
        )
    place = f" <em>Measured on</em> {html.escape(result.machine)}." if result.machine else ""
    return (
        f'<h3 id="{result.claim.id}">{html.escape(result.claim.id)}</h3>'
        f"<p><em>Published:</em> {html.escape(result.claim.statement)}{place}</p>"
        f"<table><tr><th>verdict</th><th>configuration</th><th>measured</th><th>wrong triangle</th>"
        f"<th>false hit or miss</th><th>last bits only</th><th>of</th></tr>{''.join(rows)}</table>"
        f"{''.join(map(draw, _charts(result)))}"
    )


def pictures(results: Iterable[Result]) -> dict[str, str]:
    """The plots as SVG by file name, numbered where a claim has several; none without matplotlib."""
    drawn = ((result.claim.id, number, draw(one)) for result in results for number, one in enumerate(_charts(result)))
    return {f"{name}{f'-{number + 1}' if number else ''}.svg": svg for name, number, svg in drawn if svg}


def _charts(result: Result) -> list[Chart]:
    """The plots of all configurations, whose titles name them."""
    return [
        chart
        if chart.title.startswith(outcome.configuration)
        else replace(chart, title=f"{outcome.configuration}: {chart.title}")
        for outcome in result.outcomes
        for chart in outcome.charts
    ]


def _errors(checked: Checked) -> str:
    """The cells of the answers that differ from brute force, by kind."""
    if not checked.count:
        return '<td colspan="4"></td>'
    whole = f"<td>{checked.count:,} {checked.noun}</td>"
    if checked.noun != "answers":
        return f'<td colspan="3">{checked.wrong:,}</td>{whole}'
    kinds = (checked.wrong_triangle, checked.false_hits, checked.last_bits)
    return "".join(f"<td>{count:,}</td>" for count in kinds) + whole


def draw(chart: Chart) -> str:
    """The plot as an SVG element; "" without matplotlib."""
    if plots.problem():
        return ""
    return plots.svg(lambda figure: _lines(figure.add_subplot(), chart), 4.0)


def _lines(axes: Any, chart: Chart) -> None:
    """Draw a claim's lines or grouped bars."""
    for number, (name, points) in enumerate(chart.lines.items()):
        colour, marker = marks.COLOURS[number % len(marks.COLOURS)], marks.MARKERS[number % len(marks.MARKERS)]
        x, y = zip(*points, strict=True)
        if chart.bars:
            width = 0.8 / len(chart.lines)
            axes.bar([place + number * width for place in x], y, width * 0.92, color=colour, label=name)
        else:
            axes.plot(x, y, marker + "-", color=colour, label=name)
    if chart.bars:
        places = sorted({place for points in chart.lines.values() for place, _ in points})
        middles = [place + 0.4 - 0.4 / len(chart.lines) for place in places]
        axes.set_xticks(middles, [chart.ticks[int(place)] if chart.ticks else f"{place:g}" for place in places])
        if chart.ticks:
            axes.tick_params(axis="x", labelrotation=20)
    if chart.level is not None:
        axes.axhline(chart.level[0], linestyle=":", color="#555555", label=chart.level[1])
    # The legend stands above bars, which would lie below it.
    axes.margins(y=0.3 if chart.bars else 0.05)
    axes.set_ylim(bottom=0)
    axes.set_title(chart.title)
    axes.set_xlabel(chart.x)
    axes.set_ylabel(chart.y)
    axes.legend(frameon=False)

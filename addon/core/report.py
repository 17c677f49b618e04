# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmark rows as text for a terminal, as CSV, and as one HTML page that opens offline and prints.

No time is shown without the error measured for the same configuration.
"""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Iterable, Sequence
from typing import Any

from . import plots
from .benchmark import Row, agrees

ERRORS = {
    "false_miss": "false miss",
    "false_hit": "false hit",
    "wrong_triangle": "wrong triangle",
    "t_ulp_max": "t ulp max",
}
"""Error columns of the tables, and their titles."""


def table(rows: Sequence[Row]) -> str:
    """The rows as aligned columns, one block per scene."""
    blocks = []
    for scene, own in by_scene(rows).items():
        titles, lines = cells(own)
        widths = [max(len(line[i]) for line in [titles, *lines]) for i in range(len(titles))]
        aligned = [
            "  ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
            for line in [titles, *lines]
        ]
        failed = [f"{row['spec']}: {row['error']}" for row in own if row["error"]]
        blocks.append("\n".join([heading(scene, own), aligned[0], "-" * len(aligned[0]), *aligned[1:], *failed]))
    return "\n\n".join(blocks)


def heading(scene: str, rows: Sequence[Row]) -> str:
    """What a scene's table is about, in one line."""
    checked = max((row["errors"]["rays"] for row in rows if row["errors"]), default=0)
    reference = next((row["errors"]["reference"] for row in rows if row["errors"]), "nothing")
    threads = max(row["threads"] for row in rows)
    return (
        f"{scene}: {rows[0]['triangles']:,} triangles; speeds in million rays per second (median) and times Embree, "
        f"threads: {threads}; errors against {reference} on {checked:,} rays"
    )


def by_scene(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """The rows of each scene, in order of appearance."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["scene"], []).append(row)
    return found


def set_names(rows: Iterable[Row]) -> list[str]:
    """The ray sets that occur, in order."""
    return list(dict.fromkeys(name for row in rows for name in row["rays"] or {}))


def cells(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """The titles and the lines of one scene's table."""
    sets = set_names(rows)
    titles = ["structure", "build s", "MB", *(t for name in sets for t in (name, "×Emb")), *ERRORS.values(), "checked"]
    lines = []
    for row in rows:
        line = [row["spec"], _number(row["build_s"] and row["build_s"]["med"], 3)]
        line.append(_number(row["bytes"] and row["bytes"] / 1e6, 1))
        for name in sets:
            one = (row["rays"] or {}).get(name) or {}
            line.append(_number(one.get("mrays_s") and one["mrays_s"]["med"], 3))
            line.append(_number(one.get("times_embree"), 2))
        line += ["-" if row["errors"] is None else str(row["errors"][key]) for key in ERRORS]
        line.append("-" if row["errors"] is None else str(row["errors"]["rays"]))
        lines.append(line)
    return titles, lines


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def as_csv(rows: Sequence[Row]) -> str:
    """The rows with one column per number; nested keys are joined by dots."""
    flat = [dict(_flatten("", row)) for row in rows]
    columns = list(dict.fromkeys(name for row in flat for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _flatten(prefix: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flatten(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, list):
        yield prefix, "; ".join(map(str, value))
    else:
        yield prefix, value


def findings(rows: Sequence[Row]) -> list[str]:
    """What one scene's rows say, in sentences."""
    measured = [row for row in rows if row["errors"] and row["spec"] != "embree"]
    sentences = []
    wrong = [row["spec"] for row in measured if not agrees(row)]
    if wrong:
        sentences.append(f"Answers that differ from the reference: {', '.join(wrong)}.")
    elif measured:
        checked = min(row["errors"]["rays"] for row in measured)
        sentences.append(f"All structures agree with the reference, on at least {checked:,} rays each.")
    for name in set_names(rows):
        speeds = [(row["spec"], row["rays"][name]["mrays_s"]) for row in measured if row["rays"][name]["mrays_s"]]
        if len(speeds) > 1:
            sentences.append(f"{name.capitalize()} rays: {_ranking(speeds)}.")
    return sentences


def _ranking(speeds: list[tuple[str, dict[str, float]]]) -> str:
    """The fastest, unless the ranges of the repeats overlap."""
    (best, speed), *others = sorted(speeds, key=lambda item: -item[1]["med"])
    equal = [spec for spec, other in others if other["max"] >= speed["min"]]
    if equal:
        return f"{best} and {', '.join(equal)} cannot be told apart, their repeats overlap"
    second, other = others[0]
    return f"{best} is the fastest, {speed['med'] / other['med']:.2f} times {second}"


def as_html(document: dict[str, Any]) -> str:
    """The whole report as one page."""
    rows: list[Row] = document["rows"]
    machine = document["machine"]
    parts = []
    for scene, own in by_scene(rows).items():
        parts.append(f"<section><h2>{html.escape(scene)}</h2>")
        parts.append("<p>" + html.escape(heading(scene, own)) + ".</p>")
        parts.append("<ul>" + "".join(f"<li>{html.escape(s)}</li>" for s in findings(own)) + "</ul>")
        parts.append(_html_table(own))
        parts += [f"<figure>{figure}</figure>" for figure in plots.scene_figures(own)]
        parts.append(_html_left_out(own) + "</section>")
    reason = plots.problem()
    if reason:
        parts.append(f"<p>Plots are left out: {html.escape(reason)}.</p>")
    facts = f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, SIMD level {machine['level']}"
    return _PAGE.replace("%FACTS%", html.escape(f"Halfspace {document['project_version']} on {facts}")).replace(
        "%BODY%", "\n".join(parts)
    )


def _html_table(rows: Sequence[Row]) -> str:
    titles, lines = cells(rows)
    head = "".join(f"<th>{html.escape(title)}</th>" for title in titles)
    body = []
    for row, line in zip(rows, lines, strict=True):
        kind = "yardstick" if row["spec"] == "embree" else "" if agrees(row) else "wrong"
        title = row["error"] or "; ".join(f"{k}: {v}" for k, v in (row["statistics"] or {}).items())
        body.append(
            f'<tr class="{kind}" title="{html.escape(title)}">'
            + "".join(f"<td>{html.escape(cell)}</td>" for cell in line)
            + "</tr>"
        )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"


def _html_left_out(rows: Sequence[Row]) -> str:
    reasons = dict.fromkeys((row["spec"], reason) for row in rows for reason in row["left_out"])
    errors = dict.fromkeys((row["spec"], row["error"]) for row in rows if row["error"])
    items = [f"<li>{html.escape(spec)}: {html.escape(text)}</li>" for spec, text in [*errors, *reasons]]
    return f"<h3>Left out</h3><ul>{''.join(items)}</ul>" if items else ""


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Halfspace: error and run time</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #1c1f24; max-width: 76rem; margin: 2rem auto; padding: 0 1.5rem }
h1 { font-size: 1.7rem; margin-bottom: 0 } h2 { margin-top: 2.5rem; border-bottom: 2px solid #0072b2 }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; width: 100% }
th, td { text-align: right; padding: .3rem .5rem; border-bottom: 1px solid #d5d9e0 }
th { vertical-align: bottom; background: #f2f4f7 } th:first-child, td:first-child { text-align: left }
tr.yardstick { color: #5b6472; font-style: italic } tr.wrong td { background: #fbe3d6; font-weight: 600 }
figure { margin: 1.5rem 0; break-inside: avoid } svg { max-width: 100%; height: auto } .facts { color: #5b6472 }
@media print { body { margin: 0; max-width: none; font-size: 11px } table { font-size: 9px }
section { break-before: page } section:first-of-type { break-before: auto } }
</style></head><body>
<h1>Error and run time</h1><p class="facts">%FACTS%</p>
<p>Errors and speeds of one configuration stand in one line. A shaded line gave answers that differ from the
reference. The yardstick, Embree, uses another arithmetic: it may differ in the last digits and on shared edges.
Point at a line for the statistics of its tree.</p>
%BODY%
</body></html>
"""

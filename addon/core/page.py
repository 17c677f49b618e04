# SPDX-License-Identifier: GPL-3.0-or-later
"""The report as one HTML page that opens offline, sorts and prints."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

from . import plots
from .report import by_scene, cells, findings, heading
from .rows import Row, agrees


def as_html(document: dict[str, Any], published: Any = None) -> str:
    """The whole report as one page. published: what `ksweep.read_published` gives, drawn beside the K sweep."""
    rows: list[Row] = document["rows"]
    machine = document["machine"]
    parts = []
    for scene, own in by_scene(rows).items():
        parts.append(f"<section><h2>{html.escape(scene)}</h2>")
        parts.append("<p>" + html.escape(heading(scene, own)) + ".</p>")
        parts.append("<ul>" + "".join(f"<li>{html.escape(s)}</li>" for s in findings(own)) + "</ul>")
        parts.append(_html_table(own))
        parts += [f"<figure>{figure}</figure>" for figure in plots.scene_figures(own, published)]
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

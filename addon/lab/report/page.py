# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's page with its plots, the tables of the thesis, and what concerns several scenes or machines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from ...core.measure.rows import Row, by_scene
from ...core.report import page, report
from ...core.report.page import safe
from . import plots, thesis
from .thesis import Published


def as_html(document: dict[str, Any], published: Published | None = None) -> str:
    """The whole report as one page. published: results of the thesis, shown next to ours."""
    return page.as_html(
        document,
        draw=partial(plots.pictures, published=published),
        undrawn=plots.problem(),
        before=_missing(document.get("missing") or []) + _overview(document["rows"]),
        after=_thesis(document["rows"], published) + _machines(document),
    )


def _missing(lines: Sequence[str]) -> str:
    """The requested rows that are missing."""
    if not lines:
        return ""
    items = "".join(f"<li>{safe(line)}</li>" for line in lines)
    return f"<p><b>This report is incomplete: requested rows are missing.</b></p><ul>{items}</ul>"


def _overview(rows: Sequence[Row]) -> str:
    """The answers and the finding over all scenes; "" for fewer than two."""
    scenes = by_scene(rows)
    told = [(place, scene, report.winner(own)) for place, (scene, own) in enumerate(scenes.items(), 1)]
    items = "".join(
        f'<li><a href="#scene-{place}">{safe(scene)}</a>: {safe(sentence)}</li>'
        for place, scene, sentence in told
        if sentence
    )
    listed = f'<ul class="findings">{items}</ul>' if items and len(scenes) > 1 else ""
    both = {scene: found.verdict for scene, own in scenes.items() if (found := report.worth(own)) is not None}
    if len(scenes) < 2 or not both:
        return listed
    where = " where both were measured" if len(both) < len(scenes) else ""
    better, open_ones = ([scene for scene, verdict in both.items() if verdict == one] for one in ("faster", ""))
    unsure = f"; on {len(open_ones)} the difference is within noise: {', '.join(open_ones)}" if open_ones else ""
    return listed + (
        f'<ul class="findings"><li>The build and one picture of 1024 × 1024 pixels with 16 samples are faster with a '
        f"tree with oblique planes than with kd on {len(better)} of {len(both)} scenes{where}"
        f"{': ' if better else ''}{safe(', '.join(better))}{safe(unsure)}.</li></ul>"
    )


def _thesis(rows: Sequence[Row], published: Published | None) -> str:
    """The tables of the thesis, our numbers next to the published ones."""
    found = thesis.tables(by_scene(rows), published)
    if not found:
        return ""
    intro = (
        "<section><h2>The tables of the thesis</h2><p>Percent of the kd-tree's, median over the seeds, and the smallest"
        " and the largest; builds only of the kd-tree's machine. In italics what Hoobergs (2019) published for the"
        " scene that comes nearest; there each of the three is divided by the same of the kd-tree, so that a smallest"
        " may be above a median.</p>"
    )
    parts = [intro]
    for table in found:
        # Write published numbers in italics next to ours.
        parts.append(f"<h3>{safe(table.title)}</h3>")
        width = 2 * len(table.columns)
        over = "".join(f'<th colspan="{width}" scope="colgroup">{safe(scene)}</th>' for scene in table.scenes)
        heads = "".join(f"<th>{name}</th>" for name in table.columns)
        heads += "".join(f"<th><em>{name}</em></th>" for name in table.columns)
        body = "".join(
            f'<tr><th scope="row">{safe(name)}</th>{"".join(_beside(cell, len(table.columns)) for cell in cells)}</tr>'
            for name, cells in table.lines
        )
        parts.append(
            f'<div class="wide"><table><thead><tr><td></td>{over}</tr><tr><td></td>{heads * len(table.scenes)}</tr>'
            f"</thead><tbody>{body}</tbody></table></div>"
        )
    return "".join(parts) + "</section>"


def _beside(cell: tuple[thesis.Numbers, thesis.Numbers], count: int) -> str:
    """Cells of the measured and of the published numbers."""
    ours, theirs = (["–" if math.isnan(value) else f"{value:,.0f}" for value in part] or ["–"] * count for part in cell)
    return "".join(f"<td>{text}</td>" for text in ours) + "".join(f"<td><em>{text}</em></td>" for text in theirs)


def _machines(document: dict[str, Any]) -> str:
    """The measuring machines, if there are several."""
    machines = document.get("machines") or {}
    if len(machines) < 2:
        return ""
    counts = {name: sum(row["machine"] == name for row in document["rows"]) for name in machines}
    items = "".join(
        f"<li>{safe(name)}: {safe(facts.get('processor', 'unknown'))}, {facts.get('cores', '?')} cores, "
        f"{counts[name]} rows</li>"
        for name, facts in machines.items()
    )
    return f"<section><h2>Machines</h2><ul>{items}</ul></section>"

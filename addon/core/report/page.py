# SPDX-License-Identifier: GPL-3.0-or-later
"""The report as one self-contained HTML page that sorts and prints. Every number links to its place in `bench.json`."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from ..base.notes import few
from ..measure import ranking, thesis, yardstick
from ..measure.rows import Row, agrees
from ..measure.thesis import Published
from . import answer as answers
from . import plots, statistics_page, tables
from .report import PICTURES, by_scene, findings, heading, image_total, set_names, worth, worth_it

MOST_ROWS_INSIDE = 200
"""Largest number of rows whose full content is in the page; beyond it the numbers link to `bench.json`."""


MOST_ROWS_SHOWN = 60
"""Largest number of rows before a table scrolls within the page."""


@dataclass(frozen=True)
class Cell:
    """A number of a table. at: path within its row; value: None if missing; bold: among the best."""

    text: str
    value: float | None
    at: str
    bold: bool = False


@dataclass(frozen=True)
class Column:
    """A column: its title, the group above it, and its meaning."""

    title: str
    group: str
    meaning: str


ERRORS = {
    "false_miss": ("false miss", "the reference hits, the structure does not"),
    "false_hit": ("false hit", "the structure hits, the reference does not"),
    "wrong_triangle": ("wrong tri.", "both hit, but different triangles"),
    "wrong_values": ("wrong u, v", "both hit the same triangle, but elsewhere"),
    "t_ulp_max": ("t, ulp", "the largest difference of a distance, in units in the last place"),
}


def as_html(document: dict[str, Any], published: Published | None = None, answer: str = "") -> str:
    """The whole report as one page. published: results of the thesis, shown beside ours. answer: the sentence that a
    page of one scene begins with, if it is not that of its rows.
    """
    rows: list[Row] = document["rows"]
    number = {id(row): index for index, row in enumerate(rows)}
    inside = len(rows) <= MOST_ROWS_INSIDE
    parts = [_missing(document.get("missing") or [])]
    parts.append(_overview(rows))
    introduction = f"<p>{INTRODUCTION}</p>"
    # One section per scene: answer, picture, error against time, findings, tables, omissions, other plots.
    for place, (scene, own) in enumerate(by_scene(rows).items(), 1):
        parts.append(f'<section id="scene-{place}"><h2>{_safe(scene)}</h2>')
        pictures = plots.scene_figures(own, published)
        parts += _lead(own, pictures, answer)
        parts.append(_inspector((document.get("inspectors") or {}).get(scene, "")))
        parts += [introduction, f"<p>{_safe(heading(scene, own))}.</p>"]
        introduction = ""  # once, below the first answer
        sentences = "".join(f"<li>{_safe(sentence)}</li>" for sentence in findings(own))
        parts.append(f'<ul class="findings">{sentences}</ul>')
        for table, like in ranking.by_table(own).items():
            if any(row["errors"] and row["spec"] != yardstick.SPEC for row in like):
                parts.append(f"<h3>{_safe(tables.TITLES[table])}</h3>" * bool(table) + _table(like, number, inside))
        parts.append(_left_out(own))
        parts += [_figure(picture) for picture in pictures if picture.title != plots.FIRST]
        parts.append(statistics_page.as_html(own, set_names(own)))
        parts.append("</section>")
    reason = plots.problem()
    if reason:
        parts.append(f"<p>Plots are left out: {_safe(reason)}.</p>")
    parts.append(_thesis(rows, published))
    parts.append(_machines(document))
    if inside:
        parts.append(_appendix(rows))
    return filled("Error and run time", "", document, "\n".join(parts))


def _lead(rows: Sequence[Row], pictures: Sequence[plots.Picture], told: str) -> Iterator[str]:
    """What a reader of a scene sees first: the answer, the scene, and the error of its pictures against time."""
    sentence = told or answers.answer(rows)
    if sentence:
        yield f'<p class="answer">{_safe(sentence)}</p>'
    shown = [_figure(picture) for picture in pictures if picture.title == plots.FIRST]
    portrait = next((row["portrait"] for row in rows if row.get("portrait")), None)
    if portrait is not None:
        scene = _safe(rows[0]["scene"])
        image = f'<img alt="{scene}" src="data:image/png;base64,{portrait}">'
        shown.insert(0, f"<figure class=portrait>{image}<figcaption>{scene}, by Halfspace</figcaption></figure>")
    if shown:
        yield f'<div class="lead">{"".join(shown)}</div>'


def _inspector(address: str) -> str:
    """The link to the inspector's page of a scene; "" without one."""
    told = "maps of the cost of each pixel, the worst rays step by step, trees and levels"
    return f'<p><a href="{_safe(address)}">Inspector</a>: {told}</p>' if address else ""


def _figure(picture: plots.Picture) -> str:
    """A plot with title and caption; one without a narrow form scrolls on a narrow page."""
    drawn = f'<div class="wide plot">{picture.svg}</div>'
    if picture.narrow:
        drawn = f'<div class="broad">{picture.svg}</div><div class="narrow">{picture.narrow}</div>'
    return f"<figure><h3>{_safe(picture.title)}</h3>{drawn}<figcaption>{_safe(picture.caption)}</figcaption></figure>"


INTRODUCTION = """Every time is shown with the error measured for the same configuration. A shaded line with a cross
gave answers that differ from the reference. Embree is the yardstick; its arithmetic differs, so it may deviate in the
last digits and on shared edges. Click a column's title to sort by it, a number to find it in <code>bench.json</code>.
"""


def filled(title: str, introduction: str, document: dict[str, Any], body: str) -> str:
    """A page in the common layout of all reports. introduction, body: HTML; document: contains version and machine."""
    found = resources.files(__package__ or "").joinpath("page.html").read_text(encoding="utf-8")
    parts = {"TITLE": _safe(title), "FACTS": _safe(_facts(document)), "BODY": body}
    parts["INTRODUCTION"] = f"<p>{introduction}</p>" if introduction else ""
    for name, text in parts.items():
        found = found.replace(f"%{name}%", text)
    return found


def _missing(lines: Sequence[str]) -> str:
    """The requested rows that are missing."""
    if not lines:
        return ""
    items = "".join(f"<li>{_safe(line)}</li>" for line in lines)
    return f"<p><b>This report is incomplete: requested rows are missing.</b></p><ul>{items}</ul>"


def _overview(rows: Sequence[Row]) -> str:
    """The answers and the finding over all scenes; "" for fewer than two."""
    scenes = by_scene(rows)
    told = [(place, scene, answers.winner(own)) for place, (scene, own) in enumerate(scenes.items(), 1)]
    items = "".join(
        f'<li><a href="#scene-{place}">{_safe(scene)}</a>: {_safe(sentence)}</li>'
        for place, scene, sentence in told
        if sentence
    )
    listed = f'<ul class="findings">{items}</ul>' if items and len(scenes) > 1 else ""
    both = [scene for scene, own in scenes.items() if worth(own) is not None]
    if len(scenes) < 2 or not both:
        return listed
    where = " where both were measured" if len(both) < len(scenes) else ""
    better, open_ones = worth_it(rows), worth_it(rows, "")
    unsure = f"; on {len(open_ones)} the difference is within noise: {', '.join(open_ones)}" if open_ones else ""
    return listed + (
        f'<ul class="findings"><li>The build and one picture of 1024 × 1024 pixels with 16 samples are faster with a '
        f"tree with oblique planes than with kd on {len(better)} of {len(both)} scenes{where}"
        f"{': ' if better else ''}{_safe(', '.join(better))}{_safe(unsure)}.</li></ul>"
    )


def _safe(text: Any) -> str:
    return html.escape(str(text))


def _facts(document: dict[str, Any]) -> str:
    machine = document["machine"]
    return (
        f"Halfspace {document['project_version']} on {machine['processor']}, {machine['cores']} cores, "
        f"{machine['system']}, SIMD level {machine['level']}"
    )


def _columns(rows: Sequence[Row]) -> list[Column]:
    columns = [
        Column("s", "build", "seconds, median; processor time on one thread, else wall-clock time"),
        Column("MB", "memory", "nodes and leaves"),
        Column("peak", "memory", "peak of a build in a process of its own, megabytes"),
    ]
    columns.append(
        Column(
            "s",
            "image",
            "the build, and a picture of 1024 × 1024 pixels with 16 samples, predicted from smaller ones, seconds",
        )
    )
    for name in set_names(rows):
        columns.append(Column("Mray/s", name, "million rays per second, median of the rounds"))
        columns.append(Column("×Emb", name, "times Embree's speed in the same rounds, median"))
    for title, meaning in ERRORS.values():
        columns.append(Column(title, "errors", meaning))
    columns.append(Column("rays", "errors", "compared with the reference, one by one"))
    return columns


def _cells(row: Row, sets: Sequence[str], best: set[tuple[int, str]]) -> Iterator[Cell]:
    build = row["build_s"] and row["build_s"]["med"]
    yield _cell(build, "build_s/med", 3)
    yield _cell(row["bytes"] and row["bytes"] / 1e6, "bytes", 1)
    yield _cell(row["peak_bytes"] and row["peak_bytes"] / 1e6, "peak_bytes", 1)
    yield _cell(image_total(row), "image_s/med", 2)
    for name in sets:
        one = (row["rays"] or {}).get(name) or {}
        speed = one.get("mrays_s") and one["mrays_s"]["med"]
        yield _cell(speed, f"rays/{name}/mrays_s/med", 3, bold=(id(row), name) in best)
        yield _cell(one.get("times_embree"), f"rays/{name}/times_embree", 2)
    errors = row["errors"] or {}
    for key in (*ERRORS, "rays"):
        yield _cell(errors.get(key), f"errors/{key}", 0)


def _cell(value: float | None, at: str, digits: int, *, bold: bool = False) -> Cell:
    if value is None:
        return Cell("–", None, at)
    return Cell(f"{value:,.{digits}f}".replace(",", "\u202f"), float(value), at, bold)


def _table(rows: Sequence[Row], number: dict[int, int], inside: bool) -> str:
    columns, sets = _columns(rows), set_names(rows)
    # Count the columns of each group for the header.
    groups: list[list[Any]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1][1] += 1
        else:
            groups.append([column.group, 1])
    over = "".join(f'<th colspan="{count}" scope="colgroup">{_safe(group)}</th>' for group, count in groups)
    head = "".join(
        f'<th scope="col" title="{_safe(column.meaning)}"><button type="button">{_safe(column.title)}</button></th>'
        for column in columns
    )
    best = tables.best(rows, sets)
    # Write one line per row, with a link to it.
    body = []
    for row in rows:
        kind = "yardstick" if row["spec"] == yardstick.SPEC else "" if agrees(row) else "wrong"
        index = number[id(row)]
        cells = "".join(_html_cell(cell, index, inside) for cell in _cells(row, sets, best))
        link = f'<a href="{_target(index, "spec", inside)}">{_safe(row["spec"] or row["scene"])}</a>'
        way = f" <small>{_safe(row['nodes'])}, {_safe(tables.rays_text(row))}</small>" if row.get("nodes") else ""
        body.append(f'<tr class="{kind}"><th scope="row">{link}{way}</th>{cells}</tr>')
    kind = "wide tall" if len(rows) > MOST_ROWS_SHOWN else "wide"
    return (
        f'<div class="{kind}"><table class="sortable"><thead><tr><td></td>{over}</tr>'
        f'<tr><th scope="col"><button type="button">structure</button></th>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
        '<p class="note">Bold: the fastest structures without errors that noise does not separate. None is bold '
        "where a faster one is not; Embree is the yardstick and takes no part.</p>"
    )


def _html_cell(cell: Cell, index: int, inside: bool) -> str:
    if cell.value is None:
        return "<td>–</td>"
    text = f'<a href="{_target(index, cell.at, inside)}">{cell.text}</a>'
    return f'<td data-value="{cell.value:.9g}"{" class=best" if cell.bold else ""}>{text}</td>'


def _target(index: int, at: str, inside: bool) -> str:
    return f"{'' if inside else 'bench.json'}#/rows/{index}/{at}"


def _left_out(rows: Sequence[Row]) -> str:
    """Failures, omissions and what took too long, each group with its reasons and the structures they apply to."""
    groups: dict[str, Callable[[Row], list[str]]] = {
        "Failed": lambda row: [row["error"]] if row["error"] else [],
        "Took too long": lambda row: row["too_slow"],
        "Left out, as the scene does not need it or the memory does not suffice": lambda row: row["left_out"],
    }
    parts = []
    for title, reasons_of in groups.items():
        reasons: dict[str, list[tuple[str, str]]] = {}
        for row in rows:
            for text in reasons_of(row):
                # Reasons that differ only in their numbers stand in one line, with the numbers of the first.
                reasons.setdefault(re.sub(r"[\d.,]+", "0", text), []).append((text, row["spec"] or row["scene"]))
        items = "".join(f"<li>{_reason(told)}</li>" for told in reasons.values())
        parts.append(f"<li>{title}:<ul>{items}</ul></li>" if items else "")
    items = "".join(parts)
    return f"<h3>Left out, and failed</h3><ul>{items}</ul>" if items else ""


def _reason(told: Sequence[tuple[str, str]]) -> str:
    """A reason, the structures it applies to, and whether the numbers of some of them are others."""
    text, first = told[0]
    names = few(list(dict.fromkeys(name for _, name in told)))
    differ = f"; numbers of {first}, the others have their own" if any(other != text for other, _ in told) else ""
    return f"{_safe(text)} <span class=note>({_safe(names + differ)})</span>"


def _thesis(rows: Sequence[Row], published: Published | None) -> str:
    """The tables of the thesis, our numbers beside the published ones."""
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
        # Write published numbers in italics beside ours.
        parts.append(f"<h3>{_safe(table.title)}</h3>")
        width = 2 * len(table.columns)
        over = "".join(f'<th colspan="{width}" scope="colgroup">{_safe(scene)}</th>' for scene in table.scenes)
        heads = "".join(f"<th>{name}</th>" for name in table.columns)
        heads += "".join(f"<th><em>{name}</em></th>" for name in table.columns)
        body = "".join(
            f'<tr><th scope="row">{_safe(name)}</th>{"".join(_beside(cell, len(table.columns)) for cell in cells)}</tr>'
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
        f"<li>{_safe(name)}: {_safe(facts.get('processor', 'unknown'))}, {facts.get('cores', '?')} cores, "
        f"{counts[name]} rows</li>"
        for name, facts in machines.items()
    )
    return f"<section><h2>Machines</h2><ul>{items}</ul></section>"


def _without_pictures(row: Row) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key not in PICTURES}


def _appendix(rows: Sequence[Row]) -> str:
    """All rows as in bench.json, each value with an anchor that the tables link to."""
    parts = [
        f"<details><summary>rows[{index}]: {_safe(row['scene'])}, <b>{_safe(row['spec'])}</b></summary>"
        f"<pre>{''.join(_json(_without_pictures(row), f'/rows/{index}', 0))}</pre></details>"
        for index, row in enumerate(rows)
    ]
    return f'<section class="appendix"><h2>All rows of bench.json</h2>{"".join(parts)}</section>'


def _json(value: Any, path: str, depth: int) -> Iterator[str]:
    """JSON with indented keys, one line per key."""
    if not isinstance(value, dict) or not value:
        yield _safe(json.dumps(value))
        return
    yield "{\n"
    for place, (key, inner) in enumerate(value.items()):
        comma = "," if place + 1 < len(value) else ""
        yield f'{" " * (depth + 1)}<i id="{_safe(path)}/{_safe(key)}">{_safe(json.dumps(key))}: '
        yield from _json(inner, f"{path}/{key}", depth + 1)
        yield f"{comma}</i>\n"
    yield " " * depth + "}"

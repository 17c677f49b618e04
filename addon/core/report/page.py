# SPDX-License-Identifier: GPL-3.0-or-later
"""The report as one self-contained HTML page that sorts and prints. Every number links to its place in `bench.json`."""

from __future__ import annotations

import html
import itertools
import json
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from typing import Any, Literal

from ..base.notes import few
from ..measure import inference, ranking, yardstick
from ..measure.rows import Row, agrees, by_scene, set_names
from . import costs, report, statistics, tables
from .statistics import Column

MOST_ROWS_INSIDE = 200
"""Largest number of rows whose full content is in the page; beyond it the numbers link to `bench.json`."""


MOST_ROWS_SHOWN = 60
"""Largest number of rows before a table scrolls within the page."""

Target = Callable[[Row, str], str]
"""The address of a value, from its row and its path within the row."""


@dataclass(frozen=True)
class Picture:
    """A plot. svg: the element, "" where the caption says why there is none; caption: its content and how to read it.
    narrow: the same for a page as narrow as a telephone; "" where the wide one scrolls instead. leads: whether a scene
    begins with it. other: the label of a switch, and the element that it shows instead.
    """

    title: str
    svg: str
    caption: str
    narrow: str = ""
    leads: bool = False
    other: tuple[str, str] | None = None


ERRORS = {
    "false_miss": ("false miss", "the reference hits, the structure does not"),
    "false_hit": ("false hit", "the structure hits, the reference does not"),
    "wrong_triangle": ("wrong tri.", "both hit, but different triangles"),
    "wrong_values": ("wrong u, v", "both hit the same triangle, but elsewhere"),
    "wrong_any_hit": ("wrong any-hit", "one is blocked, the other is not, when any hit is asked for"),
    "t_ulp_max": ("t, ulp", "the largest difference of a distance, in units in the last place"),
}


def as_html(
    document: dict[str, Any],
    *,
    answer: str = "",
    draw: Callable[[Sequence[Row]], Sequence[Picture]] = lambda _: (),
    undrawn: str | None = "scripts/bench.py draws them",
    before: str = "",
    after: str = "",
) -> str:
    """The whole report as one page.

    answer: the sentence that a page of one scene begins with, if it is not that of its rows. draw: the plots of a
    scene's rows. undrawn: the reason why there are none, None if there are. before, after: HTML around the scenes.
    """
    rows: list[Row] = document["rows"]
    number = {id(row): index for index, row in enumerate(rows)}
    inside = len(rows) <= MOST_ROWS_INSIDE

    def target(row: Row, at: str) -> str:
        return f"{'' if inside else 'bench.json'}#/rows/{number[id(row)]}/{at}"

    parts = [before]
    introduction = f"<p>{INTRODUCTION}</p>"
    # One section per scene: answer, picture, error against time, findings, tables, omissions, other plots.
    for place, (scene, own) in enumerate(by_scene(rows).items(), 1):
        parts.append(f'<section id="scene-{place}"><h2>{safe(scene)}</h2>')
        pictures = draw(own)
        parts += _lead(own, pictures, answer)
        parts.append(_inspector((document.get("inspectors") or {}).get(scene, "")))
        parts += [introduction, f"<p>{safe(' '.join(tables.measured(scene, own)))}.</p>"]
        introduction = ""  # once, below the first answer
        parts.append(f'<ul class="findings">{_items(report.findings(own))}</ul>')
        for table, like in ranking.by_table(own).items():
            if any(row["errors"] and not yardstick.is_foreign(row["spec"]) for row in like):
                parts.append(f"<h3>{safe(tables.TITLES[table])}</h3>")
                sets = set_names(like)
                best = {(row, f"rays/{name}/mrays_s/med") for row, name in tables.best(like, sets)}
                parts.append(_table(_columns(like, sets), like, target, NOTE, best))
        parts.append(_left_out(own))
        parts += [_figure(picture) for picture in pictures if not picture.leads]
        parts += [_statistics(own, target), "</section>"]
    if undrawn:
        parts.append(f"<p>Plots are left out: {safe(undrawn)}.</p>")
    parts += [after, _appendix(rows) if inside else ""]
    return filled("Error and run time", "", document, "\n".join(parts))


def _items(sentences: Sequence[str]) -> str:
    return "".join(f"<li>{safe(sentence)}</li>" for sentence in sentences)


def _lead(rows: Sequence[Row], pictures: Sequence[Picture], told: str) -> Iterator[str]:
    """The head of a scene: the answer, errors of pictures and of answers against time, and the scene."""
    sentence = told or report.answer(rows)
    if sentence:
        yield f'<p class="answer">{safe(sentence)}</p>'
    shown = [_figure(picture) for picture in pictures if picture.leads]
    portrait = next((row["portrait"] for row in rows if row.get("portrait")), None)
    if portrait is not None:
        scene = safe(rows[0]["scene"])
        image = f'<img alt="{scene}" src="data:image/png;base64,{portrait}">'
        shown.append(f"<figure class=portrait>{image}<figcaption>{scene}, by Halfspace</figcaption></figure>")
    if shown:
        yield f'<div class="lead">{"".join(shown)}</div>'


def _inspector(address: str) -> str:
    """The link to the inspector's page of a scene; "" without one."""
    told = "maps of the cost of each pixel, the worst rays step by step, trees and levels"
    return f'<p><a href="{safe(address)}">Inspector</a>: {told}</p>' if address else ""


def _figure(picture: Picture) -> str:
    """A plot with title and caption; one without a narrow form scrolls on a narrow page."""
    drawn = f'<div class="wide plot">{picture.svg}</div>' if picture.svg else ""
    if picture.narrow:
        drawn = f'<div class="broad">{picture.svg}</div><div class="narrow">{picture.narrow}</div>'
    if picture.other is not None:
        label, svg = picture.other
        drawn = (
            f'<label class="switch"><input type="checkbox"> {safe(label)}</label>'
            f'<div class="usual">{drawn}</div><div class="other"><div class="wide plot">{svg}</div></div>'
        )
    return f"<figure><h3>{safe(picture.title)}</h3>{drawn}<figcaption>{safe(picture.caption)}</figcaption></figure>"


INTRODUCTION = """Every time is shown with the error measured for the same configuration. A shaded line with a cross
gave answers that differ from the reference. Embree is the yardstick; its arithmetic differs, so it may deviate in the
last digits and on shared edges. Click a column's title to sort by it, a number to find it in <code>bench.json</code>.
"""


def filled(title: str, introduction: str, document: dict[str, Any], body: str) -> str:
    """A page in the common layout of all reports. introduction, body: HTML; document: contains version and machine."""
    found = resources.files(__package__ or "").joinpath("page.html").read_text(encoding="utf-8")
    parts = {"TITLE": safe(title), "FACTS": safe(_facts(document)), "BODY": body}
    parts["INTRODUCTION"] = f"<p>{introduction}</p>" if introduction else ""
    for name, text in parts.items():
        found = found.replace(f"%{name}%", text)
    return found


def safe(text: Any) -> str:
    """A text as HTML."""
    return html.escape(str(text))


def _facts(document: dict[str, Any]) -> str:
    machine = document["machine"]
    return (
        f"Halfspace {document['project_version']} on {machine['processor']}, {machine['cores']} cores, "
        f"{machine['system']}, SIMD level {machine['level']}"
    )


NOTE = """Bold: the fastest structures without errors that noise does not separate. None is bold where a faster one is
not; Embree is the yardstick and takes no part. ±: half the 95 % interval of a median (bootstrap over the rounds), in
percent of it; a number without it has fewer than six rounds."""


EVENTS = (
    ("misses", "cache_misses", "misses of the last cache per ray, counted by the processor"),
    ("instr.", "instructions", "instructions per ray, counted by the processor"),
)
"""Title, key and meaning of the columns of each ray set that the processor counts."""


def _per_triangle(row: Row, key: Literal["bytes", "peak_bytes"]) -> float | None:
    """Bytes of a row per triangle of its scene; None where they were not measured."""
    size = row[key]
    return None if size is None or not row["triangles"] else size / row["triangles"]


def _columns(rows: Sequence[Row], sets: Sequence[str]) -> list[Column]:
    """The columns of times and errors, and those of the processor's counters if rows have any."""
    image = "the build, and a picture of 1024 × 1024 pixels with 16 samples, predicted from smaller ones, seconds"
    peak, each = (f"peak of a build in a process of its own, {unit}" for unit in ("megabytes", "bytes per triangle"))
    columns = [
        Column("s", "build", "seconds, median; processor time on one thread, else wall-clock time", "build_s/med", 3),
        Column("MB", "memory", "nodes and leaves", "bytes", 1, 1e-6),
        Column("B/tri", "memory", "the same in bytes per triangle", "bytes", of=partial(_per_triangle, key="bytes")),
        Column("peak", "memory", peak, "peak_bytes", 1, 1e-6),
        Column("B/tri", "memory", each, "peak_bytes", of=partial(_per_triangle, key="peak_bytes")),
        Column("s", "image", image, "image_s/med", 2, of=report.image_total, ends=report.image_interval),
    ]
    for name in sets:
        at, speed = f"rays/{name}", "million rays per second, median of the rounds"
        columns.append(Column("Mray/s", name, speed, f"{at}/mrays_s/med", 3))
        columns.append(Column("×Emb", name, "times Embree's speed in the same rounds, median", f"{at}/times_embree", 2))
        counted = (Column(title, name, meaning, f"{at}/events/{key}", 2) for title, key, meaning in EVENTS)
        columns += [column for column in counted if any(column.value(row) is not None for row in rows)]
    columns += [Column(title, "errors", meaning, f"errors/{key}") for key, (title, meaning) in ERRORS.items()]
    return [*columns, Column("rays", "errors", "compared with the reference, one by one", "errors/rays")]


def _table(
    columns: Sequence[Column],
    rows: Sequence[Row],
    target: Target,
    note: str,
    best: Collection[tuple[int, str]] = (),
) -> str:
    """A table that sorts by its columns, with one line per row. best: a row's id and the path of a number in bold."""
    groups = [(name, len(list(same))) for name, same in itertools.groupby(column.group for column in columns)]
    over = "".join(f'<th colspan="{count}" scope="colgroup">{safe(group)}</th>' for group, count in groups)
    head = "".join(
        f'<th scope="col" title="{safe(column.meaning)}"><button type="button">{safe(column.title)}</button></th>'
        for column in columns
    )
    # Write one line per row, with a link to it.
    body = []
    for row in rows:
        kind = "yardstick" if row["spec"] == yardstick.SPEC else "" if agrees(row) else "wrong"
        link = f'<a href="{target(row, "spec")}">{safe(row["spec"] or row["scene"])}</a>'
        way = f" <small>{safe(row['nodes'])}, {safe(tables.rays_text(row))}</small>" if row["nodes"] else ""
        cells = "".join(_cell(column, row, target, is_best=(id(row), column.at) in best) for column in columns)
        body.append(f'<tr class="{kind}"><th scope="row">{link}{way}</th>{cells}</tr>')
    kind = "wide tall" if len(rows) > MOST_ROWS_SHOWN else "wide"
    return (
        f'<div class="{kind}"><table class="sortable"><thead><tr><td></td>{over}</tr>'
        f'<tr><th scope="col"><button type="button">structure</button></th>{head}</tr></thead>'
        f'<tbody>{"".join(body)}</tbody></table></div><p class="note">{safe(note)}</p>'
    )


def _cell(column: Column, row: Row, target: Target, *, is_best: bool) -> str:
    value = column.value(row)
    if value is None:
        return "<td>–</td>"
    text = f'<a href="{target(row, column.at)}">{column.text(value)}</a>'
    if (ends := column.interval(row)) is not None:
        low, high = map(column.text, ends)
        share = 100 * inference.half_width(*ends)
        text += f' <small title="95 %: {low} to {high}">±{share:.{0 if share >= 1 else 1}f} %</small>'
    return f'<td data-value="{value:.9g}"{" class=best" * is_best}>{text}</td>'


def _statistics(rows: Sequence[Row], target: Target) -> str:
    """The statistics of trees and rays of one scene, closed at first; "" without any."""
    found = statistics.tables(rows, set_names(rows))
    sentences = list(statistics.sentences(costs.correlation(rows), costs.fits(rows)))
    if not found and not sentences:
        return ""
    listed = f"<ul>{_items(sentences)}</ul>" if sentences else ""
    shown = "".join(f"<h3>{safe(one.title)}</h3>{_table(one.columns, one.rows, target, one.note)}" for one in found)
    return f"<details><summary>Statistics of trees and rays</summary>{listed}{shown}</details>"


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
                # Reasons that differ only in their numbers share one line, with the numbers of the first.
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
    return f"{safe(text)} <span class=note>({safe(names + differ)})</span>"


def _appendix(rows: Sequence[Row]) -> str:
    """All rows as in bench.json, each value with an anchor that the tables link to."""
    parts = [
        f"<details><summary>rows[{index}]: {safe(row['scene'])}, <b>{safe(row['spec'])}</b></summary>"
        f"<pre>{''.join(_json(report.without_pictures(row), f'/rows/{index}', 0))}</pre></details>"
        for index, row in enumerate(rows)
    ]
    return f'<section class="appendix"><h2>All rows of bench.json</h2>{"".join(parts)}</section>'


def _json(value: Any, path: str, depth: int) -> Iterator[str]:
    """JSON with indented keys, one line per key."""
    if not isinstance(value, dict) or not value:
        yield safe(json.dumps(value))
        return
    yield "{\n"
    for place, (key, inner) in enumerate(value.items()):
        comma = "," if place + 1 < len(value) else ""
        yield f'{" " * (depth + 1)}<i id="{safe(path)}/{safe(key)}">{safe(json.dumps(key))}: '
        yield from _json(inner, f"{path}/{key}", depth + 1)
        yield f"{comma}</i>\n"
    yield " " * depth + "}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the field on the page of a report: sentences on expected and measured cost, then the tables."""

from __future__ import annotations

import html
import itertools
from collections.abc import Sequence

from ..measure.rows import Row
from . import costs, statistics
from .correlation import correlation


def as_html(rows: Sequence[Row], sets: Sequence[str]) -> str:
    """The statistics of one scene, closed at first; "" without any. rows: of one scene. sets: names of the ray sets."""
    found = statistics.tables(rows, sets)
    sentences = list(statistics.sentences(correlation(rows), costs.fit(rows)))
    if not found and not sentences:
        return ""
    items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
    body = "".join(_table(table) for table in found)
    listed = f"<ul>{items}</ul>" if items else ""
    return f"<details><summary>Statistics of trees and rays</summary>{listed}{body}</details>"


def _table(table: statistics.Table) -> str:
    """One table with its title and note. A group of columns shares the header above it."""
    groups = [(name, len(list(same))) for name, same in itertools.groupby(column.group for column in table.columns)]
    over = "".join(f'<th colspan="{count}" scope="colgroup">{html.escape(name)}</th>' for name, count in groups)
    head = "".join(
        f'<th scope="col" title="{html.escape(column.meaning)}"><button type="button">{html.escape(column.title)}'
        "</button></th>"
        for column in table.columns
    )
    body = "".join(_line(table, row, values) for row, values in table.lines)
    return (
        f"<h3>{html.escape(table.title)}</h3>"
        f'<div class="wide"><table class="sortable"><thead><tr><td></td>{over}</tr>'
        f'<tr><th scope="col"><button type="button">structure</button></th>{head}</tr></thead>'
        f'<tbody>{body}</tbody></table></div><p class="note">{html.escape(table.note)}</p>'
    )


def _line(table: statistics.Table, row: Row, values: Sequence[statistics.Value]) -> str:
    cells = "".join(
        f"<td>{html.escape(statistics.text(column, value))}</td>"
        for column, value in zip(table.columns, values, strict=True)
    )
    return f'<tr><th scope="row">{html.escape(row["spec"])}</th>{cells}</tr>'

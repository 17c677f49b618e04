# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of docs/papers.md, written from measured claims.

A table stands between two marks, `<!-- claims: NAMES; LABEL = KEY; ... -->` and `<!-- claims: end -->`. NAMES are ids
of claims, or `statements` for the tables of `statements.py`. A column shows what an outcome's `values` hold under a
key, or under the only one that begins so, and what `checked` counts for `#name`. Each scene has a row: its outcomes
stand in one cell, divided by a stroke. Without columns each outcome has a row with its verdict and its text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from . import statements

Row = Mapping[str, Any]
"""A row of claims.json: see `claims.Result.as_rows`."""

END = "<!-- claims: end -->"
BLOCK = re.compile(rf"<!-- claims: (?!end)([^>]*?) -->\n(.*?){END}", re.DOTALL)
NUMBER = re.compile(r"(?<![\w.,])\d+(?:,\d{3})*(?:\.\d+)?(?!\w)")
YEAR = re.compile(r"(19|20)\d\d")
STATEMENTS = "statements"


def written(text: str, rows: Sequence[Row]) -> str:
    """The document with its tables made anew. A table stays as it is unless all of its claims have rows.

    Raises ValueError for a mark without an end, and for a column that no outcome has.
    """
    if text.count("<!-- claims: ") != 2 * len(BLOCK.findall(text)):
        raise ValueError(f"expected {END} after each table")
    by_claim: dict[str, list[Row]] = {}
    for row in rows:
        by_claim.setdefault(row["claim"], []).append(row)

    def table(found: re.Match[str]) -> str:
        names, *columns = (part.strip() for part in found[1].split(";"))
        if names == STATEMENTS:
            made = statements.table(rows).rstrip()
        elif all(name in by_claim for name in names.split()):
            own = [row for name in names.split() for row in by_claim[name]]
            made = "\n".join(_figures(own, columns) if columns else _texts(own))
        else:
            return found[0]
        return f"<!-- claims: {found[1]} -->\n{made}\n{END}"

    return BLOCK.sub(table, text)


def _texts(rows: Iterable[Row]) -> Iterator[str]:
    """A row for each outcome: its verdict and its text."""
    yield "| claim | | verdict | measured |"
    yield "| --- | --- | --- | --- |"
    for row in rows:
        label = statements.LABELS[row["configuration"]]
        yield f"| `{row['claim']}` | {label} | {row['verdict']} | {row['measured']} |"


def _figures(rows: Iterable[Row], columns: Sequence[str]) -> Iterator[str]:
    """A row for each scene: these values of its outcomes. columns: `LABEL = KEY`. Raises ValueError."""
    keys = dict([part.strip() for part in column.rsplit(" = ", 1)] for column in columns)
    scenes: dict[str, list[Row]] = {}
    for row in rows:
        if row["values"]:
            scenes.setdefault(_scene(row["measured"]), []).append(row)
    yield f"| scene | {' | '.join(keys)} |"
    yield f"| --- |{' ---: |' * len(keys)}"
    cells = {scene: [_cell(own, key) for key in keys.values()] for scene, own in scenes.items()}
    for label, column in zip(keys, zip(*cells.values(), strict=True), strict=True):
        if not any(column):
            raise ValueError(f"no outcome has a value of {keys[label]!r}")
    for scene, own in cells.items():
        yield f"| {scene} | {' | '.join(own)} |"


def _scene(measured: str) -> str:
    """The scene that a text begins with, without its numbers of nodes and triangles."""
    return re.sub(r" \([^)]*\)|, [\d,]+ triangles", "", measured.partition(": ")[0])


def _cell(rows: Sequence[Row], key: str) -> str:
    """A value of each outcome that has it, once if all are equal."""
    found = []
    for row in rows:
        if key.startswith("#"):
            found.append(f"{row['checked'][key[1:]]:,}")
            continue
        near = [name for name in row["values"] if name.startswith(key)]
        name = key if key in row["values"] else near[0] if len(near) == 1 else ""
        found += [figure(row["values"][name])] if name else []
    return " / ".join(dict.fromkeys(found) if len(set(found)) == 1 else found)


def figure(value: float) -> str:
    """A number with two decimals, with fewer from 10 on and with more below 0.01."""
    size = abs(value)
    if size >= 100 or size == 0:
        return f"{value:,.0f}"
    return f"{value:.1f}" if size >= 10 else f"{value:.2f}" if size >= 0.01 else f"{value:.1g}"


def doubtful(text: str, rows: Sequence[Row]) -> Iterator[str]:
    """Sentences outside of tables with numbers that no text of their section's claims has, each with these numbers."""
    for section in re.split(r"(?m)^(?=## )", text):
        own = [row for row in rows if re.search(rf"(?<![\w-]){row['claim']}(?![\w-])", section)]
        if not own:
            continue
        known = " ".join(f"{row['measured']} {row['why']} {row['error']}" for row in own)
        numbers = set(NUMBER.findall(known)) | {figure(value) for row in own for value in row["values"].values()}
        prose = re.sub(r"```.*?```|`[^`]*`|(?m:^\|.*$)", "", BLOCK.sub("", section), flags=re.DOTALL)
        for sentence in re.split(r"(?<=[.;:])\s+", prose.replace("\n", " ")):
            other = [one for one in NUMBER.findall(sentence) if one not in numbers and not YEAR.fullmatch(one)]
            if other:
                yield f"{', '.join(other)}: {sentence.strip()}"

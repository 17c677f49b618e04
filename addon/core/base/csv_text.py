# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters with which a cell begins that a spreadsheet computes (CWE-1236)."""


def text(rows: Iterable[Mapping[str, Any]], columns: Sequence[str] | None = None) -> str:
    """The rows as CSV with one line of names.

    columns: the names; None for those of the first row, and "" without rows. A text that a spreadsheet would take for a
    formula gets an apostrophe in front.
    """
    written = io.StringIO()
    writer = None
    if columns is not None:
        writer = _writer(written, columns)
    for row in rows:
        writer = writer or _writer(written, list(row))
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return written.getvalue()


def _writer(written: io.StringIO, columns: Sequence[str]) -> csv.DictWriter[str]:
    """A writer that has written the line of names."""
    made = csv.DictWriter(written, list(columns), lineterminator="\n")
    made.writeheader()
    return made


def _cell(value: Any) -> Any:
    """A value that no spreadsheet computes."""
    if not isinstance(value, str) or len(value) < 2 or not value.startswith(FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value

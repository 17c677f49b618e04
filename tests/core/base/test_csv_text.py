# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of CSV that a spreadsheet would compute."""

import csv
import io

import pytest

from addon.core.base import csv_text


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        ("=1+1", "'=1+1"),
        ("@sum", "'@sum"),
        ("+x", "'+x"),
        ("-x", "'-x"),
        ("\t=1", "'\t=1"),
        ("-1.5", "-1.5"),
        ("+inf", "+inf"),
        ("-", "-"),
        (-1.5, "-1.5"),
        ("kd:k=3", "kd:k=3"),
        ("", ""),
    ],
)
def test_a_text_that_begins_like_a_formula_is_quoted(value: object, cell: str) -> None:
    (row,) = csv.DictReader(io.StringIO(csv_text.text([{"name": value, "more": 1}])))
    assert row == {"name": cell, "more": "1"}


def test_names_come_from_the_first_row_or_are_given() -> None:
    assert csv_text.text([]) == ""
    assert csv_text.text([{"b": 1}], ["a", "b"]) == "a,b\n,1\n"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the field as tables: shape of each tree, and the work of its rays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..measure.analysis import field
from ..measure.rows import Row
from .costs import PARTS, Correlation, Fit
from .report import signed

Value = float | None


@dataclass(frozen=True)
class Column:
    """A column of numbers: title, group above it, and meaning. at: path of the number within a row, by which a page
    links to it.

    digits: after the point. scale: factor of the number, unit: what follows it. of: the number, if it is another one.
    ends: its 95 % interval; None for that next to a median.
    """

    title: str
    group: str
    meaning: str
    at: str
    digits: int = 0
    scale: float = 1.0
    unit: str = ""
    of: Callable[[Row], Value] | None = None
    ends: Callable[[Row], tuple[float, float] | None] | None = None

    def value(self, row: Row) -> Value:
        """The number of a row; None if it was not measured."""
        if self.of is not None:
            return self.of(row)
        found = _at(row, self.at)
        return None if found is None else self.scale * found

    def interval(self, row: Row) -> tuple[float, float] | None:
        """The 95 % interval of the number of a row, if it has one."""
        if self.ends is not None:
            return self.ends(row)
        place, _, last = self.at.rpartition("/")
        beside = _at(row, place) if last == "med" else None
        if beside and "low" in beside:
            return self.scale * beside["low"], self.scale * beside["high"]
        found = _at(row, f"{self.at}_95")
        return (found[0], found[1]) if found else None

    def text(self, value: Value) -> str:
        """A number of the column as text."""
        return "–" if value is None else f"{value:,.{self.digits}f}".replace(",", "\u202f") + self.unit


def _at(row: Row, path: str) -> Any:
    """The value at a path within a row; None if any part is missing."""
    found: Any = row
    for key in path.split("/"):
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


@dataclass(frozen=True)
class Table:
    """A table of numbers, one line per row."""

    title: str
    note: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]


def _spread(group: str, what: str, at: str) -> Iterator[Column]:
    yield Column("mean", group, f"mean {what}", f"{at}/mean", 1)
    for key, words in (("p50", "half"), ("p90", "90 %"), ("p99", "99 %")):
        yield Column(f"{key[1:]} %", group, f"{words} have at most this {what}", f"{at}/{key}")
    yield Column("max", group, f"largest {what}", f"{at}/max")


TREE = (
    Column("nodes", "", "inner nodes", "field/tree/nodes"),
    Column("leaves", "", "leaves, empty ones included", "field/tree/leaves"),
    *_spread("leaf depth", "depth of a leaf", "field/tree/depth"),
    *_spread("leaf size", "number of triangles in a leaf", "field/tree/size"),
    Column("SAH", "expected", "cost of a random ray: 1 an axis step, 5 an oblique step, 80 a test", "field/tree/sah"),
    Column("EPO", "expected", "end-point overlap (Aila, Karras and Laine 2013)", "field/tree/epo", 1),
    Column("β", "expected", "share of node visits that meet one child only (Hoobergs 2019)", "field/tree/beta", 2),
    Column("β axis", "expected", "the same at planes along axes", "field/tree/beta_axis", 2),
    Column("β oblique", "expected", "the same at oblique planes", "field/tree/beta_oblique", 2),
)
"""Columns of the shape of trees."""


def _work(at: str) -> Iterator[Column]:
    yield from _spread("steps per ray", "number of nodes visited by a ray", f"{at}/steps")
    yield from _spread("tests per ray", "number of triangles tested by a ray", f"{at}/tests")
    yield from _spread("leaf visits per ray", "number of leaves with triangles visited by a ray", f"{at}/leaves")
    for title, meaning, key in (
        ("tests", "tests on leaf visits that found no nearer hit", "wasted_tests"),
        ("leaves", "visits of empty leaves", "empty_leaves"),
        ("misses", "steps and tests of rays that hit nothing", "missing_work"),
    ):
        yield Column(title, "wasted", meaning, f"{at}/{key}", 0, 100, " %")


def tables(rows: Sequence[Row], sets: Sequence[str]) -> list[Table]:
    """The tables of one scene that have numbers: trees, one per ray set, and the cases of TA-B."""
    made = [
        _table(
            "Shape of the trees",
            "SAH in units of an axis step; EPO is zero for trees that divide space; β is the share of visits of nodes "
            "in which a random ray meets one child only.",
            TREE,
            rows,
        )
    ]
    for name in sets:
        note = (
            "Wasted are tests on leaf visits that found no nearer hit, visits of leaves without triangles, and all "
            "work of rays that hit nothing. Rays that go together share the counts of their group."
        )
        made.append(_table(f"Work of a ray: {name}", note, tuple(_work(f"field/rays/{name}")), rows))
    return [table for table in (*made, *_cases(rows, sets)) if table.rows]


def _cases(rows: Sequence[Row], sets: Sequence[str]) -> Iterator[Table]:
    """Shares of the cases of TA-B, of the first ray set that has them."""
    for name in sets:
        cases = dict.fromkeys(case for row in rows for case in (field.value(row, "rays", name, "cases") or {}))
        if cases:
            columns = tuple(
                Column(case.upper(), "case", _CASES[case[0]], f"field/rays/{name}/cases/{case}", 1, 100, " %")
                for case in sorted(cases)
            )
            note = "N: origin below the plane, P: above, Z: in it; the numbers are those of the counters' description."
            yield _table(f"Cases of TA-B: {name}", note, columns, rows)
            return


_CASES = {"n": "origin below the plane", "p": "origin above the plane", "z": "origin in the plane"}


def _table(title: str, note: str, columns: tuple[Column, ...], rows: Sequence[Row]) -> Table:
    """The table without rows and columns that have no value."""
    known = tuple(row for row in rows if any(column.value(row) is not None for column in columns))
    kept = tuple(column for column in columns if any(column.value(row) is not None for row in known))
    return Table(title, note, kept, known)


def sentences(expected: Correlation | None, fits: Sequence[Fit]) -> Iterator[str]:
    """Sentences on how well expected costs and counts explain the measured times."""
    if expected is not None:
        if expected.pearson == expected.pearson:
            yield (
                f"The SAH cost of {len(expected.specs)} structures and their time per ray have a correlation of "
                f"{signed(expected.pearson)} (Pearson) and {signed(expected.spearman)} by ranks (Spearman)."
            )
        else:
            yield f"The SAH costs of {len(expected.specs)} structures, or their times, are all equal: no correlation."
    for fit in fits:
        each = ", ".join(f"{PARTS[key].removesuffix('s')} {fit.told(key)}" for key in fit.nanoseconds)
        yield (
            f"Rays {fit.rays}, their time fitted as a sum over steps, leaf visits and tests (eq. 3.1 of Hoobergs 2019 "
            f"with leaf visits), with 95 % intervals: {each}; R² = {fit.explained:.2f}, residuals of "
            f"{100 * fit.residual:.0f} % (root mean square)."
        )

# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the field as tables: shape of each tree, and the work of its rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..measure.analysis import field
from ..measure.rows import Row
from .correlation import Correlation
from .costs import Fit

Value = float | int | None


@dataclass(frozen=True)
class Statistic:
    """A column: title, group above it, meaning, path within the row's `field` or the row, and digits."""

    title: str
    group: str
    meaning: str
    path: tuple[str, ...]
    digits: int = 0
    percent: bool = False


@dataclass(frozen=True)
class Table:
    """A table of numbers, one line per row. lines: the row and its values."""

    title: str
    note: str
    columns: tuple[Statistic, ...]
    lines: tuple[tuple[Row, tuple[Value, ...]], ...]


def _spread(group: str, what: str, *path: str) -> Iterator[Statistic]:
    yield Statistic("mean", group, f"mean {what}", (*path, "mean"), 1)
    for key, words in (("p50", "half"), ("p90", "90 %"), ("p99", "99 %")):
        title = {"p50": "50 %", "p90": "90 %", "p99": "99 %"}[key]
        yield Statistic(title, group, f"{words} have at most this {what}", (*path, key))
    yield Statistic("max", group, f"largest {what}", (*path, "max"))


TREE = (
    Statistic("nodes", "", "inner nodes", ("tree", "nodes")),
    Statistic("leaves", "", "leaves, empty ones included", ("tree", "leaves")),
    *_spread("leaf depth", "depth of a leaf", "tree", "depth"),
    *_spread("leaf size", "number of triangles in a leaf", "tree", "size"),
    Statistic("SAH", "expected", "cost of a random ray: 1 an axis step, 5 an oblique step, 80 a test", ("tree", "sah")),
    Statistic("EPO", "expected", "end-point overlap (Aila, Karras and Laine 2013)", ("tree", "epo"), 1),
    Statistic("β", "expected", "share of node visits that meet one child only (Hoobergs 2019)", ("tree", "beta"), 2),
    Statistic("β axis", "expected", "the same at planes along axes", ("tree", "beta_axis"), 2),
    Statistic("β oblique", "expected", "the same at oblique planes", ("tree", "beta_oblique"), 2),
)
"""Columns of the shape of trees."""


def _work(name: str) -> tuple[Statistic, ...]:
    at = ("rays", name)
    return (
        *_spread("steps per ray", "number of nodes visited by a ray", *at, "steps"),
        *_spread("tests per ray", "number of triangles tested by a ray", *at, "tests"),
        *_spread("leaf visits per ray", "number of leaves with triangles visited by a ray", *at, "leaves"),
        Statistic("tests", "wasted", "tests on leaf visits that found no nearer hit", (*at, "wasted_tests"), 0, True),
        Statistic("leaves", "wasted", "visits of empty leaves", (*at, "empty_leaves"), 0, True),
        Statistic("misses", "wasted", "steps and tests of rays that hit nothing", (*at, "missing_work"), 0, True),
    )


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
        made.append(_table(f"Work of a ray: {name}", note, _work(name), rows))
    return [table for table in (*made, *_cases(rows, sets)) if table.lines]


def _cases(rows: Sequence[Row], sets: Sequence[str]) -> Iterator[Table]:
    """Shares of the cases of TA-B, of the first ray set that has them."""
    for name in sets:
        cases = dict.fromkeys(case for row in rows for case in (field.value(row, "rays", name, "cases") or {}))
        if cases:
            columns = tuple(
                Statistic(case.upper(), "case", _CASES[case[0]], ("rays", name, "cases", case), 1, True)
                for case in sorted(cases)
            )
            note = "N: origin below the plane, P: above, Z: in it; the numbers are those of the counters' description."
            yield _table(f"Cases of TA-B: {name}", note, columns, rows)
            return


_CASES = {"n": "origin below the plane", "p": "origin above the plane", "z": "origin in the plane"}


def _table(title: str, note: str, columns: tuple[Statistic, ...], rows: Sequence[Row]) -> Table:
    """The table without rows and columns that have no value."""
    lines = [(row, [field.value(row, *column.path) for column in columns]) for row in rows]
    lines = [(row, values) for row, values in lines if any(one is not None for one in values)]
    kept = [i for i in range(len(columns)) if any(values[i] is not None for _, values in lines)]
    return Table(
        title,
        note,
        tuple(columns[i] for i in kept),
        tuple((row, tuple(values[i] for i in kept)) for row, values in lines),
    )


def text(statistic: Statistic, found: Value) -> str:
    """A number of a table as text."""
    if found is None:
        return "–"
    if statistic.percent:
        return f"{100 * found:.{statistic.digits}f} %"
    return f"{found:,.{statistic.digits}f}".replace(",", "\u202f")


def sentences(expected: Correlation | None, fit: Fit | None) -> Iterator[str]:
    """What expected costs and counts explain of the measured times."""
    if expected is not None:
        if expected.pearson == expected.pearson:
            yield (
                f"The SAH cost of {len(expected.specs)} structures and their time per ray have a correlation of "
                f"{_signed(expected.pearson)} (Pearson) and {_signed(expected.spearman)} by ranks (Spearman)."
            )
        else:
            yield f"The SAH costs of {len(expected.specs)} structures, or their times, are all equal: no correlation."
    if fit is not None:
        each = ", ".join(f"{price:.1f} ns {_article(label)} {label}" for label, price in fit.priced())
        yield (
            f"Fitted as a sum over steps, leaf visits and tests (eq. 3.1 of Hoobergs 2019 with leaf visits), a ray "
            f"costs {each}: R² = {fit.explained:.2f}, residuals of {100 * fit.residual:.0f} % (root mean square)."
        )


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"


def _signed(number: float) -> str:
    return f"{number:.2f}".replace("-", "−")

# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of reports in docs/correctness.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from . import answers, judge
from .reports import REPORTS, Report

if TYPE_CHECKING:
    from ...core.base.interface import Native

BEGIN, END = "<!-- table of reports: begin -->", "<!-- table of reports: end -->"
COLUMNS = ("Embree robust", "Embree default", "BVHTree")


@dataclass(frozen=True)
class Row:
    """A report and the numbers of wrong answers to its scene.

    rays: their number, None if the scene cannot be rebuilt. theirs: of the installed tracers, by name. ours: of all
    structures together.
    """

    report: Report
    rays: int | None = None
    theirs: Mapping[str, int] = field(default_factory=dict)
    ours: int = 0

    def line(self) -> str:
        """The row in Markdown, an item of a list without a scene; a tracer that is not installed is *not measured*."""
        link = f"[{self.report.name}]({self.report.url})"
        if self.rays is None:
            return f"- {link}: {self.report.fault}; {self.report.missing}"
        theirs = " | ".join(str(self.theirs.get(name, "not measured")) for name in COLUMNS)
        return f"| {link} | {self.report.fault} | {self.rays} | {theirs} | {self.ours} |"


def measured(native: Native, tracers: Mapping[str, answers.Tracer]) -> list[Row]:
    """A row for each report."""
    rows = []
    for report in REPORTS:
        if report.rebuild is None:
            rows.append(Row(report))
            continue
        scene = report.rebuild()
        exact = judge.nearest(scene.vertices, scene.triangles, scene.origins, scene.directions)
        theirs = {name: answers.wrong_distances(tracer(scene), exact) for name, tracer in tracers.items()}
        rows.append(Row(report, len(exact), theirs, sum(answers.ours(native, scene, exact).values())))
    return rows


def lines(rows: Sequence[Row]) -> list[str]:
    """The table in Markdown, and the list of reports whose scenes cannot be rebuilt."""
    head = f"| report | what went wrong there | rays | {' | '.join(COLUMNS)} | ours |"
    table = [head, "| --- | --- | ---: | ---: | ---: | ---: | ---: |"]
    table += [row.line() for row in rows if row.rays is not None]
    return [*table, "", "Not rebuilt:", "", *(row.line() for row in rows if row.rays is None)]


def replaced(page: str, rows: Sequence[str]) -> str:
    """The page with these lines between the marks. Raises ValueError if it lacks them."""
    head, begin, rest = page.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"expected {BEGIN} and {END}")
    return f"{head}{BEGIN}\n{chr(10).join(rows)}\n{END}{tail}"

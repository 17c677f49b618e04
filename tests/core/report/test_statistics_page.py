# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from html.parser import HTMLParser
from typing import Any

import halfspace_native
from report_rows import row

from addon.core.measure.analysis import field
from addon.core.report import statistics, statistics_page
from addon.core.scene import grid


class Tables(HTMLParser):
    """The cells of all rows of a page, line by line."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[list[str]] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag == "tr":
            self.lines.append([])
        elif tag in ("td", "th"):
            self.lines[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.lines and self.lines[-1]:
            self.lines[-1][-1] += data


def trees() -> list[dict[str, Any]]:
    """Rows of two structures over touching boxes, with the statistics of their trees."""
    scene = grid.workload(boxes=3, rays=64)
    made = []
    for spec in ("kd", "bvh-sah"):
        one = row(spec, 2.0)
        tree = halfspace_native.build(scene.vertices, scene.triangles, spec)
        one["field"] = {"tree": field.shape(tree), "rays": {}}
        made.append(one)
    return made


def test_rows_without_statistics_give_no_part() -> None:
    assert statistics_page.as_html([row("kd", 2.0)], ["primary"]) == ""


def test_each_tree_has_a_line_with_the_numbers_of_its_analysis() -> None:
    rows = trees()
    found = Tables()
    found.feed(statistics_page.as_html(rows, ["primary"]))
    lines = {line[0]: line[1:] for line in found.lines if line and line[0] in ("kd", "bvh-sah")}
    assert set(lines) == {"kd", "bvh-sah"}
    (table,) = statistics.tables(rows, ["primary"])
    assert all(len(cells) == len(table.columns) for cells in lines.values())
    # Trees that divide space have no overlap; boxes that touch do.
    overlap = [column.title for column in table.columns].index("EPO")
    assert float(lines["kd"][overlap]) == 0.0
    # The header names each group once, over its columns.
    assert found.lines[0].count("leaf depth") == 1

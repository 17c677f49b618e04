# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of a report: one file that begins with its answer, and whose numbers lead to their places."""

from __future__ import annotations

import copy
from html.parser import HTMLParser
from typing import Any

import halfspace_native

from addon.core.measure.analysis import field
from addon.core.report import page, report, statistics
from addon.core.scene import grid
from tests.report_rows import ROW, document, everything, pictured, row


def test_the_page_is_one_file_that_escapes_what_it_shows_and_says_what_is_wrong() -> None:
    failed = {
        **copy.deepcopy(ROW),
        "rays": None,
        "errors": None,
        "build_s": None,
        "bytes": None,
        "error": "too <large>",
    }
    text = page.as_html(document([row("kd"), row("kd-sah", wrong_values=3), failed]))
    assert "room &lt;1&gt;" in text
    assert "P &amp; Q" in text
    assert "too &lt;large&gt;" in text
    assert "room <1>" not in text
    for outside in ("src=", "<link", "@import", "url(http"):
        assert outside not in text
    assert text.count('<tr class="wrong"') == 2
    assert '<a href="#/rows/1/errors/wrong_values">3</a>' in text
    # Without a function that draws, it says who draws.
    assert "<svg" not in text
    assert "Plots are left out: scripts/bench.py draws them." in text


def test_the_page_begins_with_answer_picture_and_the_plot_that_leads() -> None:
    rows = [everything("a", 1.0), everything("b", 1.0)]
    for one, seconds in zip(rows, (5.0, 10.0), strict=True):
        pictured(one, seconds)
    rows[0]["portrait"] = "iVBORw0KGgo="
    drawn = [page.Picture("Speed", "<svg>", ""), page.Picture("Error", "<svg>", "", "<svg>", leads=True)]
    text = page.as_html(document(rows), draw=lambda _: drawn, undrawn=None, before="<hr>", after="<br>")
    order = [
        "<hr>",
        '<p class="answer">a is the quickest',
        "<h3>Error</h3>",
        'src="data:image/png;base64,iVBORw0KGgo="',
        '<ul class="findings">',
        "<h3>Speed</h3>",
        "<br>",
    ]
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    assert "Plots are left out" not in text
    assert text.count("iVBORw0KGgo=") == 1, "nor in the appendix"
    assert "iVBORw0KGgo=" not in report.as_csv(rows)
    # The result of a comparison in Blender replaces the sentence, so that page and panel agree.
    told = page.as_html(document(rows), answer="b: for 100 pixels it traces fastest.")
    assert '<p class="answer">b: for 100 pixels it traces fastest.</p>' in told
    assert "a is the quickest for the build and one picture" not in told


def test_every_number_leads_to_its_place_in_bench_json() -> None:
    class Links(HTMLParser):
        def __init__(self) -> None:
            super().__init__()
            self.targets: list[str] = []
            self.places: set[str] = set()

        def handle_starttag(self, tag: str, attrs: Any) -> None:
            given = dict(attrs)
            if tag == "a":
                self.targets.append(given["href"])
            if "id" in given:
                self.places.add(given["id"])

    rows = trees()
    links = Links()
    links.feed(page.as_html(document(rows)))
    assert len(links.targets) > 2 * 10
    assert {target.removeprefix("#") for target in links.targets} <= links.places
    assert {"#/rows/1/rays/primary/mrays_s/med", "#/rows/1/field/tree/depth/p90"} <= set(links.targets)
    # Final and peak bytes are there per triangle too.
    assert len([target for target in links.targets if target in ("#/rows/1/bytes", "#/rows/1/peak_bytes")]) == 4
    each = f'<a href="#/rows/1/peak_bytes">{3_000_000 / 1234:,.0f}</a>'.replace(",", "\u202f")
    assert each in page.as_html(document(rows))
    # Too many rows to hold them all: then the numbers lead to the file.
    many = Links()
    many.feed(page.as_html(document([row(f"kd:leaf_size={n}") for n in range(page.MOST_ROWS_INSIDE + 1)])))
    assert all(target.startswith("bench.json#/rows/") for target in many.targets)


def test_groups_the_configurations_left_out() -> None:
    rows = [row(f"kd:leaf_size={n}") for n in range(12)]
    for number, one in enumerate(rows):
        one["left_out"] = [f"peak memory: needs {number + 1}.5 GB"]
        one["too_slow"] = ["pictures with 16 samples per pixel: they would take too long"] * (number > 2)
    failed = copy.deepcopy(rows[0]) | {"rays": None, "errors": None, "build_s": None, "bytes": None, "error": "too big"}
    text = page.as_html(document([*rows, failed]))
    part = text[text.index("Left out, and failed") :]
    part = part[: part.index("</section>")]
    assert [part.index(title) for title in ("Failed:", "Took too long:", "Left out, as")] == sorted(
        part.index(title) for title in ("Failed:", "Took too long:", "Left out, as")
    )
    assert part.count("peak memory") == 1
    several = "kd:leaf_size=0, kd:leaf_size=1, kd:leaf_size=2 and 9 more"
    assert f"needs 1.5 GB <span class=note>({several}; numbers of kd:leaf_size=0, the others have their own)" in part
    assert part.count("the others have their own") == 1, "equal reasons have equal numbers"


def test_tables_that_scroll_say_so() -> None:
    text = page.as_html(document([row("a"), row("b")]))
    assert text.count('class="wide"') >= 1
    assert 'class="scrolls" hidden' in text
    assert "ResizeObserver" in text


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


def test_each_tree_has_a_line_with_the_numbers_of_its_analysis() -> None:
    assert "Statistics of trees" not in page.as_html(document([row("kd", 2.0)]))
    rows = trees()
    (table,) = statistics.tables(rows, ["primary"])
    text = page.as_html(document(rows))
    found = Tables()
    found.feed(text[text.index("<h3>Shape of the trees") :].partition("</table>")[0])
    lines = {line[0]: line[1:] for line in found.lines if line[0] in ("kd", "bvh-sah")}
    assert set(lines) == {"kd", "bvh-sah"}
    assert all(len(cells) == len(table.columns) for cells in lines.values())
    # Trees that divide space have no overlap; boxes that touch do.
    overlap = [column.title for column in table.columns].index("EPO")
    assert float(lines["kd"][overlap]) == 0.0
    # The header names each group once, over its columns.
    assert found.lines[0].count("leaf depth") == 1

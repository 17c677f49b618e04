# SPDX-License-Identifier: GPL-3.0-or-later
"""A report begins with its answer: one sentence with its uncertainty, ties without a list, no winner made by noise."""

from __future__ import annotations

import copy
import re
from typing import Any

import pytest
from report_rows import document, everything, pictured, row

from addon.core.report import page, plots, report, tables
from addon.core.report.answer import answer


def rows_of(*seconds: float) -> list[dict[str, Any]]:
    """Rows whose pictures take about these seconds."""
    made = [everything(f"s{number}", 1.0) for number in range(len(seconds))]
    for one, each in zip(made, seconds, strict=True):
        pictured(one, each)
        one["build_s"] = dict.fromkeys(("min", "med", "max"), 0.2)
    return made


def test_a_winner_is_named_with_its_rounds_and_the_next() -> None:
    assert answer(rows_of(5.0, 10.0)) == (
        "s0 is the quickest for the build and one picture of 1024 × 1024 pixels with 16 samples: 5.2 s (5.15 s to "
        "5.25 s over 7 rounds); the next, s1, takes 1.96 times as long (1.96 to 1.96). "
        "Up to 100 answers of each were compared: all are right."
    )


def test_a_tie_names_three_and_a_number() -> None:
    rows = rows_of(*[5.0 + 0.001 * n for n in range(18)], 10.0)
    sentence = answer(rows)
    assert sentence.startswith("18 structures (s0, s1, s2 and 15 more) cannot be told apart for the build")
    assert "a noise of 1.0 %; the next, s18, takes 1.9" in sentence
    assert answer(rows[:2]).startswith("s0 and s1 cannot be told apart")
    # Nowhere on the page is a list of all.
    text = page.as_html(document(rows))
    findings = text[text.index('<ul class="findings">') : text.index("<table")]
    assert not re.search(r"(s\d+, ){4}", findings)


def test_few_rounds_name_no_winner() -> None:
    rows = rows_of(5.0, 10.0)
    for one in rows:
        for key in ("rounds_s", "anchor_rounds_s"):
            one["image"][key] = one["image"][key][:3]
    assert "s0 has the best median for the build" in answer(rows)
    assert "fewer than 6 rounds rank nothing" in answer(rows)
    assert "quickest" not in answer(rows)


def test_without_pictures_rays_decide_and_without_a_pair_nothing_does() -> None:
    assert answer([row("a", 4.0), row("b", 2.0)]).startswith("a is the quickest for the build and")
    assert "one million rays of each set" in answer([row("a", 4.0), row("b", 2.0)])
    assert answer([row("a")]) == ""
    assert answer([]) == ""


def test_the_findings_state_the_time_of_the_answer() -> None:
    rows = [row("a", 4.0), row("b", 2.0)]
    for one in rows:
        rays = one["rays"]["primary"]
        # Its median over the rounds is not that of the column of speeds.
        rays["rounds"] = [speed * rays["mrays_s"]["med"] for speed in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1)]
    took = re.search(r"each set: ([\d.]+ m?s) ", answer(rows))
    assert took is not None
    assert any(f"together take {took[1]} with a " in text for text in report.findings(rows))


def test_wrong_answers_are_part_of_the_answer() -> None:
    rows = rows_of(5.0, 10.0, 1.0)
    rows[2]["errors"]["false_miss"] = 1
    assert answer(rows).startswith("s0 is the quickest")
    assert answer(rows).endswith("s2 gave wrong ones and are not ranked.")


def test_a_page_of_several_scenes_begins_with_all_answers() -> None:
    rows = [*rows_of(5.0, 10.0), *(one | {"scene": "other"} for one in rows_of(10.0, 5.0))]
    text = page.as_html(document(rows))
    head = text[: text.index("<section")]
    assert '<a href="#scene-1">room &lt;1&gt;</a>: s0 is the quickest' in head
    assert '<a href="#scene-2">other</a>: s1 is the quickest' in head
    assert "#scene-1" not in page.as_html(document(rows[:2]))


def test_single_rays_do_not_compete_with_the_quickest_ways() -> None:
    rows = rows_of(5.0, 10.0, 1.0, 2.0, 3.0)
    for one, table in zip(rows, ("fastest", "fastest", "single", "single", "single"), strict=True):
        one |= {"table": table, "tables": [table]}
    assert answer(rows).startswith("s0 is the quickest")


def test_the_page_begins_with_answer_picture_and_curves() -> None:
    rows = rows_of(5.0, 10.0)
    rows[0]["portrait"] = "iVBORw0KGgo="
    text = page.as_html(document(rows))
    order = [
        '<p class="answer">s0 is the quickest',
        'src="data:image/png;base64,iVBORw0KGgo="',
        '<ul class="findings">',
    ]
    if plots.problem() is None:
        order.insert(2, f"<h3>{plots.FIRST}</h3>")
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    assert text.count("iVBORw0KGgo=") == 1, "nor in the appendix"
    assert "iVBORw0KGgo=" not in report.as_csv(rows)
    # The result of a comparison in Blender replaces the sentence, so that page and panel agree.
    told = page.as_html(document(rows), answer="s1: for 100 pixels it traces fastest.")
    assert '<p class="answer">s1: for 100 pixels it traces fastest.</p>' in told
    assert "s0 is the quickest" not in told


@pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))
def test_at_most_eight_curves_are_coloured() -> None:
    rows = [everything(f"f{letter}-x", 1.0 + n / 10) for n, letter in enumerate("abcdefghijk")]
    (first,) = (picture for picture in plots.scene_figures(rows) if picture.title == plots.FIRST)
    assert "relMSE" in first.svg
    for svg in (first.svg, first.narrow):
        assert "4 others" in svg
        assert len(set(re.findall(r">f[a-k]-x<", svg))) == 7
        assert "16 samples" in svg
    assert not set(re.findall(r'id="(\w+)"', first.svg)) & set(re.findall(r"url\(#(\w+)\)", first.narrow))


def test_no_row_is_bold_where_a_faster_one_is_not() -> None:
    # b is faster than c by its median, but only c is torn: noise separates b from a, and c not.
    a, b, c = row("a", 4.0, 0.01), row("b", 3.0, 0.01), row("c", 2.0, 0.01)
    c["rays"]["primary"]["rounds"][0] = 9.0
    assert tables.best([a, b, c], ["primary"]) == {(id(a), "primary")}
    assert tables.best([a, c], ["primary"]) == {(id(a), "primary"), (id(c), "primary")}
    wrong = row("d", 9.0, false_hit=1)
    assert tables.best([a, b, wrong], ["primary"]) == {(id(a), "primary")}


def test_what_was_left_out_is_grouped() -> None:
    rows = [row(f"kd:leaf_size={n}") for n in range(5)]
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
    several = "kd:leaf_size=0, kd:leaf_size=1, kd:leaf_size=2 and 2 more"
    assert f"needs 1.5 GB <span class=note>({several}; numbers of kd:leaf_size=0, the others have their own)" in part
    assert part.count("the others have their own") == 1, "equal reasons have equal numbers"


def test_tables_that_scroll_say_so() -> None:
    text = page.as_html(document([row("a"), row("b")]))
    assert text.count('class="wide"') >= 1
    assert 'class="scrolls" hidden' in text
    assert "ResizeObserver" in text

# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown: a time never without its error, and no ranking that noise cannot carry."""

from __future__ import annotations

import copy
import csv
import io
import json
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from report_rows import ROW, document, everything, pictured, row

from addon.core.measure import ranking, thesis
from addon.core.report import charts, costs, ksweep, page, plots, report, tables


def test_a_row_that_is_wrong_shows_where() -> None:
    (cell,) = (cell for cell in page._cells(row("kd", wrong_values=3), [], set()) if cell.at == "errors/wrong_values")
    assert cell.text == "3"


def test_rows_on_other_numbers_of_threads_are_told_apart_and_not_ranked() -> None:
    rows = [{**row("embree"), "threads": 1}, row("a", 4.0), row("b", 2.0), {**row("c", 8.0), "threads": 2}]
    assert "threads: 1 and 2 (Embree: 1);" in report.heading("room", rows)
    assert "threads: 1;" in report.heading("room", rows[:3])
    text = said(*rows)
    assert "a is the fastest, 2.00 times b" in text
    assert "The times of c are not comparable with theirs." in text
    base, *others = everything("kd", 1.0), everything("bsp-wn", 2.0), {**everything("bsp-wn", 2.0), "threads": 2}
    assert [thesis.percent(one, base) is None for one in others] == [False, True]


def test_a_failed_row_shows_its_error() -> None:
    failed = {**copy.deepcopy(ROW), "rays": None, "errors": None, "build_s": None, "bytes": None, "error": "too large"}
    assert "too large" in page.as_html(document([failed, row("brute")]))


def test_csv_has_one_column_per_number() -> None:
    (line,) = csv.DictReader(io.StringIO(report.as_csv([row("kd")])))
    assert line["rays.primary.mrays_s.med"] == "2.0"
    assert line["errors.on_boundary"] == "3"
    assert line["left_out"] == "oblique planes: <none>"


def said(*rows: dict[str, Any]) -> str:
    return " ".join(report.findings(list(rows)))


def test_what_noise_cannot_separate_is_not_ranked() -> None:
    assert "a is the fastest, 2.00 times b" in said(row("a", 4.0), row("b", 2.0))
    # Faster in every round, but by less than the noise of the machine.
    close = row("a", 2.01), row("b", 2.0)
    for one in close:
        one["rays"]["primary"]["noise"] = 0.02
    assert "a and b are equal within noise" in said(*close)
    # Far apart by the medians, but not in every round.
    torn = row("a", 4.0), row("b", 2.0)
    torn[0]["rays"]["primary"]["rounds"][2] = 1.0
    assert "a and b are equal within noise" in said(*torn)


def test_a_drifting_machine_does_not_hide_an_order_that_holds_in_every_round() -> None:
    drift = row("a"), row("b")
    for one, faster in zip(drift, (1.1, 1.0), strict=True):
        one["rays"]["primary"]["rounds"] = [faster * speed for speed in (4.0, 3.5, 3.0, 2.5, 2.0, 1.5, 1.0)]
    assert "a is the fastest, 1.10 times b" in said(*drift)


def test_too_few_rounds_rank_nothing() -> None:
    few = row("a", 4.0), row("b", 2.0)
    for one in few:
        for key in ("rounds", "anchor_rounds"):
            one["rays"]["primary"][key] = one["rays"]["primary"][key][:3]
    assert "3 rounds are too few for a ranking" in said(*few)


def test_rows_of_different_rounds_are_compared_through_their_anchor() -> None:
    # The second was measured while the machine was twice as slow, and so was its anchor.
    slow = row("b", 1.6, 0.01)
    slow["round_id"] = "2"
    slow["rays"]["primary"]["anchor_rounds"] = [2.0] * 7
    assert "b is the fastest, 1.60 times a" in said(row("a", 2.0, 0.01), slow)
    overlapping = row("b", 2.1, 0.3)
    overlapping["round_id"] = "2"
    assert "are equal within noise" in said(row("a", 2.0), overlapping)


def test_many_rows_are_not_compared_with_each_other() -> None:
    compared: list[Any] = []

    class Told(dict[str, Any]):
        __hash__ = None  # type: ignore[assignment]

        def __eq__(self, other: object) -> bool:
            compared.append(other)
            return super().__eq__(other)

    many = [Told(row(f"kd:leaf_size={n}")) for n in range(200)]
    for n, each in enumerate(many):
        each |= {"anchor": None, "round_id": str(n // 100)}
        each["rays"]["primary"]["anchor_rounds"] = []
    found = ranking.rank(many, "primary")
    assert compared == []
    assert found is not None
    assert [found.best, *found.equal] == many[:100]
    assert found.apart == many[100:]


def test_wrong_answers_are_said_first() -> None:
    sentences = report.findings([row("a"), row("b", wrong_triangle=1)])
    assert sentences[0] == "Answers that differ from the reference, and are therefore not ranked: b."
    text = page.as_html(document([row("a"), row("b", wrong_triangle=1)]))
    assert text.count('<tr class="wrong"') == 1


def test_what_answers_wrongly_is_never_the_fastest() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.5), everything("kd:robust=none", 0.1)]
    for one, seconds in zip(rows, (3.0, 2.0, 0.1), strict=True):
        pictured(one, seconds)
    rows[2]["errors"]["wrong_triangle"] = 1000
    sentences = report.findings(rows)
    assert "robust=none" in sentences[0]
    assert not [text for text in sentences[1:] if "robust=none" in text]
    assert "kd is the fastest, 1.50 times bsp-wn" in " ".join(sentences)
    assert tables.best(rows, ["primary"]) == {(id(rows[0]), "primary")}
    # Neither what it is compared with nor the best of a structure.
    rows[0]["errors"]["false_miss"] = 1
    assert report.worth_it(rows) == []


def test_the_tables_of_the_thesis_hold_only_what_answers_rightly() -> None:
    rows = [everything("kd-sah", 1.0), everything("kd:traversal=dir", 1.0)]
    rows += [everything(f"bsp-wn:k={k},seed={s}", k * s, k) for k in (2, 3) for s in (1.0, 1.5, 4.0)]
    rows[2]["errors"]["wrong_triangle"] = 1
    _, (line,) = ksweep.lines(rows)
    assert line.low == pytest.approx((300.0, 300.0))
    by_k, _ = thesis.tables({"room": rows}, None)
    assert by_k.lines[0][1][0][0] == pytest.approx((300.0, 550.0, 800.0))
    rows[0]["errors"]["false_hit"] = 1
    assert ksweep.lines(rows)[0] == "kd:traversal=dir"


def test_the_page_is_one_file_and_escapes_what_it_shows() -> None:
    text = page.as_html(document([row("kd"), row("kd-sah")]))
    assert "room &lt;1&gt;" in text
    assert "P &amp; Q" in text
    assert "room <1>" not in text
    for outside in ("src=", "<link", "@import", "url(http"):
        assert outside not in text


@pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))
def test_the_plots_are_svg_with_a_mark_for_each_structure() -> None:
    rows = [everything("kd", 1.0), everything("kd-sah", 1.5), everything("brute", 1000.0)]
    rows += [everything(f"bsp-wn:k={k},seed={seed}", 2.0 + k / 10, k) for k in (2, 3) for seed in (1, 2)]
    found = plots.scene_figures(rows, thesis.Published())
    assert [picture.title for picture in found] == [
        "Error of pictures against run time",
        "Other errors of pictures",
        "Speed",
        "Build against tracing",
        "How many directions",
        "Time against the number of rays",
        "What each pixel costs",
        "Wrong answers far from the origin",
        "Fitted costs",
    ]
    for picture in found:
        texts = " ".join(ET.fromstring(picture.svg).itertext())
        assert "bsp-wn" in texts
        assert "Too slow to be drawn in scale: brute" in picture.caption or picture.title not in (
            "Speed",
            "Fitted costs",
        )


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

    rows = [everything("kd", 1.0), everything("kd-sah", 1.5)]
    links = Links()
    links.feed(page.as_html(document(rows)))
    assert len(links.targets) > 2 * 10
    assert {target.removeprefix("#") for target in links.targets} <= links.places
    assert "/rows/1/rays/primary/mrays_s/med" in links.places
    # Too many rows to hold them all: then the numbers lead to the file.
    many = Links()
    many.feed(page.as_html(document([row(f"kd:leaf_size={n}") for n in range(page.MOST_ROWS_INSIDE + 1)])))
    assert all(target.startswith("bench.json#/rows/") for target in many.targets)


def test_k_sweeps_take_medians_over_seeds_and_published_ones_beside() -> None:
    rows = [everything("kd-sah", 1.0)]
    rows += [everything(f"bsp-wn:k={k},seed={s}", k * s, k) for k in (2, 3) for s in (1.0, 1.5, 4.0)]
    base, (line,) = ksweep.lines(rows)
    assert (base, line.structure, line.k) == ("kd-sah", "bsp-wn", (2, 3))
    assert line.median == pytest.approx((300.0, 450.0))
    assert line.low == pytest.approx((200.0, 300.0))
    assert line.high == pytest.approx((800.0, 1200.0))


def test_what_many_rows_leave_out_names_a_few_of_them() -> None:
    text = page.as_html(document([row(f"kd:leaf_size={n}") for n in range(12)]))
    assert "kd:leaf_size=2 and 9 more)" in text


def test_times_of_a_k_sweep_are_related_to_the_base_in_the_same_rounds() -> None:
    base = {**everything("kd-sah", 1.0), "anchor": "kd-sah"}
    rows = [base, *(everything(f"bsp-wn:k={k}", 1.0, k) for k in (2, 3))]
    for one in rows:
        one["anchor"] = "kd-sah"
        for rates in one["rays"].values():
            if rates["rounds"]:
                rates["anchor_rounds"] = list(base["rays"]["primary"]["rounds"])
    # The machine was three times as slow when the last was measured, and so was the base beside it.
    for key in ("rounds", "anchor_rounds"):
        rows[2]["rays"]["primary"][key] = [rate / 3 for rate in rows[2]["rays"]["primary"][key]]
    assert ksweep.lines(rows)[1][0].median == pytest.approx((100.0, 100.0))
    # What was timed beside something else cannot be related.
    rows[2]["anchor"] = "embree"
    assert thesis.percent(rows[2], base) is None


def without_anchor(spec: str, speed: float, round_id: str) -> dict[str, Any]:
    made = {**row(spec, speed, 0.01), "anchor": None, "round_id": round_id}
    made["rays"]["primary"]["anchor_rounds"] = []
    return made


def test_times_of_different_machines_without_an_anchor_are_not_divided() -> None:
    base, beside = (without_anchor(spec, speed, "1") for spec, speed in (("kd-sah", 2.0), ("b", 1.0)))
    elsewhere = {**without_anchor("c", 8.0, "2"), "machine": "another"}
    assert thesis.percent(beside, base) == pytest.approx(200.0), "of the same rounds"
    assert thesis.percent(elsewhere, base) is None
    assert not ranking.faster(elsewhere, base, "primary")
    with pytest.raises(ValueError, match="c and kd-sah are not comparable"):
        ranking.against(elsewhere, base, "primary")
    words = said(base, beside, elsewhere)
    assert "kd-sah is the fastest, 2.00 times b" in words
    assert "The times of c are not comparable with theirs" in words
    # Timed beside two different anchors.
    one, other = row("one", 2.0), {**row("other", 8.0), "anchor": "kd", "round_id": "2"}
    assert thesis.percent(other, one) is None
    assert "is the fastest" not in said(one, other)


def test_first_pictures_of_different_machines_are_not_divided() -> None:
    rows = [row("kd"), row("kd:lazy=1")]
    for one, seconds in zip(rows, (2.0, 1.0), strict=True):
        one["first_s"] = dict.fromkeys(("min", "med", "max"), seconds)
    assert "1.0 s with kd:lazy=1, 0.50 of the 2.0 s with kd" in said(*rows)
    rows[1]["machine"] = "another"
    assert "Build and camera rays" not in said(*rows)


def test_builds_of_different_machines_are_not_divided() -> None:
    rows = [everything("kd-sah", 1.0)] + [everything(f"bsp-wn:k={k}", k, k) for k in (2, 3)]
    for one in rows[1:]:
        one["machine"] = "another"
    _, comparison = thesis.tables({"room": rows}, None)
    ours = dict(comparison.lines)["bsp-wn"][0][0]
    assert ours == pytest.approx((200.0, float("nan"), 100.0), nan_ok=True)
    assert re.search(r"\bnan\b", page.as_html(document(rows))) is None


def test_published_results_are_read_and_a_wrong_file_is_told(tmp_path: Path) -> None:
    entry = {"scene": "sponza", "structure": "wn+^kd", "K": 6, "render_pct_of_kd": 80.4}
    path = tmp_path / "published.json"
    path.write_text(json.dumps({"final_by_K": [entry]}))
    found = thesis.read(path)
    assert found.medians("sponza-dabrovic", "bsp-wn-plus-kd") == {6: 80.4}
    assert found.medians("grid", "bsp-wn-plus-kd") == {}
    for wrong in ("[]", "{}", '{"final_by_K": [{}]}', "nonsense"):
        path.write_text(wrong)
        with pytest.raises(ValueError):  # noqa: PT011 (json's own error is one)
            thesis.read(path)


def test_the_tables_of_the_thesis_stand_beside_the_published_numbers(tmp_path: Path) -> None:
    spread = {"structure": "wn", "scene": "sponza", "K": 2, "min": 101.0, "med": 102.0, "max": 103.0}
    compared = {"structure": "ize", "scene": "sponza", "K": None, "tri_tests_nearest_pct_of_kd": 55.0}
    compared |= {"render_pct_of_kd": 109.0, "build_pct_of_kd": 20_000.0}
    path = tmp_path / "published.json"
    path.write_text(json.dumps({"final_by_K": [], "draft_render_time": [spread], "final_comparison": [compared]}))
    rows = [everything("kd-sah", 1.0), everything("bsp-ize", 2.0)]
    rows += [everything(f"bsp-wn:k={k},seed={s}", k * s, k) for k in (2, 3) for s in (1.0, 1.5, 4.0)]
    by_k, comparison = thesis.tables({"sponza-dabrovic": rows}, thesis.read(path))
    assert by_k.title.startswith("Table 5.4")
    (name, ((ours, theirs),)), (_, ((_, nothing),)) = by_k.lines
    assert (name, theirs, nothing) == ("K = 2", (101.0, 102.0, 103.0), ())
    assert ours == pytest.approx((200.0, 300.0, 800.0))
    lines = dict(comparison.lines)
    ((ours, theirs),) = lines["bsp-ize"]
    assert theirs == (109.0, 20_000.0, 55.0)
    assert ours == pytest.approx((200.0, 100.0, 100.0))
    # Without the published k, the fastest stands for the structure: here k = 2.
    assert lines["bsp-wn"][0][0][0] == pytest.approx(300.0)
    text = page.as_html(document([{**one, "scene": "sponza-dabrovic"} for one in rows]), thesis.read(path))
    assert "<em>20,000</em>" in text


def test_fitted_costs_draw_every_part() -> None:
    parts = np.ones((costs.LEAST_ROWS, len(costs.PARTS)))
    specs = tuple(f"s{i}" for i in range(costs.LEAST_ROWS))
    some = costs.Fit(specs, dict.fromkeys(costs.PARTS, 1.0), parts.sum(axis=1), parts, 1.0, 0.0)
    figure = Figure()
    charts.fitted_costs(figure, some)
    assert len(figure.axes[0].containers) == len(costs.PARTS)


def test_fitted_costs_are_those_that_made_the_times() -> None:
    rows = [everything(str(n), 1.0) for n in range(5)]
    for n, one in enumerate(rows):
        steps, tests = 3.0 + n, 2.0 + n * n
        nanoseconds = 7.0 * steps + 11.0 * tests
        rate = one["rays"]["primary"]
        rate.update(steps_axis=steps, tests=tests, mrays_s=dict.fromkeys(("min", "med", "max"), 1e3 / nanoseconds))
    found = costs.fit(rows)
    assert found is not None
    assert found.nanoseconds == pytest.approx(
        {"steps_axis": 7.0, "steps_oblique": 0.0, "steps_boxes": 0.0, "leaves": 0.0, "tests": 11.0}
    )
    assert found.explained == pytest.approx(1.0)
    assert costs.fit(rows[:3]) is None


def test_costs_are_never_negative() -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 2.0], [1.0, 3.0]])
    assert costs.least_squares(matrix, np.array([3.0, 2.0, 1.0])) == pytest.approx([2.0, 0.0])


def test_the_pareto_front_holds_what_nothing_beats_in_both() -> None:
    assert charts.pareto([(3, 1), (1, 3), (2, 2), (2, 3), (3, 3)]) == [(1, 3), (2, 2), (3, 1)]


@pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))
def test_an_axis_on_which_all_is_zero_is_drawn_without_a_word() -> None:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    axes.plot([1, 4], [0, 0])
    charts.logarithmic(axes)
    FigureCanvasSVG(figure).print_svg(io.BytesIO())
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")


def test_without_matplotlib_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: "matplotlib is not installed")
    text = page.as_html(document([row("kd")]))
    assert "<svg" not in text
    assert "Plots are left out: matplotlib is not installed." in text


def test_an_error_that_does_not_fall_is_not_said_to():
    def points(power: float) -> list[dict[str, float]]:
        return [{"spp": n, "rmse": n**power} for n in (1, 4, 16)]

    (falls,) = report.about_slopes(points(-0.6), points(-0.5))
    assert "falls with the samples to the power −0.60" in falls
    assert "stratified" in falls
    (rises,) = report.about_slopes(points(0.13), points(-0.43))
    assert "does not fall" in rises
    assert "stratified" not in rises
    assert not list(report.about_slopes(points(-0.6)[:2], []))

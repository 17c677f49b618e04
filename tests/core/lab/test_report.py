# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of a report and the tables of the thesis: what they show, and that medians are over seeds alone."""

from __future__ import annotations

import io
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from addon.core.measure import costmap, ranking
from addon.core.report import costs, report
from addon.lab.report import charts, field_charts, history, page, plots, thesis
from tests.report_rows import document, everything, pictured, row

DRAWN = pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))


@DRAWN
def test_the_plots_are_svg_with_a_mark_for_each_structure() -> None:
    rows = [everything("kd", 1.0), everything("kd-sah", 1.5), everything("brute", 1000.0)]
    rows += [everything(f"bsp-wn:k={k},seed={seed}", 2.0 + k / 10, k) for k in (2, 3) for seed in (1, 2)]
    found = plots.pictures(rows, thesis.Published())
    assert [picture.title for picture in found] == [
        "Error of pictures against run time",
        "Wrong answers against the time of a ray",
        "Other errors of pictures",
        "Speed",
        "Build against tracing",
        "How many directions",
        "Time against the number of rays",
        "What each pixel costs",
        "Wrong answers far from the origin",
        "Fitted costs",
    ]
    # What was not measured is said where it would stand.
    assert (found[1].svg, found[1].caption) == ("", "Left out: not measured with --only-rays, nor in two levels.")
    for picture in (one for one in found if one.svg):
        texts = " ".join(ET.fromstring(picture.svg).itertext())
        assert "bsp-wn" in texts
        assert "Too slow to be drawn in scale: brute" in picture.caption or picture.title not in (
            "Speed",
            "Fitted costs",
        )


@DRAWN
def test_at_most_eight_curves_are_coloured() -> None:
    rows = [everything(f"f{letter}-x", 1.0 + n / 10) for n, letter in enumerate("abcdefghijk")]
    first, second = (picture for picture in plots.pictures(rows) if picture.leads)
    assert second.title.startswith("Wrong answers")
    assert "relMSE" in first.svg
    for svg in (first.svg, first.narrow):
        assert "4 others" in svg
        assert len(set(re.findall(r">f[a-k]-x<", svg))) == 7
        assert "1 spp" in svg
    assert not set(re.findall(r'id="(\w+)"', first.svg)) & set(re.findall(r"url\(#(\w+)\)", first.narrow))


@DRAWN
def test_a_walk_without_bounds_is_not_drawn_among_those_with_them() -> None:
    rows = [everything("kd", 1.0), everything("octree-net", 1.0), everything("kd:robust=none", 1.0)]
    for entry in rows[2]["offsets"]:
        entry.update(wrong=50, wrong_unguarded=None)

    def drawn(*some: dict[str, Any]) -> list[str]:
        (one,) = (one for one in plots.scene_figures(some) if one.about.name == "offsets")
        return [text.strip() for text in ET.fromstring(plots.svg(one.draw, one.height)).itertext()]

    assert "with bounds: all 2" in drawn(*rows)
    assert "kd:robust=none" in drawn(*rows)
    assert not [text for text in drawn(rows[2]) if "with bounds" in text]


def test_fitted_costs_draw_every_part_of_rays_alone_and_in_groups() -> None:
    parts = np.ones((4, len(costs.PARTS)))
    parts[:, -1] = 0.0
    specs = tuple(f"s{i}" for i in range(4))
    prices, ends = dict.fromkeys(costs.PARTS, 1.0), dict.fromkeys(costs.PARTS, (0.5, 1.5))
    ends["tests"] = (-2.0, 0.5)
    some = [
        costs.Fit(rays, specs, prices, ends, parts.sum(axis=1), parts, 1.0, 0.0) for rays in (costs.ALONE, costs.GROUPS)
    ]
    figure = Figure()
    charts.fitted_costs(figure, some)
    assert [len(axes.containers) for axes in figure.axes] == [len(costs.PARTS)] * 2
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert "triangle tests: not identifiable (−2.0 to 0.5)" in labels
    assert "axis steps: 1.0 ns (0.5 to 1.5)" in labels


def test_each_cost_map_has_its_own_scale_and_a_switch_to_a_common_one() -> None:
    rows = [everything("dark", 1.0), everything("bright", 50.0)]
    dark = np.arange(200.0).reshape(10, 20)
    rows[0]["map"] = costmap.packed(dark)
    figure = Figure()
    charts.cost_maps(figure, rows)
    shown = {axes.get_title(): axes.images[0].get_array() for axes in figure.axes if axes.images}
    assert np.ptp(shown["dark\n1.99 to 197"]) > 1
    charts.cost_maps(figure := Figure(), rows, common=True)
    (dull,) = (axes.images[0].get_array() for axes in figure.axes if axes.get_title().startswith("dark"))
    assert np.ptp(dull) < 0.5
    if plots.problem() is None:
        text = page.as_html(document(rows))
        assert f"{charts.ONE_SCALE}</label>" in text
        ids = re.findall(r' id="(image\w+)"', text)
        assert len(ids) == len(set(ids))


def test_the_pareto_front_holds_what_nothing_beats_in_both() -> None:
    assert charts.pareto([(3, 1), (1, 3), (2, 2), (2, 3), (3, 3)]) == [(1, 3), (2, 2), (3, 1)]


@DRAWN
def test_an_axis_on_which_all_is_zero_is_drawn_without_a_word() -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.plot([1, 4], [0, 0])
    charts.logarithmic(axes)
    FigureCanvasSVG(figure).print_svg(io.BytesIO())
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")


@DRAWN
def test_rows_with_counted_cases_are_drawn() -> None:
    row = {"spec": "kd:traversal=ta-b", "rays": {"primary": {}, "shadow": {}}, "field": {"rays": {"primary": {}}}}
    counted = {**row, "field": {"rays": {"primary": {"cases": {"n4": 0.25, "p1": 0.75}}}}}
    assert [name for _, name in field_charts.with_cases([row, counted])] == ["primary"]  # type: ignore[list-item]
    drawn = plots.svg(lambda figure: field_charts.cases(figure, [counted]), 3.0)  # type: ignore[list-item]
    assert "kd:traversal=ta-b" in drawn
    assert "N4" in drawn


def test_the_page_has_the_plots_or_says_why_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: "matplotlib is not installed")
    text = page.as_html(document([row("kd")]))
    assert "<svg" not in text
    assert "Plots are left out: matplotlib is not installed." in text


def test_a_page_of_several_scenes_begins_with_all_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: "left out here")
    rows = [everything(spec, 1.0) | {"scene": scene} for scene in ("room <1>", "other") for spec in ("a", "b")]
    for one, seconds in zip(rows, (5.0, 10.0, 10.0, 5.0), strict=True):
        pictured(one, seconds)
    text = page.as_html(document(rows))
    head = text[: text.index("<section")]
    assert '<a href="#scene-1">room &lt;1&gt;</a>: a is the quickest' in head
    assert '<a href="#scene-2">other</a>: b is the quickest' in head
    assert "#scene-1" not in page.as_html(document(rows[:2]))


def swept(*configurations: tuple[str, float]) -> list[dict[str, Any]]:
    """A kd-tree, and each of these configurations (with how slow it is) with two k and two seeds."""
    rows = [everything("kd-sah", 1.0)]
    for spec, slowness in configurations:
        for k in (3, 4):
            rows += [everything(f"{spec}k={k},seed={seed}", slowness, k) for seed in (1, 2)]
    return rows


def test_configurations_of_one_structure_are_not_taken_for_seeds() -> None:
    rows = swept(("bsp-wn:alpha=0.1,", 2.0), ("bsp-wn:alpha=1,", 4.0), ("bsp-cn:alpha=1,", 3.0))
    _, lines = thesis.sweeps(rows)
    assert {line.label: line.median for line in lines} == {
        "bsp-wn:alpha=0.1": pytest.approx((200.0, 200.0)),
        "bsp-wn:alpha=1": pytest.approx((400.0, 400.0)),
        "bsp-cn": pytest.approx((300.0, 300.0)),
    }
    *by_k, comparison = thesis.tables({"room": rows}, None)
    assert [table.title for table in by_k] == [
        "Table 5.4: time of bsp-wn:alpha=0.1 by K",
        "Table 5.4: time of bsp-wn:alpha=1 by K",
        "Table 5.7: time of bsp-cn by K",
    ]
    times = {name: cells[0][0][0] for name, cells in comparison.lines}
    assert times == pytest.approx({"kd-sah": 100, "bsp-wn:alpha=0.1": 200, "bsp-wn:alpha=1": 400, "bsp-cn": 300})


def test_configurations_are_called_by_what_they_have_otherwise() -> None:
    rows = swept(("bsp-wn:alpha=0.1,costs=thesis,", 2.0), ("bsp-wn:costs=thesis,", 3.0), ("bsp-cn:costs=thesis,", 4.0))
    assert [line.label for line in thesis.sweeps(rows)[1]] == ["bsp-wn:alpha=0.1", "bsp-wn", "bsp-cn"]


@DRAWN
def test_many_lines_leave_room_for_the_plot() -> None:
    def height(count: int) -> float:
        rows = swept(*((f"bsp-wn:alpha={number},", 2.0) for number in range(count)))
        (picture,) = (one for one in plots.scene_figures(rows) if one.about.title == "How many directions")
        return picture.height

    assert height(40) > height(2) + 1


def test_k_sweeps_take_medians_over_seeds_and_published_ones_beside() -> None:
    rows = [everything("kd-sah", 1.0)]
    rows += [everything(f"bsp-wn:k={k},seed={s}", k * s, k) for k in (2, 3) for s in (1.0, 1.5, 4.0)]
    base, (line,) = thesis.sweeps(rows)
    assert (base, line.structure, line.k) == ("kd-sah", "bsp-wn", (2, 3))
    assert line.median == pytest.approx((300.0, 450.0))
    assert line.low == pytest.approx((200.0, 300.0))
    assert line.high == pytest.approx((800.0, 1200.0))


def test_times_of_a_k_sweep_are_related_to_the_base_in_the_same_rounds() -> None:
    base = {**everything("kd-sah", 1.0), "anchor": "kd-sah"}
    rows = [base, *(everything(f"bsp-wn:k={k}", 1.0, k) for k in (2, 3))]
    for one in rows:
        one["anchor"] = "kd-sah"
        for rates in one["rays"].values():
            if rates["rounds"]:
                rates["anchor_rounds"] = list(base["rays"]["primary"]["rounds"])
    # The machine was three times as slow when the last was measured, and so was the base next to it.
    for key in ("rounds", "anchor_rounds"):
        rows[2]["rays"]["primary"][key] = [rate / 3 for rate in rows[2]["rays"]["primary"][key]]
    assert thesis.sweeps(rows)[1][0].median == pytest.approx((100.0, 100.0))
    # What was timed next to something else cannot be related.
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
    words = " ".join(report.findings([base, beside, elsewhere]))
    assert "kd-sah is the fastest, 2.00 times b" in words
    assert "The times of c are not comparable with theirs" in words
    # Timed next to two different anchors.
    one, other = row("one", 2.0), {**row("other", 8.0), "anchor": "kd", "round_id": "2"}
    assert thesis.percent(other, one) is None
    assert "is the fastest" not in " ".join(report.findings([one, other]))
    # Nor are those on another number of threads.
    base, *others = everything("kd", 1.0), everything("bsp-wn", 2.0), {**everything("bsp-wn", 2.0), "threads": 2}
    assert [thesis.percent(one, base) is None for one in others] == [False, True]


def test_builds_of_different_machines_are_not_divided() -> None:
    rows = [everything("kd-sah", 1.0)] + [everything(f"bsp-wn:k={k}", k, k) for k in (2, 3)]
    for one in rows[1:]:
        one["machine"] = "another"
    _, comparison = thesis.tables({"room": rows}, None)
    ours = dict(comparison.lines)["bsp-wn"][0][0]
    assert ours == pytest.approx((200.0, float("nan"), 100.0), nan_ok=True)
    assert re.search(r"\bnan\b", page.as_html(document(rows))) is None


def test_the_tables_of_the_thesis_hold_only_what_answers_rightly() -> None:
    rows = [everything("kd-sah", 1.0), everything("kd:traversal=dir", 1.0)]
    rows += [everything(f"bsp-wn:k={k},seed={s}", k * s, k) for k in (2, 3) for s in (1.0, 1.5, 4.0)]
    rows[2]["errors"]["wrong_triangle"] = 1
    _, (line,) = thesis.sweeps(rows)
    assert line.low == pytest.approx((300.0, 300.0))
    by_k, _ = thesis.tables({"room": rows}, None)
    assert by_k.lines[0][1][0][0] == pytest.approx((300.0, 550.0, 800.0))
    rows[0]["errors"]["false_hit"] = 1
    assert thesis.sweeps(rows)[0] == "kd:traversal=dir"


def test_published_results_are_read_and_a_wrong_file_is_told(tmp_path: Path) -> None:
    entry = {"scene": "sponza", "structure": "wn+^kd", "K": 6, "render_pct_of_kd": 80.4}
    path = tmp_path / "published.json"
    path.write_text(json.dumps({"final_by_K": [entry]}))
    found = thesis.read(path)
    assert found.by_k("sponza-dabrovic", "bsp-wn-plus-kd") == {6: 80.4}
    assert found.by_k("grid", "bsp-wn-plus-kd") == {}
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


MACHINE = {"processor": "P", "level": "avx2", "name": "here"}


def test_a_history_has_the_ratios_of_right_answers(tmp_path: Path) -> None:
    rows = [row("kd"), row("bvh-sah", false_hit=1), row("embree"), {**row("bih"), "anchor": None}]
    rows[0]["rays"]["primary"]["rounds"] = [1.0, 2.0, 4.0] * 2 + [2.0]
    (line,) = history.lines(rows, "a" * 40, MACHINE, (64, 64))
    assert line["ratios"] == {"kd": {"primary": [0.25, 0.5, 1.0]}}
    assert (line["scene"], line["commit"]) == ("room <1>", "a" * 40)
    path = tmp_path / "speed.jsonl"
    for commit in ("a", "b"):
        history.append(path, history.lines(rows, commit * 40, MACHINE, (64, 64)))
    assert [one["commit"][0] for one in history.read(path)] == ["a", "b"]
    for wrong in ("{}", "[]", "nonsense", json.dumps({**line, "ratios": {"kd": {"primary": [0.0, 0.5]}}})):
        path.write_text(f"{json.dumps(line)}\n{wrong}\n")
        with pytest.raises(history.HistoryError, match="line 2 is no line of speeds"):
            history.read(path)


@DRAWN
def test_the_page_of_a_history_has_a_picture_for_each_machine() -> None:
    def line(commit: str, processor: str, ratio: float) -> dict[str, Any]:
        (made,) = history.lines(
            [row("kd", 4.0 * ratio, 0.1)], commit * 40, {**MACHINE, "processor": processor}, (64, 64)
        )
        return made

    text, drawn = history.page([line("a", "P", 0.5), line("b", "P", 0.6), line("b", "P", 0.8), line("c", "Q", 0.9)])
    assert list(drawn) == ["speed-1.svg", "speed-2.svg"]
    assert "2 commits, aaaaaaaaaa to bbbbbbbbbb" in text
    assert [f"](pictures/{name})" in text for name in drawn] == [True, True]
    texts = " ".join(ET.fromstring(drawn["speed-1.svg"]).itertext())
    assert all(words in texts for words in ("aaaaaaa", "bbbbbbb", "room <1>: primary", "kd"))
    assert "ccccccc" not in texts
    figure = Figure()
    history.draw(figure, [line("a", "P", 0.5), line("b", "P", 0.6), line("b", "P", 0.8)])
    (bars,) = figure.axes[0].containers
    assert bars.lines[0].get_ydata() == pytest.approx([0.5, 0.7], rel=0.01), "runs of one commit are one point"

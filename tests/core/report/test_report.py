# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of a report: no time without its error, no ranking that noise cannot carry, the answer in one sentence."""

from __future__ import annotations

import copy
import csv
import io
import re
from typing import Any

import numpy as np
import pytest

from addon.core.measure import inference, ranking
from addon.core.measure.analysis import fitting
from addon.core.report import costs, report, statistics, tables
from addon.core.report.report import answer
from addon.lab.report import page
from tests.report_rows import document, everything, pictured, row


def said(*rows: dict[str, Any]) -> str:
    return " ".join(report.findings(list(rows)))


def rows_of(*seconds: float) -> list[dict[str, Any]]:
    """Rows whose pictures take about these seconds."""
    made = [everything(f"s{number}", 1.0) for number in range(len(seconds))]
    for one, each in zip(made, seconds, strict=True):
        pictured(one, each)
        one["build_s"] = dict.fromkeys(("min", "med", "max"), 0.2)
    return made


def test_a_winner_is_named_with_its_rounds_and_the_next() -> None:
    assert answer(rows_of(5.0, 10.0)) == (
        "s0 is the quickest for the build and one picture of 1024 × 1024 pixels with 16 samples: 5.2 s (build 200 ms; "
        "5.15 s to 5.25 s with 95 % confidence, 7 rounds); the next, s1, takes 1.96 times as long (95 %: 1.96 to 1.96)."
        " Up to 100 answers of each were compared: all are right."
    )


def test_a_tie_names_three_and_a_number() -> None:
    rows = rows_of(*[5.0 + 0.001 * n for n in range(18)], 10.0)
    sentence = answer(rows)
    assert sentence.startswith("18 structures (s0, s1, s2 and 15 more) cannot be told apart for the build")
    assert "a noise of 1.0 %; the next, s18, takes 1.9" in sentence
    assert answer(rows[:2]).startswith("s0 and s1 cannot be told apart")
    # No sentence lists them all.
    assert not re.search(r"(s\d+, ){4}", said(*rows))


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


def test_wrong_answers_are_part_of_the_answer() -> None:
    rows = rows_of(5.0, 10.0, 1.0)
    rows[2]["errors"]["false_miss"] = 1
    assert answer(rows).startswith("s0 is the quickest")
    assert answer(rows).endswith("s2 gave wrong ones and are not ranked.")


def test_single_rays_do_not_compete_with_the_quickest_ways() -> None:
    rows = rows_of(5.0, 10.0, 1.0, 2.0, 3.0)
    for one, table in zip(rows, ("fastest", "fastest", "single", "single", "single"), strict=True):
        one |= {"table": table, "tables": [table]}
    assert answer(rows).startswith("s0 is the quickest")


def test_rows_on_other_numbers_of_threads_are_told_apart_and_not_ranked() -> None:
    rows = [{**row("embree"), "threads": 1}, row("a", 4.0), row("b", 2.0), {**row("c", 8.0), "threads": 2}]
    assert "1 and 2 threads (Embree: 1)" in tables.measured("room", rows)[0]
    assert "1 thread." in tables.measured("room", rows[:3])[0]
    text = said(*rows)
    assert "a is the fastest, 2.00 times b" in text
    assert "The times of c are not comparable with theirs." in text


def test_csv_has_one_column_per_number() -> None:
    (line,) = csv.DictReader(io.StringIO(report.as_csv([row("kd")])))
    assert line["rays.primary.mrays_s.med"] == "2.0"
    assert line["errors.on_boundary"] == "3"
    assert line["left_out"] == "oblique planes: <none>"


def test_does_not_rank_times_that_noise_cannot_separate() -> None:
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


def test_wrong_answers_are_said_first_and_are_never_the_fastest() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.5), everything("kd:robust=none", 0.1)]
    for one, seconds in zip(rows, (3.0, 2.0, 0.1), strict=True):
        pictured(one, seconds)
    rows[2]["errors"]["wrong_triangle"] = 1000
    sentences = report.findings(rows)
    assert sentences[0] == "Answers that differ from the reference, and are therefore not ranked: kd:robust=none."
    assert not [text for text in sentences[1:] if "robust=none" in text]
    assert "kd is the fastest, 1.50 times bsp-wn" in " ".join(sentences)
    assert tables.best(rows, ["primary"]) == {(id(rows[0]), "primary")}
    # Neither what it is compared with nor the best of a structure.
    rows[0]["errors"]["false_miss"] = 1
    assert report.worth_it(rows) == []


def test_first_pictures_of_different_machines_are_not_divided() -> None:
    rows = [row("kd"), row("kd:lazy=1")]
    for one, seconds in zip(rows, (2.0, 1.0), strict=True):
        one["first_s"] = dict.fromkeys(("min", "med", "max"), seconds)
    assert "1 s with kd:lazy=1, 0.50 of the 2 s with kd" in said(*rows)
    rows[1]["machine"] = "another"
    assert "Build and camera rays" not in said(*rows)


def priced(one: dict[str, Any], steps: float, tests: float, nanoseconds: float, name: str = "primary") -> None:
    """Give a row's ray set these steps and tests and this time of a ray."""
    rate = dict(one["rays"]["primary"])
    rate.update(steps_axis=steps, tests=tests, mrays_s=dict.fromkeys(("min", "med", "max"), 1e3 / nanoseconds))
    one["rays"][name] = rate


def test_fitted_costs_are_those_that_made_the_times_of_rays_alone_and_in_groups() -> None:
    rows = [everything(str(n), 1.0) for n in range(5)]
    for n, one in enumerate(rows):
        steps, tests = 3.0 + n, 2.0 + n * n
        priced(one, steps, tests, 7.0 * steps + 11.0 * tests)
        priced(one, steps, tests, 2.0 * steps + 3.0 * tests, "diffuse")
        one["ways"] = {
            name: {"nodes": "boxes", "rays": rays} for name, rays in (("primary", "single"), ("diffuse", "packet"))
        }
    alone, groups = costs.fits(rows)
    assert (alone.rays, groups.rays) == (costs.ALONE, costs.GROUPS)
    assert alone.nanoseconds == pytest.approx({"steps_axis": 7.0, "tests": 11.0})
    assert groups.nanoseconds == pytest.approx({"steps_axis": 2.0, "tests": 3.0})
    assert alone.intervals["tests"] == pytest.approx((11.0, 11.0))
    assert alone.explained == pytest.approx(1.0)
    assert alone.told("tests") == "11.0 ns (11.0 to 11.0)"
    assert not costs.fits(rows[:3])
    # Rays of a set that was counted in another way have no part in its fit only.
    rows[0]["rays"]["diffuse"]["counts_timed_walk"] = False
    assert [fit.rays for fit in costs.fits(rows)] == [costs.ALONE, costs.GROUPS]
    assert [len(fit.specs) for fit in costs.fits(rows)] == [5, 4]


def test_costs_that_the_times_do_not_determine_are_not_identifiable() -> None:
    rows = [everything(str(n), 1.0) for n in range(6)]
    for n, one in enumerate(rows):
        priced(one, 3.0 + n, 5.0 + (n % 2), 7.0 * (3.0 + n) - 2.0 * (n % 2) + 0.1 * (-1) ** (n // 2))
    (fit,) = costs.fits(rows)
    assert fit.nanoseconds["tests"] >= 0
    assert fit.told("tests").startswith("not identifiable (")
    low, high = fit.intervals["steps_axis"]
    assert 0 < low < 7.0 < high
    (sentence,) = statistics.sentences(None, [fit])
    assert "triangle test not identifiable" in sentence
    # As many tests as steps: nothing tells them apart.
    for n, one in enumerate(rows):
        priced(one, 3.0 + n, 3.0 + n, 9.0 * (3.0 + n))
    (fit,) = costs.fits(rows)
    assert {fit.told(key) for key in fit.nanoseconds} == {"not identifiable"}


def test_intervals_contain_the_coefficients_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(400):
        matrix = rng.random((6, 2))
        low, high = fitting.intervals(matrix, matrix @ [3.0, 5.0] + rng.normal(0.0, 0.5, 6)).T
        inside += int(((low < [3.0, 5.0]) & (high > [3.0, 5.0])).sum())
    # Of 800, binomial at 95 %: five standard deviations to either side.
    assert abs(inside / 800 - inference.CONFIDENCE) < 0.04


def test_costs_are_never_negative() -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 2.0], [1.0, 3.0]])
    assert fitting.positive(matrix, np.array([3.0, 2.0, 1.0])) == pytest.approx([2.0, 0.0])
    assert np.isinf(fitting.intervals(matrix[:2], np.array([3.0, 2.0]))).all()


def test_an_error_that_does_not_fall_is_not_said_to() -> None:
    def points(power: float) -> list[dict[str, float]]:
        return [{"spp": n, "rmse": n**power} for n in (1, 4, 16)]

    (falls,) = report.about_slopes(points(-0.6), points(-0.5))
    assert "falls with the samples to the power −0.60" in falls
    assert "stratified" in falls
    (rises,) = report.about_slopes(points(0.13), points(-0.43))
    assert "does not fall" in rises
    assert "stratified" not in rises
    assert not list(report.about_slopes(points(-0.6)[:2], []))


def test_wrong_answers_on_the_moved_grids_are_told() -> None:
    rows = [everything("kd", 1.0), everything("kd-sah", 1.0)]
    assert not [text for text in report.findings(rows) if "moved away" in text]
    rows[1]["offsets"][2]["wrong"] = 3
    assert [text for text in report.findings(rows) if "moved away" in text and "kd-sah 3 of 100." in text]


def test_no_row_is_bold_where_a_faster_one_is_not() -> None:
    # b is faster than c by its median, but only c is torn: noise separates b from a, and c not.
    a, b, c = row("a", 4.0, 0.01), row("b", 3.0, 0.01), row("c", 2.0, 0.01)
    c["rays"]["primary"]["rounds"][0] = 9.0
    assert tables.best([a, b, c], ["primary"]) == {(id(a), "primary")}
    assert tables.best([a, c], ["primary"]) == {(id(a), "primary"), (id(c), "primary")}
    wrong = row("d", 9.0, false_hit=1)
    assert tables.best([a, b, wrong], ["primary"]) == {(id(a), "primary")}


def test_where_oblique_planes_pay_for_one_picture_is_said() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.0), everything("bvh-sah", 1.0)]
    for one, seconds in zip(rows, (20.0, 10.0, 5.0), strict=True):
        pictured(one, seconds)
    (sentence,) = (text for text in report.findings(rows) if "1024 × 1024" in text)
    assert "10.2 s with bsp-wn" in sentence
    assert "faster than the 20.2 s with kd." in sentence
    assert report.worth_it(rows) == [rows[0]["scene"]]
    # Whatever the tree is called; but where no plane of it is oblique, it does not count.
    rows[1]["spec"] = "beam-hh"
    assert report.worth_it(rows) == [rows[0]["scene"]]
    rows[1]["spec"], rows[1]["statistics"]["nodes_oblique"] = "bsp-wn", 0
    assert report.worth_it(rows) == []
    rows[1]["statistics"]["nodes_oblique"] = 7
    # A machine that becomes slower and slower does not hide it.
    for one, seconds in zip(rows, (20.0, 10.0, 5.0), strict=True):
        pictured(one, seconds, drift=0.5)
    assert report.worth_it(rows) == [rows[0]["scene"]]
    for one, seconds in zip(rows, (20.0, 30.0, 5.0), strict=True):
        pictured(one, seconds)
    assert report.worth_it(rows) == []
    assert "slower than the " in about_pictures(rows)
    both = [*rows, *({**copy.deepcopy(one), "scene": "other"} for one in rows)]
    for one in both[3:]:
        pictured(one, 1.0)
    text = page.as_html(document(both))
    assert "on 0 of 2 scenes;" in text
    assert "on 1 the difference is within noise: other" in text


def test_scenes_without_both_kinds_of_trees_are_not_counted() -> None:
    """Such scenes do not show where oblique planes pay."""
    rows = [everything("kd", 1.0), everything("bvh-sah", 1.0)]
    rows += [{**copy.deepcopy(one), "scene": "other"} for one in rows]
    for one in rows:
        pictured(one, 10.0)
    assert "tree with oblique planes" not in page.as_html(document(rows))
    rows.append({**everything("bsp-wn", 1.0), "scene": "other"})
    pictured(rows[-1], 5.0)
    assert "on 1 of 1 scenes where both were measured: other." in page.as_html(document(rows))


def about_pictures(rows: list[dict[str, Any]]) -> str:
    (sentence,) = (text for text in report.findings(rows) if "1024 × 1024" in text)
    return sentence


def test_oblique_planes_are_not_faster_by_less_than_noise_nor_by_luck() -> None:
    rows = [everything("kd", 1.0), *(everything(f"bsp-wn:k={k}", 1.0, k) for k in (3, 4, 5))]
    for one, seconds in zip(rows, (10.0, 9.5, 9.8, 10.4), strict=True):
        pictured(one, seconds, spread=0.08)
    assert report.worth_it(rows) == []
    assert "bsp-wn:k=3, the best of 3 trees with oblique planes; equal within noise to the" in about_pictures(rows)
    # Faster in each pair of rounds, but the machine's own noise is larger.
    for one, seconds in zip(rows, (10.0, 9.7, 9.8, 10.4), strict=True):
        pictured(one, seconds, spread=0.001)
        one["image"]["noise"] = 0.05
    assert report.worth_it(rows) == []
    # Before and behind in no round: that is luck where many were tried, and an order where one was.
    for one, seconds in zip(rows, (10.0, 9.0, 9.1, 9.2), strict=True):
        pictured(one, seconds, spread=0.08)
    assert report.worth_it(rows) == []
    assert report.worth_it(rows[:2]) == [rows[0]["scene"]]
    # Pictures that were made once rank nothing, however far apart.
    for one, seconds in zip(rows, (10.0, 1.0, 2.0, 3.0), strict=True):
        one["image_s"], one["image"] = dict.fromkeys(("min", "med", "max"), seconds), None
    assert report.worth_it(rows) == []
    assert "equal within noise" in about_pictures(rows)


def test_a_build_of_uncertain_length_decides_nothing() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.0)]
    for one, seconds in zip(rows, (1.0, 0.9), strict=True):
        pictured(one, seconds, spread=0.001)
    rows[1]["build_s"] = {"min": 0.1, "med": 0.2, "max": 0.5}
    assert report.worth_it(rows) == []
    rows[1]["build_s"] = rows[0]["build_s"] = {"min": 0.2, "med": 0.2, "max": 0.2}
    assert report.worth_it(rows) == [rows[0]["scene"]]


def test_pictures_of_different_processes_are_related_by_the_tree_beside_them() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.0)]
    pictured(rows[0], 10.0)
    # This machine is three times as slow.
    pictured(rows[1], 27.0)
    rows[1]["round_id"] = "2"
    rows[1]["image"]["anchor_rounds_s"] = [30.0] * 7
    assert report.worth_it(rows) == [rows[0]["scene"]]
    # Its seconds are more, of a slower machine: they would say the opposite.
    told = about_pictures(rows)
    assert "27.2 s with bsp-wn, the best of 1 tree with oblique planes, faster than with kd, which takes 1.1" in told
    rows[1]["image"]["samples"] = 1
    assert report.worth_it(rows) == [], "a picture of fewer samples takes more time per sample"
    rows[1]["image"]["anchor"] = None
    rows[1]["image"]["anchor_rounds_s"] = []
    pictured(rows[0], 100.0)
    assert report.worth_it(rows) == [], "nothing relates them"
    assert "with oblique planes; equal within noise to kd" in about_pictures(rows)


def test_of_builds_with_rays_noise_is_told_too() -> None:
    def told(*rows: dict[str, Any]) -> str:
        return next(text for text in report.findings(list(rows)) if "the build and one million rays" in text)

    apart = row("a", 4.0), row("b", 2.0)
    for one in apart:
        one["build_s"] = dict.fromkeys(("min", "med", "max"), 0.01)
    assert "a is the quickest for the build and one million rays of each set: 260 ms (build 10 ms; " in told(*apart)
    # Later the machine was four times as fast: the second's seconds are fewer, but it is the slower one.
    later = {**row("b", 8.0), "round_id": "2"}
    later["build_s"] = apart[0]["build_s"]
    later["rays"]["primary"]["anchor_rounds"] = [16.0] * 7
    assert "; the next, b, takes 2.08 times as long" in told(apart[0], later)
    assert "a and b cannot be told apart" in told(row("a", 2.02), row("b", 2.0))

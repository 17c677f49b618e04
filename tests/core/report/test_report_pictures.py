# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report says of whole pictures: where oblique planes pay, and what noise leaves open."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from report_rows import document, everything, pictured, row

from addon.core.report import page, report


def test_where_oblique_planes_pay_for_one_picture_is_said() -> None:
    rows = [everything("kd", 1.0), everything("bsp-wn", 1.0), everything("bvh-sah", 1.0)]
    for one, seconds in zip(rows, (20.0, 10.0, 5.0), strict=True):
        pictured(one, seconds)
    (sentence,) = (text for text in report.findings(rows) if "1024 × 1024" in text)
    assert "10.2 s with bsp-wn" in sentence
    assert "faster than the 20.2 s with kd; bvh-sah is the best of all with 5.2 s" in sentence
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
    """Of such scenes nobody knows where oblique planes pay."""
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
    for one in rows:
        one["image_s"] = one["image_s"]["med"]
    assert report.image_total(rows[1]) == pytest.approx(1.2), "as in reports of earlier versions"


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
    about = "build and one million rays of each set together"

    def told(*rows: dict[str, Any]) -> str:
        return next(text for text in report.findings(list(rows)) if about in text)

    apart = row("a", 4.0), row("b", 2.0)
    for one in apart:
        one["build_s"] = dict.fromkeys(("min", "med", "max"), 0.01)
    assert "260 ms with a (build 10 ms) and 510 ms with b (build 10 ms), the next" in told(*apart)
    # Later the machine was four times as fast: the second's seconds are fewer, but it is the slower one.
    later = {**row("b", 8.0), "round_id": "2"}
    later["build_s"] = apart[0]["build_s"]
    later["rays"]["primary"]["anchor_rounds"] = [16.0] * 7
    assert "260 ms with a (build 10 ms) and 2.08 times as long with b, the next" in told(apart[0], later)
    assert "equal within noise to those with b" in told(row("a", 2.02), row("b", 2.0))
    few = row("a", 4.0), row("b", 2.0)
    for one in few:
        for key in ("rounds", "anchor_rounds"):
            one["rays"]["primary"][key] = one["rays"]["primary"][key][:3]
    assert "the best median of 3 rounds" in told(*few)

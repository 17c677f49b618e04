# SPDX-License-Identifier: GPL-3.0-or-later
"""Reported wrong answers of other ray tracers: every structure answers their scenes as exact arithmetic does."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.lab.commands import reported
from addon.lab.reported import answers, judge, meshes, table
from addon.lab.reported.reports import REPORTS, Report, Scene

REBUILT = [report for report in REPORTS if report.rebuild is not None]


@cache
def scene_of(report: Report) -> Scene:
    assert report.rebuild is not None
    return report.rebuild()


@cache
def exact_of(report: Report) -> list[judge.Exact | None]:
    scene = scene_of(report)
    return judge.nearest(scene.vertices, scene.triangles, scene.origins, scene.directions)


@pytest.mark.parametrize("report", REBUILT, ids=[report.name for report in REBUILT])
def test_every_structure_answers_exactly(report: Report) -> None:
    scene = scene_of(report)
    exact = exact_of(report)
    # The rebuilt scene is one where the report expects what exact arithmetic finds.
    hits = [one is not None for one in exact]
    assert {"hit": all(hits), "miss": not any(hits), "exact": any(hits)}[scene.truth]
    assert {name: count for name, count in answers.ours(native, scene, exact).items() if count} == {}
    # The native oracle agrees: another program for the same question.
    oracle = native.exact_closest(scene.vertices, scene.triangles, scene.origins, scene.directions)
    assert answers.wrong_bits(oracle, exact) == 0
    # All structures agree in the barycentric coordinates too.
    rays = scene.origins, scene.directions
    brute, *others = (
        native.build(scene.vertices, scene.triangles, spec).closest(*rays) for spec in ("brute", "kd", "bvh-sah")
    )
    assert all(np.array_equal(brute.u, one.u) and np.array_equal(brute.v, one.v) for one in others)


def test_reports_have_a_scene_or_a_reason() -> None:
    assert all((report.rebuild is None) != (report.missing == "") for report in REPORTS)
    assert len({report.name for report in REPORTS}) == len(REPORTS) >= 28
    assert len(REBUILT) >= 19


@pytest.mark.parametrize("spec", ["bvh-sah:robust=none", "kd:traversal=ta-a,robust=none"])
def test_the_scenes_show_faults_of_published_traversals(spec: str) -> None:
    wrong = 0
    for report in REBUILT:
        scene = scene_of(report)
        built = native.build(scene.vertices, scene.triangles, spec)
        wrong += answers.wrong_bits(built.closest(scene.origins, scene.directions), exact_of(report))
    assert wrong > 0


def test_the_judge_knows_edges_planes_and_ties() -> None:
    corners = judge.integers(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32))

    def distance(origin: list[float], direction: list[float]) -> Fraction | None:
        start, way = judge.integers(np.array([origin, direction], np.float32))
        return judge.distance(corners, start, way)

    assert distance([0.25, 0.25, 3], [0, 0, -2]) == Fraction(3, 2)
    assert distance([0.5, 0.5, 3], [0, 0, -2]) == Fraction(3, 2), "on an edge"
    assert distance([0.5, np.nextafter(np.float32(0.5), np.float32(1)), 3], [0, 0, -2]) is None
    assert distance([0.25, 0.25, 3], [0, 0, 2]) == Fraction(-3, 2), "behind the origin"
    assert distance([-1, 0.25, 0], [1, 0, 0]) is None, "in the plane"
    twice = np.array([[0, 1, 2], [2, 1, 0]], np.int32)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    (found,) = judge.nearest(
        points, twice[::-1], np.array([[0.2, 0.2, 1]], np.float32), np.array([[0, 0, -1]], np.float32)
    )
    assert found == judge.Exact(np.float32(1), 0)


@pytest.mark.parametrize("steps", [0, 1, -1])
def test_the_judge_rounds_once(steps: int) -> None:
    # Halfway between two floats, and next to it by less than float64 can represent.
    middle = 1 + Fraction(3, 2**24) + steps * Fraction(1, 2**80)
    assert judge.rounded(middle) == np.float32(1 + (2 if steps >= 0 else 1) * 2**-23)


def test_pbrts_random_numbers() -> None:
    # The first numbers of PCG32 are published with seed 42 and stream 54 (pcg-random.org); pbrt starts elsewhere.
    random = meshes.Pcg32(54)
    random._state, random._step = 0, 54 << 1 | 1
    random.integer()
    random._state = (random._state + 42) & random.MASK
    random.integer()
    assert [random.integer() for _ in range(3)] == [0xA15C02B7, 0x7B47F409, 0xBA1D3330]


def wrong(t: list[float], exact: list[judge.Exact | None]) -> int:
    return answers.wrong_distances(np.array(t, np.float32), exact)


def test_misses_hits_and_distances_of_others_are_counted() -> None:
    hit = judge.Exact(np.float32(2), 0)
    assert wrong([2, np.inf], [hit, None]) == 0
    assert wrong([2.0005, 2.1, np.inf], [hit] * 3) == 2
    assert wrong([5], [None]) == 1


def test_the_document_has_the_table() -> None:
    page = reported.PAGE.read_text(encoding="utf-8")
    shown = page.partition(table.BEGIN)[2].partition(table.END)[0].strip().splitlines()
    # Names, faults and numbers of rays; other tracers may be of another version or missing here.
    rows = [table.Row(one, None if one.rebuild is None else len(scene_of(one).origins)) for one in REPORTS]
    made = table.lines(rows)
    assert [line.split(" | ")[:3] for line in shown] == [line.split(" | ")[:3] for line in made]
    assert {line.split(" | ")[-1] for line in shown[2:] if line.startswith("|")} == {"0 |"}, "ours are all right"


def test_the_command_writes_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{table.BEGIN}\nold\n{table.END}\nafter\n", encoding="utf-8")
    monkeypatch.setattr(reported, "PAGE", page)
    monkeypatch.setattr(table, "REPORTS", REBUILT[:1])

    def lost(scene: Scene) -> Any:
        return np.full(len(scene.origins), np.inf, np.float32)

    monkeypatch.setattr(answers, "others", lambda: ({"BVHTree": lost}, ["embreex is not here"]))
    assert reported.main(["--write"]) == 0
    said = capsys.readouterr().out
    assert "not measured: embreex is not here" in said
    written = page.read_text(encoding="utf-8")
    assert "| 14 | not measured | not measured | 14 | 0 |" in written
    assert written.startswith("before\n")
    assert written.endswith("after\n")
    assert "old" not in written
    page.write_text("no marks", encoding="utf-8")
    assert reported.main(["--write"]) == 2
    assert "expected <!-- table of reports: begin -->" in capsys.readouterr().err

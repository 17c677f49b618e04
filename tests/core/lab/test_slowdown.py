# SPDX-License-Identifier: GPL-3.0-or-later
"""Slowdown by offset, scale and shape: right answers take no more work far from the origin, and no check is blind."""

from __future__ import annotations

import csv
import json
import types
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.lab.commands import stability as command
from addon.lab.stability import slowdown, slowdown_page, stability
from tests.lying_native import LIES, LyingNative

RINGS, RAYS, COPIES = 12, 100, 40


def small_cases() -> list[slowdown.Case]:
    return list(slowdown.cases(RINGS, RAYS, COPIES, 7))


def configurations() -> list[str]:
    rows = halfspace_native.structures()
    specs = stability.configurations(rows, [row["id"] for row in rows if row["id"] != "brute"])
    return [spec for spec in specs if not stability.allowed_to_fail(spec)]


def test_the_sphere_is_closed() -> None:
    vertices, triangles = slowdown.sphere(RINGS)
    assert len(triangles) == 4 * RINGS * (RINGS - 1)
    assert np.allclose(np.linalg.norm(vertices, axis=1), 1)
    edges = np.sort(np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()


def test_a_twin_has_the_same_triangles() -> None:
    for case in small_cases():
        if case.group == "offset":
            moved = case.scene.vertices.astype(np.float64) - case.twin.vertices
            assert (moved == moved[0]).all(), case.name
            assert np.isclose(np.abs(moved).max(), 2 * case.at * np.abs(slowdown.DIRECTION).max(), atol=1)
        if case.group == "scale":
            assert (case.scene.vertices == case.twin.vertices * np.float32(2.0 ** round(case.at * np.log2(10)))).all()
        assert set(case.scene.rays) == set(case.twin.rays)
        for name, (_, directions) in case.scene.rays.items():
            assert (directions == case.twin.rays[name][1]).all()


def test_no_structure_slows_down_far_from_the_origin() -> None:
    kernels = configurations()
    trees = [spec for spec in kernels if ":" not in spec]
    assert len(kernels) > 3 * len(trees) > 100
    for case in small_cases():
        specs = kernels if case.at in slowdown.LIMITS else trees
        rows = list(slowdown.measure(halfspace_native, case, specs, repeats=0))
        assert [row["spec"] for row in rows if row["wrong"]] == [], case.name
        assert [(row["spec"], row["work"]) for row in rows if slowdown.slowed(row)] == [], case.name
        assert all(row["tests"] > 0 for row in rows), case.name


class Slow:
    """A structure that returns the right answers, and counts ten times the tests far from the origin."""

    def __init__(self, structure: Any, factor: int) -> None:
        self.structure, self.factor = structure, factor

    def closest(self, *rays: Any, **options: Any) -> Any:
        hits = self.structure.closest(*rays, **options)
        if hits.counters is None:
            return hits
        counters = {**hits.counters, "tests": hits.counters["tests"] * self.factor}
        return types.SimpleNamespace(counters=counters)

    def occluded(self, *rays: Any, **options: Any) -> Any:
        return self.structure.occluded(*rays, **options)


class SlowNative:
    """The native module, but structures are slow far from the origin."""

    def __getattr__(self, name: str) -> Any:
        return getattr(halfspace_native, name)

    def build(self, vertices: Any, triangles: Any, spec: str, **options: Any) -> Slow:
        factor = 10 if np.abs(vertices).max() > 1000 else 1
        return Slow(halfspace_native.build(vertices, triangles, spec, **options), factor)


def test_slow_structures_are_noticed() -> None:
    for case in small_cases():
        (row,) = slowdown.measure(SlowNative(), case, ["kd"], repeats=0)  # type: ignore[arg-type]
        far = case.group == "offset" and case.at >= 1e3
        assert slowdown.slowed(row) == (far or case.name == "one huge, many tiny"), case.name
        assert not row["wrong"]


@pytest.mark.parametrize("lie", LIES)
def test_wrong_answers_are_noticed(lie: str) -> None:
    case = next(case for case in small_cases() if case.at == 1e5)
    (row,) = slowdown.measure(LyingNative(lie), case, ["kd"], repeats=0)
    assert row["wrong"]


def test_the_command_writes_tables_and_plots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(slowdown.SIZES, "small", (RINGS, RAYS, COPIES))
    arguments = ["--structures", "kd:traversal=dir,shadow=none", "--slowdown", "1", "--out", str(tmp_path)]
    assert command.main(arguments) == 0
    document = json.loads((tmp_path / "slowdown.json").read_text(encoding="utf-8"))
    assert {row["group"] for row in document["rows"]} == {"offset", "scale", "shape"}
    assert len(document["rows"]) == len(small_cases())
    with (tmp_path / "slowdown.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(document["rows"])
    page = (tmp_path / "slowdown.html").read_text(encoding="utf-8")
    assert page.count("<svg") == len(slowdown_page.KINDS)
    assert "offset 100000" in page
    printed = capsys.readouterr().out
    assert "0 exceed the limits" in printed
    # A second run reuses the rows.
    monkeypatch.setattr(slowdown, "measure", None)
    assert command.main(arguments) == 0


@pytest.mark.parametrize(
    "arguments",
    [["--slowdown", "-1"], ["--copies", "5"], ["--slowdown", "1", "--leaks-only"], ["--slowdown", "1", "--long", "9"]],
)
def test_meaningless_options_are_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1

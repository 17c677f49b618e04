# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of the thesis: every row is measured next to checked answers, kept, and judged by the published number."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.base import native
from addon.core.scene import workload
from addon.lab.claims.claims import FAILS, HOLDS, UNTESTED
from addon.lab.commands import thesis as command
from addon.lab.report import thesis as published
from addon.lab.thesis import levels, measure, plan, tables
from tests.lying_native import LIES, LyingNative

SMALL = plan.Effort(((4,), (3, 5)), (1, 2), (32, 32), 1, 200)


def walls(count: int = 60) -> dict[str, Any]:
    """A scene of scattered triangles with normals that repeat, and a view of it."""
    random = np.random.default_rng(7)
    shapes = random.standard_normal((5, 3, 3))
    corners = random.random((count, 1, 3)) * 6 + shapes[np.arange(count) % 5]
    return {
        "vertices": corners.reshape(-1, 3).astype(np.float32),
        "triangles": np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        "camera_eye": np.array([-9.0, 3.0, 4.0]),
        "camera_target": np.array([3.0, 3.0, 3.0]),
        "camera_up": np.array([0.0, 0.0, 1.0]),
        "camera_vfov_deg": np.array(40.0),
    }


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of such a scene; few rows are measured."""
    monkeypatch.setattr(plan, "QUICK", SMALL)
    path = tmp_path / "walls.npz"
    np.savez(path, **walls())
    return path


def published_file(path: Path, percent: float) -> Path:
    """Published results in which each tree of the leg takes this share of the kd-tree's time."""
    entry = {"structure": "wn+^kd", "scene": "killeroo_leg", "K": 4, "render_pct_of_kd": percent}
    entry |= {"kd_nodes": 30, "bsp_nodes": 20, "tri_tests_nearest_pct_of_kd": 19.0}
    spread = {"structure": "wn+^kd", "scene": "killeroo_leg", "K": 4, "min": 1.0, "med": 2.0, "max": 3.0}
    museum = entry | {"scene": "museum"}
    content = {"final_by_K": [entry, museum], "final_comparison": [], "draft_render_time": [spread]}
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def test_all_rows_are_kept_and_not_measured_twice(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = [str(scene), "--quick", "--out", str(out)]
    assert command.main(arguments) == 0
    assert "5.6: walls: bsp-wn-plus-kd K=4: time" in capsys.readouterr().out
    document = json.loads((out / "thesis.json").read_text(encoding="utf-8"))
    assert len(document["rows"]) == len(list(plan.trees(SMALL)))
    assert {row["seed"] for row in document["rows"]} == {0, 1, 2}
    assert all(row["checked"] > 0 and row["wrong"] == 0 for row in document["rows"])
    assert document["machines"]
    page = (out / "thesis.html").read_text(encoding="utf-8")
    assert all(f"Table {number}" in page for number in ("5.1", "5.6", "5.9", "2.1"))
    # A second run takes every row from the journal, and so does one that was stopped between two rows.
    monkeypatch.setattr(measure, "row", lambda *_: pytest.fail("measured again"))
    monkeypatch.setattr(levels, "levels", lambda *_: pytest.fail("measured again"))
    before = document["rows"]
    assert command.main(arguments) == 0
    assert json.loads((out / "thesis.json").read_text(encoding="utf-8"))["rows"] == before


def test_more_seeds_measure_only_their_own_rows(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = [str(scene), "--quick", "--no-figures", "--out", str(tmp_path / "out")]
    assert command.main([*arguments, "--seeds", "1"]) == 0
    whole, seeds = measure.row, []

    def recorded(*given: Any) -> Any:
        seeds.append(given[2].seed)
        return whole(*given)

    monkeypatch.setattr(measure, "row", recorded)
    assert command.main([*arguments, "--seeds", "2"]) == 0
    assert seeds
    assert set(seeds) == {2}
    # Another size of the view measures every row again.
    seeds.clear()
    assert command.main([*arguments, "--seeds", "1", "--size", "16x24", "--repeats", "2"]) == 0
    assert 1 in seeds
    document = json.loads((tmp_path / "out" / "thesis.json").read_text(encoding="utf-8"))
    assert (document["options"]["size"], document["options"]["repeats"]) == ([16, 24], 2)


def test_a_run_that_stops_loses_no_row(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = measure.row
    measured: list[plan.Tree] = []

    def stops(*arguments: Any) -> Any:
        if len(measured) == 3:
            raise KeyboardInterrupt
        measured.append(arguments[2])
        return whole(*arguments)

    out = tmp_path / "out"
    arguments = [str(scene), "--quick", "--no-figures", "--out", str(out)]
    monkeypatch.setattr(measure, "row", stops)
    assert command.main(arguments) == 130
    again: list[plan.Tree] = []

    def recorded(*arguments: Any) -> Any:
        again.append(arguments[2])
        return whole(*arguments)

    monkeypatch.setattr(measure, "row", recorded)
    assert command.main(arguments) == 0
    assert not set(measured) & set(again)
    assert set(measured) | set(again) == set(plan.trees(SMALL))


@pytest.mark.parametrize("lie", LIES)
def test_a_wrong_answer_fails_the_run(scene: Path, monkeypatch: pytest.MonkeyPatch, lie: str) -> None:
    spec = next(tree.spec for tree in plan.trees(SMALL) if tree.structure == "bsp-wn-plus-kd")
    monkeypatch.setattr(native, "load", lambda: LyingNative(lie, spec))
    arguments = [str(scene), "--quick", "--no-figures", "--structures", "bsp-wn-plus-kd"]
    assert command.main(arguments) == 1


@pytest.mark.parametrize("effort", [plan.FULL, plan.QUICK], ids=["full", "quick"])
def test_all_trees_are_scalar_and_drawn_as_published(effort: plan.Effort) -> None:
    arrays = walls(12)
    for tree in {tree.structure + str(tree.k): tree for tree in plan.trees(effort)}.values():
        structure = halfspace_native.build(arrays["vertices"], arrays["triangles"], tree.spec)
        assert ("leaves=scalar" in structure.spec) == (tree.structure != "bvh-embree")
        drawn = tree.structure.startswith(("bsp-wn", "bsp-cn")) and (tree.k != 3 or not tree.structure.count("-plus"))
        assert ("draw=thesis" in structure.spec) == drawn, structure.spec
    ks = {tree.k for tree in plan.trees(plan.FULL) if tree.structure == "bsp-wn"}
    assert ks == set(range(2, 11))
    assert {tree.seed for tree in plan.trees(plan.FULL)} == set(range(8))


def row(time: float, nodes: int, seed: int = 1) -> dict[str, Any]:
    """A measured row of wn+^Kd on the leg."""
    numbers = dict.fromkeys(("nearest", "any", "steps", "axis_steps", "leaf_max", "references", "wrong"), 1)
    own = {"model": "killeroo-feet", "structure": "bsp-wn-plus-kd", "k": 4, "seed": seed, "time": time, "nodes": nodes}
    return numbers | own | {"nodes_axis": nodes // 4, "nodes_oblique": nodes // 4}


@pytest.mark.parametrize(
    ("time", "nodes", "verdicts"),
    [
        (72.0, 101, (HOLDS, HOLDS)),
        (72.2 + tables.NOISE, 102, (FAILS, HOLDS)),
        (30.0, 103, (HOLDS, FAILS)),
        (30.0, 99, (HOLDS, FAILS)),
    ],
)
def test_lines_are_judged_by_the_published_numbers(
    tmp_path: Path, time: float, nodes: int, verdicts: tuple[str, str]
) -> None:
    known = published.read(published_file(tmp_path / "results.json", 72.0))
    (line,) = tables.lines([row(time, nodes), row(1.0, 1, 2), row(1000.0, 9999, 3)], known)
    assert (line.verdict, line.nodes) == verdicts
    assert line.ours["time"] == (1.0, time, 1000.0)
    assert (line.theirs["nodes"], line.times, line.table) == (101, (1.0, 2.0, 3.0), "5.6")
    assert "tests of nearest hits, % of kd: 1 (19)" in line.why
    (unknown,) = tables.lines([row(time, nodes)], published.Published())
    assert (unknown.verdict, unknown.nodes) == (UNTESTED, UNTESTED)
    # On another model than the thesis's only times are judged.
    other = replace(known, medians={("bsp-wn-plus-kd", "conference", 4): {"time": 72.0, "nodes": 101}})
    (there,) = tables.lines([row(30.0, 1) | {"model": "conference as published"}], other)
    assert (there.verdict, there.nodes) == (HOLDS, UNTESTED)


def test_planes_are_counted_by_level() -> None:
    arrays = walls()
    scene = workload.Workload(
        "walls", arrays["vertices"], arrays["triangles"], workload.framing_view(arrays["vertices"], arrays["triangles"])
    )
    found = {}
    for kind, (spec, k) in command.FIGURES.items():
        structure = halfspace_native.build(scene.vertices, scene.triangles, spec)
        found[kind] = levels.levels(structure, scene, kind, k)
        statistics = structure.statistics
        inner = statistics["nodes_axis"] + statistics["nodes_oblique"]
        assert sum(level.nodes for level in found[kind]) == inner
        # The root tries planes of all triangles.
        tried = {"kd": 3, "ize": 5}.get(kind, k)
        assert found[kind][0].planes == 2 * tried * len(scene.triangles)
        assert all(a.distinct <= b.distinct for a, b in zip(found[kind], found[kind][1:], strict=False))
    planes = sum(level.planes for level in found["random"])
    assert found["random"][-1].distinct == planes
    # The normals of five shapes are soon drawn again.
    drawn = found["wn"]
    assert 0 < drawn[-1].distinct < 0.8 * sum(level.planes for level in drawn)
    heights = [np.unique(scene.vertices[scene.triangles][..., axis].min(axis=1)).size for axis in range(3)]
    assert max(heights) <= found["kd"][-1].distinct <= 6 * len(scene.triangles)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--structures", "bsp-wn,oak"], "unknown structure 'oak'"),
        (["no-such-scene"], "there is no such scene"),
        (["--published", "missing.json"], "--published: missing.json"),
        (["--seeds", "0"], "--seeds: expected 1 to 100, got 0"),
        (["--size", "64"], "--size: expected WIDTHxHEIGHT up to 16384, got '64'"),
        (["--size", "64x0"], "--size: expected WIDTHxHEIGHT up to 16384, got '64x0'"),
        (["--repeats", "0"], "--repeats: expected 1 to 1000, got 0"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main(arguments) == 2
    assert message in capsys.readouterr().err

# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: in parts, on a cluster, killed and resumed; the rows are those of one uninterrupted run but for times."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.measure import benchmark
from addon.core.scene import workload
from addon.lab.bench import cluster, sweep
from addon.lab.commands import bench
from addon.lab.report import thesis
from tests.sweep_runs import OPTIONS, table


def test_parts_merge_to_the_whole(scenes: list[str], tmp_path: Path, whole: list[Any], capsys: Any) -> None:
    folders = [str(tmp_path / "together"), str(tmp_path / "together"), str(tmp_path / "elsewhere")]
    for number, folder in enumerate(folders, 1):
        assert bench.main([*scenes, *OPTIONS, "--shard", f"{number}/3", "--out", folder]) == 0
        assert not (Path(folder) / "report.html").exists(), "the report is of the whole"
    out = tmp_path / "merged"
    assert bench.main([*folders[1:], "--merge", "--out", str(out)]) == 0
    assert table(out) == whole
    # The same command line without a part finds the rows of its folder, and measures the others.
    capsys.readouterr()
    assert bench.main([*scenes, *OPTIONS, "--out", folders[0]]) == 0
    assert "rows exist already" in capsys.readouterr().out
    assert table(Path(folders[0])) == whole


def test_merging_rows_that_disagree_is_status_1(scenes: list[str], tmp_path: Path, capsys: Any) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    quick = [scenes[0], *OPTIONS, "--structures", "kd", "--curve", "none"]
    assert bench.main([*quick, "--out", str(first)]) == 0
    second.mkdir()
    text = (first / "rows.jsonl").read_text(encoding="utf-8")
    (second / "rows.jsonl").write_text(text.replace('"references": ', '"references": 1'), encoding="utf-8")
    capsys.readouterr()
    assert bench.main([str(first), str(second), "--merge", "--out", str(tmp_path / "out")]) == 1
    assert "soup-1, kd: measured twice" in capsys.readouterr().err


def test_a_slow_structure_measured_with_less_is_merged_with_the_others(scenes: list[str], tmp_path: Path) -> None:
    """About the same rays, compared with the same reference: fewer repeats, no pictures, not all sets."""
    first, second, later, out = (tmp_path / name for name in ("first", "second", "later", "out"))
    quick = [scenes[0], *OPTIONS, "--structures"]
    assert bench.main([*quick, "kd", "--curve", "1", "--out", str(first)]) == 0
    less = ["--repeats", "1", "--check-rays", "64", "--rays", "primary"]
    assert bench.main([*quick, "brute", *less, "--out", str(second)]) == 0
    assert merged([first, second], out)[0] == 0
    assert {row["structure"] for row in table(out)} == {"kd", "brute"}
    # Two such runs may share a folder too.
    assert bench.main([*quick, "kd", "--out", str(later)]) == 0
    assert bench.main([*quick, "brute", *less, "--out", str(later)]) == 0
    assert merged([later], out)[0] == 0


def test_rows_of_runs_with_other_rays_are_not_merged(scenes: list[str], tmp_path: Path, capsys: Any) -> None:
    """Nothing would tell which row is about which."""
    quick = [*OPTIONS, "--structures", "kd", "--curve", "none", "--out"]
    first, second, third = (str(tmp_path / name) for name in ("first", "second", "third"))
    assert bench.main([scenes[0], *quick, first]) == 0
    assert bench.main([scenes[0], *quick, second, "--ray-seed", "9"]) == 0
    assert bench.main([scenes[1], *quick, third, "--ray-seed", "9"]) == 0
    capsys.readouterr()
    assert bench.main([first, second, "--merge", "--out", str(tmp_path / "out")]) == 2
    assert "soup-1: its rows belong to runs with different --ray-seed;" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    smaller = Path(scenes[0]).with_name("other") / Path(scenes[0]).name
    smaller.parent.mkdir()
    with np.load(scenes[0]) as file:
        np.savez(smaller, **{**file, "triangles": file["triangles"][1:]})
    assert bench.main([str(smaller), *quick, second]) == 0
    (tmp_path / "fourth").mkdir()
    lines = (Path(second) / "rows.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "fourth" / "rows.jsonl").write_text("".join(lines[-3:]), encoding="utf-8")
    capsys.readouterr()
    assert bench.main([first, str(tmp_path / "fourth"), "--merge", "--out", str(tmp_path / "out")]) == 2
    assert "soup-1: its rows are of different scenes, of 299 and 300 triangles" in capsys.readouterr().err
    # Of different scenes nothing is set side by side.
    assert bench.main([first, third, "--merge", "--out", str(tmp_path / "out")]) == 0


SWEPT = ["kd-sah:traversal=dir", "bsp-wn:k=3,traversal=dir", "bsp-wn:k=4,traversal=dir"]
"""A sweep over k, whose rows are related to the first."""


def test_a_row_of_a_cluster_has_the_anchor_of_the_whole_sweep(scenes: list[str]) -> None:
    base = benchmark.anchor_of(SWEPT)
    assert base == SWEPT[0]
    options = benchmark.Options(size=(16, 16), sets=("primary",), repeats=2, check_rays=64)
    loaded = workload.load_npz(Path(scenes[0]))
    found = [cluster._row(loaded, spec, base, options)[0] for spec in SWEPT]
    assert [row["anchor"] for row in found] == [base] * 3
    for row in found:
        assert len(row["rays"]["primary"]["anchor_rounds"]) == 2
        assert thesis.percent(row, found[0]) is not None
    assert len({row["round_id"] for row in found}) == 3


def test_rows_of_a_resumed_sweep_and_of_its_parts_have_one_anchor(scenes: list[str], tmp_path: Path) -> None:
    quick = [scenes[0], *OPTIONS, "--structures", ",".join(SWEPT), "--rays", "primary"]
    for part in ("1/2", "2/2"):
        assert bench.main([*quick, "--shard", part, "--out", str(tmp_path / "parts")]) == 0
    assert bench.main([*quick, "--out", str(tmp_path / "out")]) == 0
    journal = tmp_path / "out" / "rows.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if f'"spec": "{SWEPT[-1]}"' not in line]
    assert len(kept) == len(lines) - 1
    journal.write_text("".join(kept), encoding="utf-8")
    for folder in ("parts", "out"):
        assert bench.main([*quick, "--out", str(tmp_path / folder)]) == 0
        found = json.loads((tmp_path / folder / "bench.json").read_text(encoding="utf-8"))["rows"]
        assert [row["anchor"] for row in found if row["spec"] != "embree"] == [SWEPT[0]] * 3


def merged(folders: list[Path], out: Path) -> tuple[int, Any]:
    """The status of a merge, and what it wrote."""
    status = bench.main([*map(str, folders), "--merge", "--out", str(out)])
    return status, json.loads((out / "bench.json").read_text(encoding="utf-8"))


def test_merging_a_part_alone_names_what_is_missing_and_is_status_2(
    scenes: list[str], tmp_path: Path, capsys: Any
) -> None:
    quick = [*scenes, *OPTIONS, "--structures", "kd,kd-sah,bih"]
    first, second = (tmp_path / name for name in ("first", "second"))
    assert bench.main([*quick, "--shard", "1/2", "--out", str(first)]) == 0
    capsys.readouterr()
    status, document = merged([first], tmp_path / "half")
    said = capsys.readouterr().err
    assert status == 2
    assert "bench: soup-1: missing " in said
    assert "bench: soup-2: missing " in said
    assert document["missing"]
    assert "missing" in (tmp_path / "half" / "report.html").read_text(encoding="utf-8")
    lost = [spec for spec in ("kd", "kd-sah", "bih") if spec not in {row["spec"] for row in document["rows"][:3]}]
    assert all(spec in said for spec in lost)
    # The second part ends before it comes to the second scene.
    assert bench.main([*quick, "--shard", "2/2", "--out", str(second)]) == 0
    journal = second / "rows-2-of-2.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    journal.write_text("".join(line for line in lines if "soup-2" not in line or '"asked"' in line), encoding="utf-8")
    assert merged([first, second], tmp_path / "most")[0] == 2
    said = capsys.readouterr().err
    assert "bench: soup-2: missing " in said
    assert "soup-1" not in said
    journal.write_text("".join(lines), encoding="utf-8")
    status, document = merged([first, second], tmp_path / "whole")
    assert (status, "missing" in document) == (0, False)
    assert capsys.readouterr().err == ""


def test_a_scene_that_was_never_begun_is_missing(scenes: list[str], tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out"
    assert bench.main([*scenes, *OPTIONS, "--structures", "kd", "--out", str(out)]) == 0
    journal = out / "rows.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    journal.write_text("".join(line for line in lines if "soup-2" not in line or '"asked"' in line), encoding="utf-8")
    capsys.readouterr()
    assert merged([out], tmp_path / "merged")[0] == 2
    assert "bench: soup-2: missing all of " in capsys.readouterr().err


@pytest.mark.parametrize(("gigabytes", "failing"), [("0.00006", "kd"), ("0.00001", "")], ids=["a row", "a scene"])
def test_merging_failures_keeps_them_until_they_are_mended(
    scenes: list[str], tmp_path: Path, gigabytes: str, failing: str
) -> None:
    out, broken = tmp_path / "out", tmp_path / "broken.npz"
    broken.write_bytes(b"no scene")
    part = [scenes[0], str(broken), *OPTIONS, "--structures", "kd", "--out", str(out), "--shard"]
    for number in ("1/2", "2/2"):
        assert bench.main([*part, number, "--memory-limit", gigabytes]) == 2
    status, document = merged([out], tmp_path / "failed")
    assert status == 2
    errors = {(row["scene"], row["spec"]): row["error"] for row in document["rows"] if row["error"]}
    assert "memory_limit" in errors["soup-1", failing]
    # Of a row that failed it is known what became of it, but not of the others of a scene that failed.
    assert ("missing" in document) == (failing == "")
    assert "cannot be read" in errors[str(broken), ""]
    assert "memory_limit" in (tmp_path / "failed" / "report.html").read_text(encoding="utf-8")
    # What is mended is no failure any more, though the journal still tells of it.
    broken.write_bytes(Path(scenes[1]).read_bytes())
    for number in ("1/2", "2/2"):
        assert bench.main([*part, number]) == 0
    status, document = merged([out], tmp_path / "mended")
    assert status == 0
    assert not any(row["error"] for row in document["rows"])


def test_a_journal_that_holds_nothing_is_no_report(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "rows.jsonl").write_text("", encoding="utf-8")
    assert bench.main([str(tmp_path), "--merge", "--out", str(tmp_path / "nothing")]) == 2
    assert "no rows" in capsys.readouterr().err


def without(journal: Path, *path: str) -> None:
    """Take a column away from all rows of a journal. path: keys, the last that of the column."""
    lines = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    for line in lines:
        inner = line.get("row", {})
        for key in path[:-1]:
            inner = inner.get(key, {})
        inner.pop(path[-1], None)
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")


@pytest.mark.parametrize(
    "path",
    [("errors",), ("spec",), ("machine",), ("rays", "primary", "steps"), ("errors", "t_ulp_max"), ("left_out",)],
    ids=".".join,
)
def test_rows_of_another_version_are_told_by_a_merge_and_measured_again_by_a_run(
    scenes: list[str], tmp_path: Path, capsys: Any, path: tuple[str, ...]
) -> None:
    first, second, out = (tmp_path / name for name in ("first", "second", "merged"))
    quick = [*scenes, *OPTIONS, "--structures", "kd", "--curve", "none"]
    for number, folder in (("1/2", first), ("2/2", second)):
        assert bench.main([*quick, "--shard", number, "--out", str(folder)]) == 0
    without(second / "rows-2-of-2.jsonl", *path)
    for folders in ([first, second], [second, first]):
        capsys.readouterr()
        assert bench.main([*map(str, folders), "--merge", "--out", str(out)]) == 2
        told = capsys.readouterr().err
        assert told.startswith(f"bench: --merge: {second}: the row of soup-")
        assert f"{', '.join(path)!r}" in told
        assert told.count("\n") == 1
    assert not out.exists()
    for _ in range(2):  # what was measured again is not measured again
        assert bench.main([*quick, "--shard", "2/2", "--out", str(second)]) == 0
    counted = [json.loads(line) for line in (second / "rows-2-of-2.jsonl").read_text(encoding="utf-8").splitlines()]
    keys = [line["key"] for line in counted if "key" in line]
    assert len(keys) == 2 * len(set(keys))
    assert merged([first, second], out)[0] == 0


@pytest.mark.parametrize("arguments", [[], ["nowhere"], ["nowhere", "--out", "out"]])
def test_merging_nothing_is_one_line(arguments: list[str], tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    assert bench.main([*arguments, "--merge"]) == 2
    assert "--merge" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_many_missing_rows_are_not_looked_for_in_a_list() -> None:
    chosen = [f"kd:leaf_size={n}" for n in range(100_000)]
    asked: list[str] = []
    # Most of a minute, if each were compared with all.
    own = sweep.Sweep(chosen, benchmark.Options(), [], scenes=["little"])
    scene = workload.Workload(
        "little",
        np.eye(3, dtype=np.float32),
        np.array([[0, 1, 2]], np.int32),
        workload.View(np.zeros(3), np.ones(3), np.array([0.0, 0.0, 1.0]), 45.0),
    )
    assert own.run(0, scene, lambda _, wanted, __: iter(asked.extend(wanted) or ()), print) == []
    assert asked == chosen

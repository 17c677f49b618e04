# SPDX-License-Identifier: GPL-3.0-or-later
"""All command lines alike: whatever is wrong with one is said in one line, before any work, with status 2."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.base import native
from addon.core.choose import auto
from addon.core.report import results
from addon.core.scene import workload
from addon.lab.commands import claims, inspector
from tests.commands import COMMANDS
from tests.one_line import told

HUGE = "99999999999"


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("arguments", [["--no-such-option"], ["--out"], ["--threads", "x", "--triangles", "x"]])
def test_bad_usage_is_one_line(name: str, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert told(COMMANDS[name], arguments, capsys).startswith(f"{name}: ")


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("bench", ["grid", "--check-rays", HUGE], "--check-rays: expected 1 to "),
        ("bench", ["grid", "--ray-seed", "4294967295"], "--ray-seed: expected 0 to "),
        ("bench", ["grid", "--curve", "1,16777216"], "--curve: expected numbers of samples up to 1048576"),
        ("bench", ["grid", "--alpha", "much"], "--alpha: expected a number or a range"),
        ("bench", ["grid", "--seeds", "1-9999999"], "--seeds: the range '1-9999999' has more than "),
        ("bench", ["folder", "--merge", "--out", "new", "--shard", "1/2"], "--shard: expected no --merge"),
        ("bench", ["folder", "--merge", "--out", "new", "--structures", "kd"], "--structures: expected no --merge"),
        ("bench", ["folder", "--merge", "--out", "new", "--only-rays"], "--only-rays: expected no --merge"),
        ("choose", ["grid.npz", "--samples", "-5"], "--samples: expected 1 to "),
        ("choose", ["grid.npz", "--pixels", "0"], "--pixels: expected 1 to "),
        ("choose", ["grid.npz", "--threads", "5000"], "--threads: expected 0 to 1024"),
        ("compare", ["--slope"], "--slope: expected --scene"),
        ("compare", ["--plant", "0.1"], "--plant: expected --scene"),
        ("compare", ["--scene", "all", "--plant", "2"], "--plant: expected a share"),
        ("compare", ["some.blend", "--scene", "all"], "not both"),
        ("compare", ["--threads", "-1"], "--threads: expected 0 to 1024"),
        ("compare", ["--threads", "2000"], "--threads: expected 0 to 1024"),
        ("compare", ["--samples", HUGE], "--samples: expected 1 to "),
        ("compare", ["--size", "99999999x8"], "--size: expected WIDTHxHEIGHT"),
        ("extraction", ["--triangles", "1"], "--triangles: expected 2 to "),
        ("overlay_picture", ["--size", "0x0"], "--size: expected WIDTHxHEIGHT"),
        ("overlay_picture", ["--depth", HUGE], "--depth: expected FIRST-LAST"),
        ("overlay_picture", ["--least", HUGE], "--least: expected a number"),
        ("overlay_picture", ["--show", "leaves"], "--show: expected planes"),
        ("overlay_picture", ["--out", "o.txt"], "expected a name that ends in .png"),
        ("pictures", ["--width", "0"], "--width: expected 64 to "),
        ("inspector", ["grid", "--width", "0"], "--width: expected 8 to "),
        ("inspector", ["grid", "--structures", ""], "--structures: expected a value, got ''"),
        ("bench", ["grid", "--structures", ""], "--structures: expected a value, got ''"),
        ("bench", ["grid", "--structures", " , "], "no structure is named"),
        ("bench", ["grid", "--structures="], "--structures: expected a value, got ''"),
        ("bench", ["grid", "--rays", " "], "--rays: expected a value, got ' '"),
        ("bench", ["grid", "--k", ""], "--k: expected a value, got ''"),
        ("bench", [""], "SCENE: expected a value, got ''"),
        ("stability", ["--structures", ""], "--structures: expected a value, got ''"),
        ("export", ["grid", "--structure", "", "--out", "a.npz"], "--structure: expected a value, got ''"),
        ("inspector", ["grid", "--structures", "kd,tree"], "unknown structure 'tree'"),
        ("inspector", ["grid", "--structures", "kd,bhv-sah"], "; did you mean bvh-sah?\n"),
        ("export", ["grid", "--structure", "kdd", "--out", "a.npz"], "; did you mean kd?\n"),
        ("export", ["grid", "--structure", "kd:max_dept=3", "--out", "a.npz"], "; did you mean max_depth?\n"),
        ("inspector", ["grid", "--structures", "kd,bih:leaf_size=0"], "bih:leaf_size=0: "),
        ("animations", ["--window", ""], "--window: expected a value, got ''"),
        ("render", ["--samples", HUGE], "--samples: expected 1 to "),
        ("render", ["--percentage", HUGE], "--percentage: expected 1 to "),
        ("render", ["--percentage", "0"], "--percentage: expected 1 to "),
        ("render", ["--out", "picture.txt"], "expected a name that ends in .exr or .png"),
        ("stability", ["--long", "0"], "--long: expected a number above 0"),
        ("stability", ["--long", "1e30"], "--long: expected a number above 0, up to "),
        ("stability", ["--seconds", "5"], "--seconds: expected --long"),
        ("stability", ["--long", "1", "--seconds", "nan"], "--seconds: expected a number of at least 0"),
        ("stability", ["--rays", "5"], "--rays: expected --scenes"),
        ("stability", ["--scenes", "grid", "--rays", "0"], "--rays: expected 1 to "),
        ("stability", ["--leaks-only", "--leak-rays", "0"], "--leak-rays: expected 1 to "),
        ("stability", ["--leaks-only", "--leak-rays", HUGE + "99"], "--leak-rays: expected 1 to "),
        ("stability", ["--leaks-only", "--out", "folder"], "--out: expected no --leaks-only"),
        ("stability", ["--leaks-only", "--size", "large", "--structures", "brute"], "no rays leave closed surfaces"),
        ("stability", ["--long", "1", "--leak-rays", "5"], "--leak-rays: expected no --long"),
        ("stability", ["--long", "1", "--leaks-only"], "--leaks-only: expected no --long"),
        ("stability", ["--long", "1", "--scenes", "grid"], "--scenes: expected no --long"),
        ("stability", ["--scenes", "grid", "--size", "large"], "--size: expected no --scenes"),
        ("stability", ["--threads", "100000"], "--threads: expected 0 to 1024"),
        ("stability", ["--seed", "-1"], "--seed: expected 0 to "),
        ("stability", ["--long", "1", "--structures", "kd:robust=none"], "nothing to compare with brute force"),
        ("stability", ["--long", "1", "--structures", "brute:shadow=none"], "nothing to compare with brute force"),
        ("stability", ["--scenes", "grid", "--structures", "brute"], "nothing to compare with brute force"),
        ("stability", ["--leaks-only", "--structures", "kd:robust=none"], "nothing to compare with brute force"),
    ],
)
def test_rejects_wrong_command_lines_in_one_line(
    name: str, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in told(COMMANDS[name], arguments, capsys)


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in ("choose", "extraction", "reported")])
@pytest.mark.parametrize("text", ["", " "])
def test_nothing_is_written_to_a_place_without_a_name(name: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(COMMANDS[name], ["--out", text], capsys) == f"{name}: argument --out: expected a name, got {text!r}\n"


@pytest.mark.parametrize("name", ["render", "overlay_picture", "inspector"])
def test_a_folder_is_no_picture(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "picture.png").mkdir()
    assert "it is a folder" in told(COMMANDS[name], ["--out", str(tmp_path / "picture.png")], capsys)


@pytest.mark.parametrize(
    ("name", "arguments", "choices"),
    [
        ("bench", [], "grid, showcase or a file ending in .npz .blend"),
        ("choose", [], "grid, showcase or a file ending in .npz .blend"),
        ("inspector", [], "grid, showcase or a file ending in .npz .blend"),
        ("compare", [], "grid, showcase or a file ending in .npz .blend"),
        ("overlay_picture", [], "grid, showcase or a file ending in .npz .blend"),
        ("render", [], "grid, showcase or a file ending in .npz .blend"),
        ("stability", ["--structures", "kd", "--scenes"], "grid, showcase or a file ending in .npz .blend"),
    ],
)
def test_a_scene_that_is_not_there_is_told_with_all_choices(
    name: str,
    arguments: list[str],
    choices: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    (tmp_path / "attic.npz").touch()
    for scene in ("oak", "oak.npz", "scene.xyz", "open file"):
        said = told(COMMANDS[name], [*arguments, scene], capsys)
        assert f"{name}: {scene}: " in said
        assert f"expected {choices}" in said
        assert said.endswith(f"or one of {tmp_path}: attic\n")


BENCH = ["--structures", "kd", "--size", "8x8", "--repeats", "1", "--only-rays", "--curve", "none"]
AGREE = ["--structures", "bih:shadow=none", "--rays", "64", "--scenes"]
"""The quickest runs of two commands."""

VIEW: dict[str, Any] = {
    "camera_eye": np.full(3, 5.0),
    "camera_target": np.zeros(3),
    "camera_up": np.array([0.0, 0.0, 1.0]),
    "camera_vfov_deg": np.float64(40.0),
}


@pytest.mark.parametrize(
    ("triangles", "words"),
    [
        ([[0, 1, 2]], ""),
        ([[0, 1, 3], [0, 1, 1]], "2 of 2 triangles are left out: 2 without area"),
        (
            [[0, 1, 2], [0, 1, 3], [0, 1, 4]],
            "2 of 3 triangles are left out: 1 with coordinates that are not finite and 1 without area",
        ),
    ],
)
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("bench", BENCH),
        ("choose", ["--pixels", "64"]),
        ("stability", AGREE),
    ],
)
def test_triangles_that_are_left_out_are_told(
    name: str,
    arguments: list[str],
    triangles: list[list[int]],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "hut.npz"
    corners = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 2, 0], [np.nan, 0, 0]], np.float32)
    np.savez(path, vertices=corners, triangles=np.array(triangles), **VIEW)
    assert COMMANDS[name].main([*arguments, str(path)]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if "left out: " in line and "triangles" in line]
    assert len(told) == bool(words)
    assert not words or told[0].endswith(words)


def test_the_page_of_an_alias_is_that_of_its_structure(tmp_path: Path) -> None:
    path = tmp_path / "hut.npz"
    np.savez(path, vertices=np.eye(3, dtype=np.float32), triangles=np.array([[0, 1, 2]]), **VIEW)
    page = tmp_path / "page.html"
    assert inspector.main([str(path), "--structures", "skd", "--width", "8", "--out", str(page)]) == 0
    assert '"spec":"bih"' in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(("name", "arguments"), [("choose", ["hut"]), ("claims", ["beams-flat-line", "--quick"])])
def test_a_build_without_room_is_one_line(
    name: str, arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def crowded(*_: object, **__: object) -> None:
        raise MemoryError("memory_limit: the build needs more than the 1 MB it may take")

    np.savez(tmp_path / "hut.npz", vertices=np.eye(3, dtype=np.float32), triangles=np.array([[0, 1, 2]]), **VIEW)
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    monkeypatch.setattr(auto, "choose", crowded)
    monkeypatch.setattr(claims.claims, "measure", crowded)
    assert "memory_limit: the build needs more" in told(COMMANDS[name], arguments, capsys)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("bench", ["grid", "--structures", "kd"]),
        ("stability", ["--structures", "kd", "--long", "1"]),
        ("claims", ["beams-flat-line"]),
    ],
)
def test_a_journal_that_cannot_be_read_is_one_line(
    name: str, arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / results.JOURNAL).mkdir()
    words = f"{tmp_path / results.JOURNAL}: cannot be read: "
    assert words in told(COMMANDS[name], [*arguments, "--out", str(tmp_path)], capsys)
    if name == "bench":
        assert words in told(COMMANDS["bench"], [str(tmp_path), "--merge", "--out", str(tmp_path / "new")], capsys)


PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 1
3 0 1 2
"""


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".npz"])
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("bench", BENCH),
        ("choose", ["--pixels", "64"]),
        ("render", ["--percentage", "1", "--samples", "1", "--out", "OUT/a.png"]),
        ("stability", [*AGREE[:-1], "--out", "OUT", "--scenes"]),
        ("export", ["--out", "OUT/a.npz"]),
    ],
)
def test_all_commands_read_the_same_files(
    name: str, arguments: list[str], suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Without Blender, as where only the package is installed.
    monkeypatch.setitem(sys.modules, "bpy", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda *_: None)
    path = tmp_path / f"hut{suffix}"
    if suffix == ".npz":
        np.savez(path, vertices=np.eye(3, dtype=np.float32), triangles=np.array([[0, 1, 2]]), **VIEW)
    else:
        path.write_text(PLY if suffix == ".ply" else "v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n", encoding="utf-8")
    assert COMMANDS[name].main([*(word.replace("OUT", str(tmp_path)) for word in arguments), str(path)]) == 0


@pytest.mark.skipif(sys.platform != "linux", reason="other systems allow only names in Unicode")
@pytest.mark.parametrize(
    ("name", "arguments", "written"),
    [
        ("bench", [*BENCH, "--out", "OUT"], "report.html"),
        ("stability", [*AGREE[:-1], "--out", "OUT", "--scenes"], "stability.html"),
        ("inspector", ["--structures", "kd", "--width", "8", "--out", "OUT/page.html"], "page.html"),
        ("export", ["--out", "OUT/a.npz"], "a.npz"),
    ],
)
def test_a_name_in_no_encoding_reaches_the_report(
    name: str, arguments: list[str], written: str, tmp_path: Path
) -> None:
    path = tmp_path / os.fsdecode(b"\xff=hut.npz")
    np.savez(path, vertices=np.eye(3, dtype=np.float32), triangles=np.array([[0, 1, 2]]), **VIEW)
    out = tmp_path / "out"
    assert COMMANDS[name].main([*(word.replace("OUT", str(out)) for word in arguments), str(path)]) == 0
    assert (out / written).is_file()
    if written.endswith(".html"):
        assert "=hut" in (out / written).read_text(encoding="utf-8")


def test_everything_that_ends_a_build_is_told() -> None:
    import halfspace_native

    endings = (native.NativeError, halfspace_native.SpecError, workload.WorkloadError, MemoryError, RuntimeError)
    assert all(issubclass(ending, native.FAILURES) for ending in endings)

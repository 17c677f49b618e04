# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark of the scene open in Blender: the same rows as of its file from outside, but for times."""

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

ROOT = Path(__file__).resolve().parents[3]
QUICK = ["--structures", "kd,octree-net", "--size", "32x32", "--repeats", "2", "--check-rays", "512"]
QUICK += ["--curve", "1,2", "--seconds", "2", "--only-rays"]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    from addon.core.measure import curve
    from addon.lab.commands import bench
    from addon.lab.report import plots

    monkeypatch.setattr(curve, "SIZE", 16)
    monkeypatch.setattr(plots, "problem", lambda: "left out here, to be quick")
    return bench


def drawn(folder: Path) -> list[list[int]]:
    """The sample counts whose pictures were timed, of each structure."""
    found = json.loads((folder / "bench.json").read_text(encoding="utf-8"))["rows"]
    return [[point["spp"] for point in row["curve"]] for row in found if row["spec"] != "embree"]


def table(folder: Path) -> list[dict[str, Any]]:
    from addon.core.measure import rows

    found = json.loads((folder / "bench.json").read_text(encoding="utf-8"))["rows"]
    return [rows.without_times({**row, "scene": ""}) for row in found]


def test_the_open_scene_gives_the_same_rows_as_its_file(scene: Any, tmp_path: Path, bench: Any) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.object.light_add(type="POINT", location=(2.0, -2.0, 3.0))
    bpy.ops.object.camera_add(location=(0.0, -4.0, 0.5), rotation=(1.5, 0.0, 0.0))
    bpy.context.scene.camera = bpy.context.object
    file = tmp_path / "monkey.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    assert bench.main([*QUICK, "--out", str(tmp_path / "open")]) == 0
    assert bench.main([str(file), *QUICK, "--out", str(tmp_path / "file")]) == 0
    opened, read = table(tmp_path / "open"), table(tmp_path / "file")
    specs = ["kd:traversal=dir", "kd", "kd:nodes=wide", "kd:nodes=boxes", "octree-net"]
    assert [row["spec"] for row in opened if row["spec"] != "embree"] == specs
    assert opened == read
    assert drawn(tmp_path / "open") == [[1, 2]] * len(specs)
    assert (tmp_path / "open" / "report.html").is_file()


def test_structures_are_measured_in_two_levels(scene: Any, tmp_path: Path, bench: Any) -> None:
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2)
    ball = bpy.context.object
    for number in range(3):
        item = bpy.data.objects.new("Copy", ball.data)
        item.location = (2.5 * number - 2.0, 2.0, 0.3 * number)
        scene.collection.objects.link(item)
    bpy.ops.object.camera_add(location=(0.0, -6.0, 0.5), rotation=(1.5, 0.0, 0.0))
    scene.camera = bpy.context.object
    levels = ["--layout", "two-level", "--top", "median", "--structures", "kd,bvh-sah", "--curve", "1"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "balls.blend"))
    assert bench.main([*QUICK, *levels, "--out", str(tmp_path / "kept")]) == 0
    kept = [row for row in table(tmp_path / "kept") if row["spec"] != "embree"]
    assert [row["spec"] for row in kept] == ["kd", "bvh-sah"]
    assert all(row["layout"] == "two levels, the upper one by median" for row in kept)
    assert all(row["statistics"]["instances"] == 4 for row in kept)
    assert drawn(tmp_path / "kept") == [[1], [1]]
    assert "two levels, the upper one by median" in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")

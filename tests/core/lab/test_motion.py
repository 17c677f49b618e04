# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations: their triangles, their measured frames, and the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.scene.workload import WorkloadError
from addon.lab.base.usage import UsageError
from addon.lab.commands import bench
from addon.lab.motion import animations, frames, motion


@pytest.mark.parametrize("name", animations.NAMES)
def test_animations_move_and_are_deterministic(name: str) -> None:
    animation = animations.built_in(name)
    first, again, later = animation.frame(3), animation.frame(3), animation.frame(4)
    assert first.vertices.dtype == np.float32
    assert first.triangles.dtype == np.int32
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.triangles, later.triangles)
    assert first.vertices.shape == later.vertices.shape
    assert not np.array_equal(first.vertices, later.vertices)
    assert 2_000 < len(first.triangles) < 20_000
    # Nearly all triangles can be hit: the poles of the ball are open, and no cloth is folded to a line.
    assert native.build(first.vertices, first.triangles, "brute").statistics["dropped_triangles"] == 0


def small(number: int) -> animations.Mesh:
    """Boxes whose number changes in frame 2; in frame 3 one of them is a point, in frame 4 it is not."""
    mesh = animations.instances(number, 12 if number < 2 else 10)
    if number in (1, 3):
        vertices = mesh.vertices.copy()
        vertices[:8] = 0.0
        return animations.Mesh(vertices, mesh.triangles)
    return mesh


def measured(numbers: range, specs: tuple[str, ...]) -> list[frames.Moved]:
    animation = animations.Animation("small", small, animations.built_in("instances").view)
    return list(frames.measure(native, animation, numbers, frames.methods(native, specs), size=(64, 64)))


def test_every_frame_is_compared_and_rebuilds_are_counted() -> None:
    rows = measured(range(5), ("bvh-sah", "kd"))
    ways = {(row["spec"], row["way"]) for row in rows}
    assert ways == {("bvh-sah", "refit"), ("bvh-sah", "rebuild"), ("kd", "rebuild"), ("kd:lazy=1", "lazy")}
    assert len(rows) == 5 * 4
    assert all(row["wrong"] == 0 and row["compared"] == 512 for row in rows)
    own = [row for row in rows if row["way"] == "refit"]
    assert [row["done"] for row in own] == ["built", "refitted", "rebuilt", "refitted", "refitted"]
    assert own[2]["why"] == "other triangles"
    assert motion.reasons(rows) == ["bvh-sah: rebuilt instead of refitted in 1 frames: other triangles"]
    assert own[2]["drift"] == 1.0
    assert all(row["drift"] is None for row in rows if row["way"] == "lazy")


def test_a_lazy_tree_of_normals_is_measured_beside_the_others() -> None:
    assert "bsp-wn-plus-kd" in frames.SPECS
    methods = frames.methods(native, ("bsp-wn-plus-kd",))
    assert [(one.spec, one.way) for one in methods] == [
        ("bsp-wn-plus-kd", "rebuild"),
        ("bsp-wn-plus-kd:lazy=1", "lazy"),
    ]
    rows = list(frames.measure(native, animations.built_in("wave"), range(2), methods, size=(64, 64)))
    assert all(row["wrong"] == 0 for row in rows)


def test_triangles_that_appear_are_rebuilt() -> None:
    rows = [row for row in measured(range(3, 5), ("bih",)) if row["way"] == "refit"]
    assert [row["done"] for row in rows] == ["built", "rebuilt"]
    assert rows[1]["why"] == "a triangle appeared"


def test_wrong_answers_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    # A structure that is not brought up to date answers for the frame before.
    monkeypatch.setattr(frames, "update", lambda *a: (a[2] or frames._Kept(_built(a), a[3]), "refitted", ""))
    animation = animations.built_in("wave")
    methods = [frames.Method("bih", "refit")]
    rows = list(frames.measure(native, animation, range(0, 21, 20), methods, size=(64, 64), say=said.append))
    assert rows[0]["wrong"] == 0
    assert rows[1]["wrong"] > 0
    assert any("wrong answers" in line for line in said)


def _built(arguments: Any) -> Any:
    return native.build(arguments[3].vertices, arguments[3].triangles, arguments[1].spec)


def test_the_command_writes_a_table_keys_and_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["wave", "--frames", "0-2", "--size", "64x64", "--structures", "bih,kd", "--out", str(tmp_path)]
    sweep = tmp_path / "bench.json"
    sweep.write_text("of a sweep")
    assert bench.main(asked) == 0
    assert sweep.read_text() == "of a sweep"
    printed = capsys.readouterr().out
    assert "refitted" in printed
    assert "kd:lazy=1" in printed
    assert "  ".join(motion.FITS[2:]) in printed
    document = json.loads((tmp_path / motion.NUMBERS).read_text())
    assert {row["frame"] for row in document["frames"]} == {0, 1, 2}
    assert set(document["frames"][0]) == set(frames.Moved.__annotations__)
    page = (tmp_path / motion.PAGE).read_text()
    assert "Moving scenes" in page
    assert "<svg" in page


def test_fits_are_compared_with_builds() -> None:
    rows = measured(range(2, 5), ("bih", "bvh-sah", "kd"))
    rows = [row | {"update_s": 0.25 if row["done"] == "refitted" else 1.0} for row in rows]  # type: ignore[misc]
    lines = motion.fits(rows)
    assert [line[1] for line in lines] == ["bih", "bvh-sah"]
    statistics = native.build(*(lambda mesh: (mesh.vertices, mesh.triangles))(small(2)), "bih").statistics
    size = statistics["nodes_axis"] + statistics["leaves"]
    assert lines[0] == ("small", "bih", f"{size:,}", "1000.00", "250.00", "0.25")
    assert motion.fits([row for row in rows if row["way"] != "rebuild"]) == []
    assert len(animations.built_in("cloth").frame(0).triangles) == 100_352


def test_an_animation_is_measured_once_and_its_name_is_its_own(tmp_path: Path) -> None:
    assert motion.check(["wave", "armature", "wave"]) == ["wave", "armature"]
    file = tmp_path / "wave.blend"
    file.write_bytes(b"")
    with pytest.raises(WorkloadError, match="expected different names"):
        motion.check(["wave", str(file)])


@pytest.mark.parametrize("frames_asked", ["5", "3-1", "a-b", "1-", "0-100000", "-1-4"])
def test_frames_are_checked(frames_asked: str) -> None:
    with pytest.raises(UsageError, match="--frames"):
        motion.read_frames(frames_asked)


def test_bad_command_lines_end_with_a_reason(capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.main(["--frames=9-1"]) == 2
    assert "A-B" in capsys.readouterr().err
    assert bench.main(["nowhere", "--frames=0-1"]) == 2
    assert "armature" in capsys.readouterr().err
    assert bench.main(["wave", "--frames=0-1", "--repeats=3"]) == 2
    assert "--repeats: expected no --frames" in capsys.readouterr().err

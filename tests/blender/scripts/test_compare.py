# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace compared with Cycles through the command, on a scene file small enough for a test."""

import functools
import re
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.core.measure.accuracy import Errors
from addon.core.measure.check import Check
from addon.core.scene.workload import load_npz
from addon.lab.base.usage import UsageError
from addon.lab.commands import compare
from addon.lab.pictures import large, stage, whole
from tests.blender.shapes import read, world_corners


@pytest.fixture
def court(tmp_path: Path) -> Path:
    """A floor, a wall and a roof of one box each over a camera, in y-up coordinates."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], np.int32)
    scales = np.array([[6, 0.1, 6], [0.1, 2, 4], [2, 0.1, 2]])
    places = np.array([[0, -0.1, 0], [2, 2, 0], [-1, 3, -2]])
    path = tmp_path / "court.npz"
    np.savez(
        path,
        vertices=np.concatenate([corners * s + p for s, p in zip(scales, places, strict=True)]).astype(np.float32),
        triangles=np.concatenate([box + 8 * i for i in range(3)]),
        camera_eye=np.array([-2.0, 2.0, 7.0]),
        camera_target=np.array([0.0, 1.0, 0.0]),
        camera_up=np.array([0.0, 1.0, 0.0]),
        camera_vfov_deg=np.float64(50.0),
    )
    return path


def test_a_bare_geometry_becomes_a_scene_with_the_same_triangles_and_view(court: Path) -> None:
    workload = load_npz(court)
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 100, 60
    stage.build(bpy.context.scene, workload)
    bpy.context.view_layer.update()
    arrays, notes = read()
    assert notes == []
    assert np.allclose(world_corners(arrays.geometry), workload.vertices[workload.triangles], atol=1e-6)
    assert sorted(light.kind for light in arrays.lights) == ["point", "sun"]
    assert min(arrays.world.color) > 0
    camera = bpy.context.scene.camera
    assert np.allclose(camera.matrix_world.translation, workload.view.eye)
    ahead = np.array(camera.matrix_world)[:3, :3] @ [0, 0, -1]
    wanted = workload.view.target - workload.view.eye
    assert np.allclose(ahead, wanted / np.linalg.norm(wanted), atol=1e-6)
    projection = np.array(
        camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=100, y=60, scale_x=1, scale_y=1)
    )
    assert 1 / projection[1, 1] == pytest.approx(np.tan(np.radians(25)), rel=1e-5)


def test_halfspace_and_cycles_agree(court: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = [str(court), "--size", "96x64", "--samples", "64", "--runs", "4", "--out", str(out)]
    assert compare.main(arguments) == 0
    text = capsys.readouterr().out
    assert "0.000 % of 96" in text
    ratios = [float(word) for word in text.split("red green blue: ")[1].split(";")[0].split()]
    assert ratios == pytest.approx([1, 1, 1], abs=0.02)
    assert sorted(file.name for file in out.iterdir()) == [
        "court-compared.png",
        "court-cycles.png",
        "court-halfspace.png",
    ]
    assert pictures.load(out / "court-compared.png").shape == (64, 288, 4)


def test_the_time_to_equal_error_is_measured(court: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--equal-error", "--size", "48x32", "--samples", "8", "--runs", "2", "--out", str(tmp_path / "out")]
    assert compare.main([str(court), "--lights", "sun,sky", *arguments]) == 0
    text = capsys.readouterr().out
    assert "time to equal error by the processor: whole × " in text
    assert "| court | " in text
    # Four crops of 8 × 8 pixels stand side by side, magnified 40 times, above their labels.
    crops = pictures.load(tmp_path / "out" / "court-equal.png")
    assert crops.shape[1] == 40 * (4 * 8 + 3)
    assert crops.shape[0] > 40 * 8
    # The error falls with the samples in both engines, towards pictures of equal means.
    for engine in ("HALFSPACE", "CYCLES"):
        lines = [line for line in text.splitlines() if line.lstrip().startswith(f"{engine}: ")]
        errors = [float(line.split("RMSE ")[1].split(",")[0]) for line in lines]
        assert len(errors) == 3
        assert errors[2] < 0.5 * errors[0]
    assert compare.main([str(court), "--lights", "lantern", *arguments]) == 2
    assert "'lantern'" in capsys.readouterr().err


def test_the_slope_of_a_scene_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--scene", "textures", "--slope", "--size", "24x24", "--samples", "16", "--out", str(tmp_path)]
    assert compare.main(arguments) == 0
    text = capsys.readouterr().out
    assert "textures, 24x24, 1 to 4 samples: RMSE falls with the power -0." in text
    assert "1 of 1 scenes: the error of independent samples falls as it should" in text
    with pytest.raises(UsageError, match="at least 16"):
        compare.judge_slopes(compare.read([*arguments, "--samples", "8"]))


def test_whole_renders_are_timed_beside_the_error(
    court: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [str(court), "--whole", "--size", "96x64", "--runs", "3", "--samples", "4", "--out", str(tmp_path)]
    assert compare.main(arguments) == 0
    text = capsys.readouterr().out
    # The inverse of the efficiency of each, and their ratio, have intervals.
    assert len(re.findall(r"(?:HALFSPACE|CYCLES): time to unit variance \S+ s ± \S+ %", text)) == 2
    assert re.search(r"time to unit variance × \S+ \(95 %: \S+ to \S+\)", text)
    assert "court, 96x64, 2 spp, 0 bounces, whole renders:" in text
    for words in ("HALFSPACE: ", "CYCLES: ", "Halfspace over Cycles: "):
        assert words in text
    assert re.search(r"mean ratio, red green blue: (1\.00|0\.99)", text)
    assert " rays of kd compared with brute force: no difference" in text
    assert [light.name for light in bpy.data.lights] == ["Lamp"]
    assert bpy.data.lights["Lamp"].shadow_soft_size == 0
    # No ratio is so small.
    assert compare.main([*arguments, "--most", "1e-9"]) == 1


@pytest.mark.parametrize("name", large.SCENES)
def test_scenes_of_production_size_are_timed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    # Build a hundredth of the scene.
    monkeypatch.setattr(large, "TREE", 500)
    monkeypatch.setattr(large, "build", functools.partial(large.build, detail=0.01))
    arguments = ["--whole", "--scene", name, "--size", "96x64", "--runs", "2", "--bounces", "1", "--out", str(tmp_path)]
    assert compare.main(arguments) == 0
    text = capsys.readouterr().out
    assert f"{name}, 96x64, 1 spp, 1 bounces, whole renders:" in text
    assert len(re.findall(r"s of the processor, 2 runs(?:, -?[\d,]+ MiB)?$", text, re.MULTILINE)) == 2
    assert re.search(r"Left out by Halfspace, because it does not know it:\n  nothing", text)
    shares = re.search(r"mean ratio, red green blue: (\S+) (\S+) (\S+);", text)
    assert shares is not None
    assert all(abs(float(share) - 1) < 0.05 for share in shares.groups())


def test_a_wrong_answer_in_a_timed_render_is_a_failure(
    court: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [str(court), "--whole", "--size", "96x64", "--runs", "2", "--out", str(tmp_path)]
    wrong = Check(Errors(rays=9, false_miss=1), {}, {}, {})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole, "check_rays", lambda _: wrong)
        assert compare.main(arguments) == 1
    assert "compared with brute force: WRONG: " in capsys.readouterr().out


def test_bad_input_is_said_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04")
    (tmp_path / "scene.txt").write_text("no scene")
    for arguments, words in (
        ([str(tmp_path / "none.blend")], "none.blend: cannot be read: No such file"),
        ([str(tmp_path / "broken.npz")], "cannot be read as .npz"),
        ([str(tmp_path / "scene.txt")], "expected grid, showcase or a file ending in .npz .blend"),
        (["--size", "4x4"], "--size"),
        (["--runs", "1"], "--runs: expected 2 to "),
        (["--structure", "oak"], "unknown structure 'oak'"),
        (["--whole", "--scene", "all"], "--whole: expected one scene"),
        (["--most", "0.7"], "--most: expected --whole"),
    ):
        assert compare.main([*arguments, "--out", str(tmp_path)]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1


def test_a_picture_comes_back_as_it_was_saved(tmp_path: Path) -> None:
    values = np.random.default_rng(1).integers(0, 256, (5, 7, 3)).astype(np.float32) / 255
    pictures.save(tmp_path / "values.png", values)
    assert np.abs(pictures.load(tmp_path / "values.png")[..., :3] - values).max() < 0.5 / 255

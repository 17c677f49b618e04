# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering from the command line: what is rendered, with which structure, and one line for whatever is wrong."""

import re
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render import engine
from addon.core.base import native, picture_files, resident
from addon.core.scene import workload
from addon.lab.bench import ray_files
from addon.lab.commands import render
from addon.lab.pictures import scenes
from tests.blender.shapes import cube
from tests.one_line import told

QUICK = ["--samples", "1"]


@pytest.fixture
def file(scene: Any, add: Any, tmp_path: Path) -> Path:
    """A cube and a camera in a .blend with a structure and a size of its own."""
    add("Cube", cube())
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 6))
    scene.render.resolution_x, scene.render.resolution_y = 32, 16
    scene.halfspace.structure = "bvh-sah"
    scene.halfspace.automatic = True
    path = tmp_path / "cube.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_structure_is_what_the_file_says_unless_one_is_asked_for(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.context.scene.halfspace.automatic = False
    bpy.ops.wm.save_mainfile()
    out = tmp_path / "out.png"
    assert render.main([str(file), *QUICK, "--out", str(out)]) == 0
    told = capsys.readouterr().out.strip()
    assert told.endswith(f"{out}: 32 × 16 pixels with bvh-sah, answers not compared"), "no time without the errors"
    assert ("Memory of reading, build and render at their peak: " in told) == resident.STATUS.exists()
    assert pictures.load(out).shape == (16, 32, 4)


def test_a_time_is_told_beside_the_errors(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The file's structure is chosen, and so compared."""
    out = tmp_path / "out.png"
    assert render.main([str(file), *QUICK, "--out", str(out)]) == 0
    told = capsys.readouterr().out.strip().splitlines()[-1]
    assert re.search(r": 32 × 16 pixels in [0-9.]+ s with [a-z].*, 0 of [0-9,]+ answers wrong$", told), told
    # The time of two view layers is known, but only of the last what its answers are.
    bpy.context.scene.view_layers.new("Another")
    bpy.ops.wm.save_mainfile()
    assert render.main([str(file), *QUICK, "--out", str(out)]) == 0
    told = capsys.readouterr().out.strip().splitlines()[-1]
    assert re.search(r": 32 × 16 pixels with [a-z].*, 0 of [0-9,]+ answers wrong$", told), told


def test_the_command_states_how_it_sampled(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    scene.halfspace.automatic, scene.halfspace.use_adaptive, scene.halfspace.use_denoising = False, True, True
    bpy.ops.wm.save_mainfile()
    found = []
    for options, expected in (
        ([], "at most 1 samples per pixel, noise threshold 0.01, denoised"),
        (["--exact"], "1 samples per pixel, not denoised"),
    ):
        out = tmp_path / "out.exr"
        assert render.main([str(file), *QUICK, *options, "--out", str(out)]) == 0
        assert f"Sampling: {expected}" in capsys.readouterr().out.splitlines()
        picture = picture_files.read(out)
        assert picture.attributes["halfspace:sampling"] == expected
        found.append(picture.colour())
    assert not np.array_equal(*found)


def test_a_configuration_is_taken_whatever_the_file_would_choose(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [str(file), *QUICK, "--out", str(tmp_path / "out.png"), "--percentage", "50"]
    assert render.main([*asked, "--structure", "kd:max_depth=9,traversal=dir"]) == 0
    told = capsys.readouterr().out.strip()
    assert "16 × 8 pixels" in told
    assert told.endswith(" with kd:traversal=dir,max_depth=9, answers not compared")


def test_stereo_becomes_one_picture_and_the_size_is_the_file_s(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    settings = bpy.context.scene.render
    settings.use_multiview = settings.use_border = settings.use_crop_to_border = True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0, 0.5
    bpy.ops.wm.save_mainfile()
    out = tmp_path / "out.png"
    assert render.main([str(file), *QUICK, "--out", str(out)]) == 0
    told = capsys.readouterr()
    assert told.err.startswith("render: one picture from the middle")
    assert f"{out}: 16 × 8 pixels in " in told.out
    assert pictures.load(out).shape == (8, 16, 4)


def test_an_openexr_file_has_the_passes_and_says_how_it_was_made(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    scene.view_layers[0].use_pass_z = scene.view_layers[0].use_pass_normal = True
    scene.halfspace.automatic, scene.halfspace.samples = False, 1
    bpy.ops.wm.save_mainfile()
    scene.render.engine = "HALFSPACE"
    expected = pictures.render(scene)
    out = tmp_path / "out.exr"
    assert render.main([str(file), *QUICK, "--out", str(out), "--compression", "piz"]) == 0
    found = picture_files.read(out)
    assert found.colour().tobytes() == np.ascontiguousarray(expected[..., :3]).tobytes()
    layers = {name.rpartition(".")[0].partition(".")[2] for name in found.names}
    assert {"Combined", "Depth", "Normal"} <= layers
    told = {name: found.attributes[f"halfspace:{name}"] for name in ("version", "structure", "samples", "seconds")}
    assert (told["structure"], told["samples"], found.attributes["compression"]) == ("bvh-sah", 1, "piz")
    assert told["seconds"] > 0
    image = bpy.data.images.load(str(out))
    _ = image.size[0]  # reads the file
    assert image.type == "MULTILAYER"


@pytest.mark.parametrize("suffix", ["jpg", "exr"])
def test_a_bare_geometry_is_written_without_blender(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "triangle.obj"
    path.write_text("v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", encoding="utf-8")
    monkeypatch.setattr(render.importlib.util, "find_spec", lambda _: None)
    out = tmp_path / f"out.{suffix}"
    assert render.main([str(path), *QUICK, "--percentage", "2", "--out", str(out)]) == 0
    found = picture_files.read(out)
    assert found.pixels.shape[:2] == (21, 38)
    if suffix == "exr":
        assert {"ViewLayer.Depth.Z", "ViewLayer.Normal.X", "ViewLayer.Triangle Tests.X"} <= {*found.names}
        assert found.attributes["halfspace:structure"] == "kd"
        tests = found.pixels[..., found.names.index("ViewLayer.Triangle Tests.X")]
        assert 0 < tests.max() <= 2, "one triangle, and a shadow ray"


def test_a_bare_geometry_is_rendered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tent.npz"
    view = {"camera_eye": [0, -5, 1], "camera_target": [0, 0, 0], "camera_up": [0, 0, 1], "camera_vfov_deg": 45.0}
    corners = np.array([[-1, 0, -1], [1, 0, -1], [0, 1, 1]], np.float32)
    np.savez(path, vertices=corners, triangles=np.array([[0, 1, 2]]), **view)
    out = tmp_path / "tent.png"
    assert render.main([str(path), *QUICK, "--percentage", "2", "--out", str(out)]) == 0
    picture = pictures.load(out)[..., :3]
    assert picture.std() > 0.05, "a triangle before the sky"
    assert capsys.readouterr().out.strip().endswith(" with kd, answers not compared")


@pytest.mark.parametrize("with_blender", [True, False])
def test_rays_are_recorded_in_the_coordinates_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, with_blender: bool
) -> None:
    # A triangle around a far point, in a file whose y axis points up.
    path, rays, far = tmp_path / "tent.npz", tmp_path / "rays.npz", np.array([40.0, 50.0, 60.0])
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, -1]], np.float32) + far.astype(np.float32)
    view = {
        "camera_eye": far + np.array([0, 1, 5]),
        "camera_target": far,
        "camera_up": [0, 1, 0],
        "camera_vfov_deg": 45.0,
    }
    np.savez(path, vertices=corners, triangles=np.array([[0, 1, 2]]), up_axis="y", **view)
    if not with_blender:
        monkeypatch.setattr(render.importlib.util, "find_spec", lambda _: None)
    out = ["--percentage", "2", "--out", str(tmp_path / "tent.png"), "--record-rays", str(rays)]
    assert render.main([str(path), *QUICK, *out]) == 0
    assert f"{rays}: rays recorded of those traced: camera 798 of 798, shadow 0 " in capsys.readouterr().out
    scene = ray_files.added(workload.load_npz(path), ray_files.load({rays: []}, 1 << 30))
    sets = {one.name: one for one in scene.extra}
    assert sets["shadow 0"].any_hit
    # Camera rays hit as often as shadow rays begin, and these begin on the triangle.
    tree = native.load().build(scene.vertices, scene.triangles, "kd")
    camera, starts = sets["camera"], sets["shadow 0"].origins
    hits = int((tree.closest(camera.origins, camera.directions, t_max=camera.t_max).triangle >= 0).sum())
    assert 0 < len(starts) <= 3 * hits
    assert hits > 20
    assert np.abs(starts - far).max() < 1.1
    np.testing.assert_allclose(camera.origins.mean(axis=0), view["camera_eye"], atol=0.2)
    assert render.main([str(path), *out[:-1], str(tmp_path / "rays.csv")]) == 2
    assert capsys.readouterr().err.endswith("rays.csv: expected a name that ends in .npz\n")


def test_whatever_goes_wrong_is_one_line(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.blend").write_text("no scene")
    out = ["--out", str(tmp_path / "out.png"), *QUICK]
    for arguments, words in (
        ([str(tmp_path / "broken.blend"), *out], "broken.blend"),
        ([str(file), *out, "--structure", "oak"], "--structure: unknown structure 'oak'; there are kd, "),
        ([str(file), *out, "--structure", "kd:max_depth=999"], "--structure: max_depth: 999 is out of range"),
    ):
        assert render.main(arguments) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.startswith("render: ")
        assert said.count("\n") == 1

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    assert render.main([str(file), *out]) == 2
    assert capsys.readouterr().err == f"render: {tmp_path / 'out.png'}: cannot be written: No space left on device\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.blend", "cube.blend"]


@pytest.mark.parametrize("where", ["find", "Session"])
def test_reports_an_error_while_rendering_in_one_line(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], where: str
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise ValueError("the scene\nis odd")

    if where == "find":
        monkeypatch.setattr(engine.extract, "find", fail)
    else:
        monkeypatch.setattr(engine.Session, "render", fail)
    asked = [str(file), *QUICK, "--structure", "kd", "--out", str(tmp_path / "out.png")]
    assert told(render, asked, capsys) == "render: the scene is odd\n"


def test_an_interrupted_render_is_no_success(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    out = tmp_path / "out.png"
    out.write_bytes(b"old")
    monkeypatch.setattr(engine._Picture, "_tracing", interrupt)
    assert render.main([str(file), "--samples", str(1 << 16), "--out", str(out)]) == 130
    monkeypatch.setattr(scenes, "open_file", interrupt)
    assert render.main([str(file), "--out", str(out)]) == 130
    assert capsys.readouterr().err == "render: stopped\n" * 2
    assert out.read_bytes() == b"old"


@pytest.mark.parametrize("suffix", [".glb", ".usdc"])
def test_what_blender_imports_is_seen_and_lit(suffix: str, scene: Any, add: Any, tmp_path: Path) -> None:
    mesh = cube()
    mesh.materials.append(bpy.data.materials.new("Skin"))
    add("Cube", mesh)
    path = tmp_path / f"cube{suffix}"
    if suffix == ".glb":
        bpy.ops.export_scene.gltf(filepath=str(path))
    else:
        bpy.ops.wm.usd_export(filepath=str(path), convert_world_material=False)
    out = tmp_path / "out.png"
    assert render.main([str(path), *QUICK, "--percentage", "3", "--structure", "kd", "--out", str(out)]) == 0
    assert {item.type for item in bpy.context.scene.objects} >= {"MESH", "CAMERA", "LIGHT"}
    assert pictures.load(out)[..., :3].std() > 0.01


def test_scripts_of_a_file_are_not_run(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    text = bpy.data.texts.new("register.py")
    text.write(f"import pathlib\npathlib.Path({str(tmp_path / 'ran')!r}).touch()\n")
    text.use_module = True
    bpy.ops.wm.save_mainfile()
    assert render.main([str(file), *QUICK, "--out", str(tmp_path / "out.png")]) == 0
    assert not (tmp_path / "ran").exists()
    # The check can fail: Blender runs it where it is asked to.
    bpy.ops.wm.open_mainfile(filepath=str(file), use_scripts=True)
    assert (tmp_path / "ran").exists()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Final renders through `bpy.ops.render.render`: pictures, passes, warnings, errors, cancelling and memory."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import bpy
import halfspace_native
import numpy as np
import OpenImageIO
import pytest
from exr_files import exr, render
from shapes import cube, grid, material, node, with_nodes

from addon.blender.read import extract
from addon.blender.render import engine, requested, viewport
from addon.blender.session import reports, trees
from addon.core.base import room
from addon.core.session import coarse
from addon.core.session.session import Cancelled

WIDTH, HEIGHT = 48, 32


@pytest.fixture
def stage(add: Any, scene: Any) -> Any:
    """A grey cube under a sun before a blue background, seen from the front."""
    scene.render.engine = engine.ENGINE
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.halfspace.samples = 4
    add("Cube", cube())
    add("Sun", bpy.data.lights.new("Sun", "SUN"), rotation_euler=(0.5, 0.3, 0))
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, -8, 0), rotation_euler=(np.pi / 2, 0, 0))
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    background = node(scene.world.node_tree, "ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.25, 0.5, 1.0, 1.0)
    return scene


def test_the_picture_shows_cube_and_background(stage: Any, tmp_path: Path) -> None:
    picture = render(stage, tmp_path)
    blue = [picture[f"Combined.{c}"] for c in "RGB"]
    assert np.allclose([c[0, 0] for c in blue], (0.25, 0.5, 1.0), rtol=1e-3)
    assert abs(blue[0][HEIGHT // 2, WIDTH // 2] - 0.25) > 0.02
    assert (picture["Combined.A"] == 1).all()
    report = reports.last(stage)
    assert report is not None
    assert report.triangles == 12
    assert any("smooth" in line for line in report.left_out)


def test_passes_hold_depth_normal_position_and_counts(stage: Any, tmp_path: Path) -> None:
    stage.objects["Cube"].location = (100, 0, 0)
    stage.objects["Camera"].location = (100, -8, 0)
    facets = stage.objects["Cube"].modifiers.new("Facets", "SUBSURF")
    facets.subdivision_type, facets.render_levels = "SIMPLE", 3
    layer = stage.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
    layer.halfspace.use_pass_steps = layer.halfspace.use_pass_tests = True
    picture = render(stage, tmp_path)
    middle, corner = (HEIGHT // 2, WIDTH // 2), (0, 0)
    assert picture["Depth.Z"][middle] == pytest.approx(7, abs=1e-3)
    assert picture["Depth.Z"][corner] > 1e9
    assert [picture[f"Normal.{c}"][middle] for c in "XYZ"] == pytest.approx([0, -1, 0], abs=1e-4)
    x, y, z = (picture[f"Position.{c}"][middle] for c in "XYZ")
    assert (x, y, z) == pytest.approx((100, -1, 0), abs=0.2)
    assert picture["Position.X"][corner] == 0
    assert picture["Traversal Steps.X"][middle] > 0
    assert picture["Triangle Tests.X"][middle] >= 1


def test_an_empty_scene_is_all_background(stage: Any, tmp_path: Path) -> None:
    bpy.data.objects.remove(stage.objects["Cube"])
    picture = render(stage, tmp_path)
    assert np.allclose(picture["Combined.B"], 1.0, rtol=1e-3)


def test_a_transparent_film_has_no_background(stage: Any, tmp_path: Path) -> None:
    stage.render.film_transparent = True
    picture = render(stage, tmp_path)
    assert picture["Combined.A"][0, 0] == picture["Combined.B"][0, 0] == 0
    assert picture["Combined.A"][HEIGHT // 2, WIDTH // 2] == 1


def test_the_first_shown_picture_is_whole_and_changes_nothing(
    stage: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.render.resolution_x, stage.render.resolution_y = 320, 200
    before = render(stage, tmp_path)
    monkeypatch.setattr(engine, "is_displayed", lambda: True)
    monkeypatch.setattr(engine, "UPDATE_MILLISECONDS", 1)
    shown: list[Any] = []
    fill = engine.Result.fill

    def recorded(self: Any, buffers: dict[str, Any], view: int) -> None:
        shown.append(buffers["Combined"].reshape(200, 320, 4).copy())
        fill(self, buffers, view)

    monkeypatch.setattr(engine.Result, "fill", recorded)
    after = render(stage, tmp_path)
    # Every picture covers the frame, the first in few large pixels.
    assert len(shown) >= 2
    assert all((one[..., 3] == 1).all() for one in shown)
    assert len(np.unique(shown[0].reshape(-1, 4), axis=0)) <= coarse.FIRST_PIXELS
    assert abs(shown[0].mean() - shown[-1].mean()) < 0.02
    assert all(np.array_equal(values, after[name]) for name, values in before.items())


@pytest.mark.parametrize("crop", [False, True])
def test_a_border_is_the_same_picture_in_part(stage: Any, tmp_path: Path, crop: bool) -> None:
    whole = render(stage, tmp_path)["Combined.G"]
    r = stage.render
    r.use_border, r.use_crop_to_border = True, crop
    r.border_min_x, r.border_max_x, r.border_min_y, r.border_max_y = 0.25, 0.7, 0.3, 0.9
    part = render(stage, tmp_path)["Combined.G"]
    x0, y0, x1, y1 = requested.border_pixels(r, WIDTH, HEIGHT)
    if crop:
        assert part.shape == (y1 - y0, x1 - x0)
    else:
        assert part[0, 0] == 0
        part = part[y0:y1, x0:x1]
    inside = whole[y0:y1, x0:x1]
    assert np.abs(part - inside)[2:-2, 2:-2].max() < 0.25
    assert np.abs(part - inside).mean() < 0.02


def test_percentage_scales_the_picture(stage: Any, tmp_path: Path) -> None:
    stage.render.resolution_percentage = 50
    assert render(stage, tmp_path)["Combined.G"].shape == (HEIGHT // 2, WIDTH // 2)


def test_hidden_objects_are_not_rendered(stage: Any, tmp_path: Path) -> None:
    stage.objects["Cube"].hide_render = True
    assert np.allclose(render(stage, tmp_path)["Combined.B"], 1.0, rtol=1e-3)


def test_every_structure_gives_the_same_picture(stage: Any, tmp_path: Path) -> None:
    ball = stage.objects["Cube"].modifiers.new("Round", "SUBSURF")
    ball.render_levels = 2
    pictures = []
    for structure in ("brute", "kd", "kd-sah"):
        stage.halfspace.structure = structure
        pictures.append(render(stage, tmp_path)["Combined.R"])
    assert all(np.array_equal(pictures[0], other) for other in pictures[1:])


def test_a_fixed_number_of_threads_is_kept_to(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[tuple[str, int]] = []

    class Watched(engine.Session):
        @classmethod
        def start(cls, *arguments: Any, threads: int, **named: Any) -> Any:
            used.append(("build", threads))
            return super().start(*arguments, threads=threads, **named)

        def render(self, camera: Any, settings: Any, times: Any = ()) -> Any:
            used.append(("trace", settings.threads))
            return super().render(camera, settings, times)

    monkeypatch.setattr(engine, "Session", Watched)
    stage.render.threads_mode, stage.render.threads = "FIXED", 3
    bpy.ops.render.render()
    assert viewport.preview_settings(stage).threads == 3
    stage.render.threads_mode = "AUTO"  # 0: one per core
    bpy.ops.render.render()
    assert used == [("build", 3), ("trace", 3), ("build", 0), ("trace", 0)]


def test_unsupported_nodes_and_triangles_without_area_are_reported_once(stage: Any, tmp_path: Path) -> None:
    odd = material("Odd")
    shader = node(odd.node_tree, "ShaderNodeBsdfPrincipled")
    odd.node_tree.links.new(odd.node_tree.nodes.new("ShaderNodeShaderToRGB").outputs[0], shader.inputs["Roughness"])
    for name in ("Cube", "Other"):
        mesh = cube(name)
        mesh.materials.append(odd)
        stage.collection.objects.link(bpy.data.objects.new(name, mesh))
    line = bpy.data.meshes.new("Line")
    line.from_pydata([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1, 2)])
    stage.collection.objects.link(bpy.data.objects.new("Line", line))
    render(stage, tmp_path)
    report = reports.last(stage)
    assert report is not None
    assert len([w for w in report.warnings if "Odd" in w]) == 1
    assert len([w for w in report.warnings if "without area" in w and "Line" in w]) == 1


def test_vertices_that_are_not_finite_cost_only_their_triangles(stage: Any, tmp_path: Path) -> None:
    whole = render(stage, tmp_path)["Combined.R"]
    broken = cube("Broken")
    for vertex, value in zip(broken.vertices, (np.nan, np.inf, -np.inf), strict=False):
        vertex.co.x = value
    stage.collection.objects.link(bpy.data.objects.new("Broken", broken))
    picture = render(stage, tmp_path)["Combined.R"]
    assert np.isfinite(picture).all()
    assert np.allclose(picture[0, 0], whole[0, 0])
    report = reports.last(stage)
    assert report is not None
    assert any("not finite" in line and "Broken" in line for line in report.warnings)


def test_no_camera_is_refused(stage: Any) -> None:
    stage.camera = None
    with pytest.raises(RuntimeError, match="camera"):
        bpy.ops.render.render()


def test_an_error_while_rendering_is_one_readable_line(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: Any, **_kwargs: Any) -> None:
        raise ValueError("the scene\nis odd")

    monkeypatch.setattr(engine.extract, "find", fail)
    with pytest.raises(RuntimeError, match="the scene is odd"):
        bpy.ops.render.render()


def test_a_picture_larger_than_memory_is_refused_before_the_scene_is_read(
    stage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extract, "find", lambda *_, **__: pytest.fail("the scene was read"))
    monkeypatch.setattr(room, "SMALL", 0)
    # There is memory for the film alone.
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: 64 * 64 * 4 * 8)
    stage.render.resolution_x = stage.render.resolution_y = 64
    with pytest.raises(RuntimeError, match="a picture of 64 × 64 pixels: needs about 1 MB, of 0 MB that are free"):
        bpy.ops.render.render()


def test_the_tree_of_the_last_picture_is_freed_before_the_next(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.render.render()
    assert trees.TREE.all()
    monkeypatch.setattr(room, "SMALL", 0)
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: 0 if trees.TREE.all() else 1 << 30)
    bpy.ops.render.render()


def test_a_scene_that_needs_more_than_its_memory_limit_is_refused(stage: Any) -> None:
    finer = stage.objects["Cube"].modifiers.new("Finer", "SUBSURF")
    finer.subdivision_type, finer.render_levels = "SIMPLE", 6
    stage.halfspace.memory_limit = 1
    with pytest.raises(RuntimeError, match="memory_limit: the build needs more than the 1 MB"):
        bpy.ops.render.render()
    stage.halfspace.memory_limit = 0
    bpy.ops.render.render()


@pytest.mark.parametrize("during", ["build", "trace"])
def test_a_cancelled_render_ends_without_an_error(stage: Any, monkeypatch: pytest.MonkeyPatch, during: str) -> None:
    """`test_break` cannot be triggered in background, so the method that calls it is replaced."""
    if during == "build":
        stage.collection.objects.link(bpy.data.objects.new("Grid", grid(700)))
    stage.halfspace.samples = 1 << 16
    calls = []

    def break_after_a_while(picture: Any, progress: float) -> bool:
        calls.append(progress)
        return len(calls) < 3

    method = "_building" if during == "build" else "_tracing"
    monkeypatch.setattr(engine._Picture, method, break_after_a_while)
    bpy.ops.render.render()
    assert len(calls) == 3
    assert reports.last(stage) is None
    assert not [thread for thread in threading.enumerate() if thread.name == "halfspace-build"]


@pytest.mark.parametrize("during", ["extract", "build", "trace"])
def test_an_interrupted_render_leaves_the_old_picture(
    stage: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, during: str
) -> None:
    if during == "build":
        stage.collection.objects.link(bpy.data.objects.new("Grid", grid(700)))
    stage.halfspace.samples = 1 << 16

    def interrupt(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    if during == "extract":
        monkeypatch.setattr(engine.extract, "find", interrupt)
    else:
        monkeypatch.setattr(engine._Picture, "_building" if during == "build" else "_tracing", interrupt)
    old = tmp_path / "picture.png"
    old.write_bytes(b"old")
    stage.render.filepath = str(old)
    with pytest.raises(RuntimeError, match="interrupted"):
        bpy.ops.render.render(write_still=True)
    assert old.read_bytes() == b"old"
    assert reports.last(stage) is None
    assert not [thread for thread in threading.enumerate() if thread.name == "halfspace-build"]


def test_an_empty_scene_reports_why_the_picture_is_empty(stage: Any, tmp_path: Path) -> None:
    bpy.data.objects.remove(stage.objects["Cube"])
    picture = render(stage, tmp_path)
    assert np.allclose(picture["Combined.B"], 1.0, rtol=1e-3)
    report = reports.last(stage)
    assert report is not None
    assert [line for line in report.warnings if "no surface" in line]


def test_volumes_are_named(stage: Any, add: Any, tmp_path: Path) -> None:
    add("Smoke", bpy.data.volumes.new("Smoke"))
    add("Nowhere", None)
    render(stage, tmp_path)
    report = reports.last(stage)
    assert report is not None
    assert len([line for line in report.warnings if line.startswith("Skipped") and "Smoke" in line]) == 1
    assert not [line for line in report.warnings if "Nowhere" in line]


def test_every_view_layer_shows_what_it_holds(stage: Any, tmp_path: Path) -> None:
    away = bpy.data.collections.new("Away")
    stage.collection.children.link(away)
    item = stage.objects["Cube"]
    stage.collection.objects.unlink(item)
    away.objects.link(item)
    second = stage.view_layers.new("Second")
    second.layer_collection.children["Away"].exclude = True
    picture = exr(stage, tmp_path / "layers.exr", layers=True)
    first, other = (picture[f"{layer}.Combined.B"] for layer in ("ViewLayer", "Second"))
    assert abs(first[HEIGHT // 2, WIDTH // 2] - 1.0) > 0.1
    assert np.allclose(other, 1.0, rtol=1e-3)


@pytest.mark.parametrize("persistent", [False, True])
def test_warnings_of_all_view_layers_stay(stage: Any, add: Any, persistent: bool) -> None:
    stage.render.use_persistent_data = persistent
    add("Other", cube())
    stage.objects["Cube"].scale = (0, 0, 1)
    second = stage.view_layers.new("Second")
    second.use_pass_shadow = True
    away = bpy.data.collections.new("Away")
    stage.collection.children.link(away)
    away.objects.link(bpy.data.objects.new("Fog", bpy.data.volumes.new("Fog")))
    second.layer_collection.children["Away"].exclude = True

    def warnings() -> list[str]:
        report = reports.last(stage)
        assert report is not None
        return [line.partition(" ")[0] + line.partition(":")[2] for line in report.warnings]

    bpy.ops.render.render()
    assert sorted(warnings()) == ["Dropped, Cube", "Skipped, Fog", "The Second"]
    stage.objects["Cube"].scale = (1, 1, 1)
    bpy.ops.render.render()
    assert sorted(warnings()) == ["Skipped, Fog", "The Second"]
    stage.view_layers["ViewLayer"].use = False
    bpy.ops.render.render()
    assert warnings() == ["The Second"]


@pytest.mark.parametrize("persistent", [False, True])
def test_an_animation_renders_the_frames_that_are_asked_for(stage: Any, tmp_path: Path, persistent: bool) -> None:
    """As with `blender -b FILE -E HALFSPACE -s 3 -e 9 -j 2 -a`; a frame equals its picture outside of an animation."""
    item = stage.objects["Cube"]
    for frame, place in ((1, -3.0), (10, 3.0)):
        item.location.x = place
        item.keyframe_insert("location", frame=frame)
    stage.frame_start, stage.frame_end, stage.frame_step = 3, 9, 2
    stage.render.use_persistent_data = persistent
    stage.render.image_settings.file_format = "OPEN_EXR"
    stage.render.filepath = str(tmp_path / "frame-####")
    bpy.ops.render.render(animation=True)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == [f"frame-{frame:04d}.exr" for frame in (3, 5, 7, 9)]
    pictures = [OpenImageIO.ImageBuf(str(tmp_path / name)).get_pixels("float") for name in files]
    middle = [np.argwhere(np.abs(picture[..., 2] - 1) > 0.1)[:, 1].mean() for picture in pictures]
    assert middle == sorted(middle)
    stage.frame_set(7)
    alone = render(stage, tmp_path)["Combined.G"]
    assert np.abs(np.flipud(alone) - pictures[2][..., 1]).max() < 1e-3  # the file is of half floats


def test_many_frames_take_no_more_memory(stage: Any, tmp_path: Path) -> None:
    ball = stage.objects["Cube"].modifiers.new("Round", "SUBSURF")
    ball.render_levels = 5
    item = stage.objects["Cube"]
    for frame, angle in ((1, 0.0), (100, 6.0)):
        item.rotation_euler.z = angle
        item.keyframe_insert("rotation_euler", frame=frame)
    stage.halfspace.samples = 1
    stage.render.filepath = str(tmp_path / "frame-####")
    used = []
    for start, end in ((1, 5), (6, 15), (16, 25)):
        stage.frame_start, stage.frame_end = start, end
        bpy.ops.render.render(animation=True)
        used.append(_resident())
    # A leak of each frame shows in both spans; the allocator's own growth does not.
    growth = min(used[1] - used[0], used[2] - used[1])
    assert growth < 4e6, "one frame's tree and film alone are more than this by three"


def _resident() -> int:
    """Bytes of memory that this process holds."""
    status = Path("/proc/self/statm")
    if not status.exists():
        pytest.skip("this system does not report the memory of a process")
    return int(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_cancelled_is_not_an_error() -> None:
    assert not issubclass(Cancelled, RuntimeError)

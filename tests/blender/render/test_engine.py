# SPDX-License-Identifier: GPL-3.0-or-later
"""Final renders through `bpy.ops.render.render`: pictures, passes, warnings, errors, cancelling, memory; previews."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import halfspace_native
import numpy as np
import OpenImageIO
import pytest

from addon.blender.read import extract
from addon.blender.render import engine, reading, requested
from addon.blender.session import reports, trees
from addon.core.base import room
from addon.core.session import coarse
from tests.blender import atlas
from tests.blender.exr_files import exr, render
from tests.blender.shapes import cube, grid, lamp, look, material, node, place, world

WIDTH, HEIGHT = 48, 32


@pytest.fixture
def stage(scene: Any) -> Any:
    """A grey cube under a sun before a blue background, seen from the front."""
    scene.render.engine = engine.ENGINE
    scene.halfspace.samples = 4
    place("Cube", cube())
    lamp("SUN", rotation_euler=(0.5, 0.3, 0))
    look((WIDTH, HEIGHT), (0, -8, 0), np.pi / 2)
    world(0.25, 0.5, 1.0)
    return scene


def test_the_picture_shows_cube_and_background(stage: Any, tmp_path: Path) -> None:
    picture = render(stage, tmp_path)
    blue = [picture[f"Combined.{c}"] for c in "RGB"]
    assert np.allclose([c[0, 0] for c in blue], (0.25, 0.5, 1.0), rtol=1e-3)
    assert abs(blue[0][HEIGHT // 2, WIDTH // 2] - 0.25) > 0.02
    assert (picture["Combined.A"] == 1).all()
    report = atlas.report(stage)
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
    assert reading.preview_settings(stage).threads == 3
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
    warnings = atlas.warnings(stage)
    assert len([w for w in warnings if "Odd" in w]) == 1
    assert len([w for w in warnings if "without area" in w and "Line" in w]) == 1


def test_no_camera_is_refused(stage: Any) -> None:
    stage.camera = None
    with pytest.raises(RuntimeError, match="camera"):
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


@pytest.fixture
def long(stage: Any) -> Iterator[Any]:
    """A render that takes hours, and leaves neither a report nor a build."""
    place("Grid", grid(700))
    stage.halfspace.samples = 1 << 16
    yield stage
    assert reports.last(stage) is None
    assert not [thread for thread in threading.enumerate() if thread.name == "halfspace-build"]


@pytest.mark.parametrize("method", ["_building", "_tracing"])
def test_a_cancelled_render_ends_without_an_error(long: Any, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    """`test_break` cannot be triggered in background, so the method that calls it is replaced."""
    calls = []

    def break_after_a_while(picture: Any, progress: float) -> bool:
        calls.append(progress)
        return len(calls) < 3

    monkeypatch.setattr(engine._Picture, method, break_after_a_while)
    bpy.ops.render.render()
    assert len(calls) == 3


@pytest.mark.parametrize("method", ["find", "_building", "_tracing"])
def test_an_interrupted_render_leaves_the_old_picture(
    long: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, method: str
) -> None:
    def interrupt(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(engine.extract if method == "find" else engine._Picture, method, interrupt)
    old = tmp_path / "picture.png"
    old.write_bytes(b"old")
    long.render.filepath = str(old)
    with pytest.raises(RuntimeError, match="interrupted"):
        bpy.ops.render.render(write_still=True)
    assert old.read_bytes() == b"old"


def test_an_empty_scene_reports_why_the_picture_is_empty(stage: Any, tmp_path: Path) -> None:
    bpy.data.objects.remove(stage.objects["Cube"])
    picture = render(stage, tmp_path)
    assert np.allclose(picture["Combined.B"], 1.0, rtol=1e-3)
    assert [line for line in atlas.warnings(stage) if "no surface" in line]


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
        return [line.partition(" ")[0] + line.partition(":")[2] for line in atlas.warnings(stage)]

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
    for frame, x in ((1, -3.0), (10, 3.0)):
        item.location.x = x
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


def preview(block: Any) -> Any:
    """The pixels of a data block's preview, (h, w, 4)."""
    block.use_fake_user = True
    assert bpy.ops.wm.previews_ensure() == {"FINISHED"}
    found = block.preview
    width, height = found.image_size
    return np.array(found.image_pixels_float, np.float32).reshape(height, width, 4)


def test_materials_have_previews_in_their_colours(scene: Any, add: Any) -> None:
    scene.render.engine = engine.ENGINE
    add("Box", cube())
    bpy.ops.halfspace.build_structure()
    tree, report = trees.last(scene), reports.last(scene)
    pictures = {}
    for name, color in (("Red", (0.8, 0.02, 0.02, 1)), ("Blue", (0.02, 0.02, 0.8, 1))):
        pictures[name] = preview(material(name, Base_Color=color, Roughness=0.8))
    red, blue = (picture[48:80, 48:80, :3].mean(axis=(0, 1)) for picture in pictures.values())
    assert pictures["Red"].shape == (128, 128, 4)
    assert red[0] > 1.3 * red[2]
    assert blue[2] > 1.3 * blue[0]
    assert np.isfinite(pictures["Red"]).all()
    # The structure and the report of the last picture are still those of the scene.
    assert trees.last(scene) is tree
    assert reports.last(scene) is report

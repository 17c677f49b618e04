# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport, drawn into an offscreen buffer: a coarse picture at once, then the full one."""

import gc
import time
import weakref
from types import SimpleNamespace
from typing import Any

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix

from addon.blender.read import extract, views
from addon.blender.render import reading, viewport
from addon.blender.render.viewport import Viewport
from addon.core.base import denoise
from tests.blender.shapes import cube, grid, lamp, look, place, world
from tests.blender.viewing import MOST_REDRAWS, settle

WIDTH, HEIGHT = 64, 48


class Engine:
    """Stands in for `bpy.types.RenderEngine`, which cannot be made outside a window."""

    def __init__(self) -> None:
        self.redraws = 0
        self.said = ""

    def get_preview_pixel_size(self, scene: Any) -> int:
        return 1

    def update_stats(self, _left: str, right: str) -> None:
        self.said = right

    def tag_redraw(self) -> None:
        self.redraws += 1

    def bind_display_space_shader(self, scene: Any) -> None:
        pass

    def unbind_display_space_shader(self) -> None:
        pass


@pytest.fixture
def context(scene: Any) -> Any:
    """A view of a dark cube before a white background, through the scene's camera."""
    place("Cube", cube())
    look((WIDTH, HEIGHT), (0, -8, 0), np.pi / 2)
    world(1, 1, 1)
    scene.halfspace.preview_samples = 4
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    window_matrix = scene.camera.calc_matrix_camera(depsgraph, x=WIDTH, y=HEIGHT)
    view_matrix = scene.camera.matrix_world.inverted()
    return SimpleNamespace(
        scene=scene,
        region=SimpleNamespace(width=WIDTH, height=HEIGHT),
        region_data=SimpleNamespace(
            view_matrix=view_matrix,
            window_matrix=window_matrix,
            perspective_matrix=window_matrix @ view_matrix,
            view_perspective="PERSP",
        ),
        space_data=SimpleNamespace(
            clip_start=0.1, clip_end=100.0, use_local_camera=False, camera=None, use_render_border=False
        ),
    )


def draw_until_done(view: Viewport, engine: Engine, context: Any, canvas: Any) -> np.ndarray[Any, Any]:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    with canvas.bind():
        gpu.matrix.load_matrix(Matrix.Identity(4))
        gpu.matrix.load_projection_matrix(
            Matrix(((2 / WIDTH, 0, 0, -1), (0, 2 / HEIGHT, 0, -1), (0, 0, 1, 0), (0, 0, 0, 1)))
        )
        view.draw(engine, context, depsgraph)
        for _ in range(MOST_REDRAWS):  # in place of the timer, which needs a window
            before = engine.redraws
            more = view.tick()
            if engine.redraws > before:
                view.draw(engine, context, depsgraph)
            if not more:
                break
            time.sleep(0.001)
        else:
            pytest.fail("the picture never converges")
        pixels = gpu.state.active_framebuffer_get().read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
    return np.array(pixels.to_list(), np.float32).reshape(HEIGHT, WIDTH, 4)


def test_the_picture_converges_and_follows_the_view(context: Any, canvas: Any) -> None:
    engine, view = Engine(), Viewport()
    view.update(engine, context, bpy.context.evaluated_depsgraph_get())
    picture = draw_until_done(view, engine, context, canvas)
    assert engine.said == "Sample 4 of 4"
    assert np.allclose(picture[0, 0, :3], 1, atol=1e-2)
    assert picture[HEIGHT // 2, WIDTH // 2, 0] < 0.95
    context.region_data.view_matrix = Matrix.Translation((50, 0, 0)) @ context.region_data.view_matrix
    context.region_data.perspective_matrix = context.region_data.window_matrix @ context.region_data.view_matrix
    assert np.allclose(draw_until_done(view, engine, context, canvas)[..., :3], 1, atol=1e-2)


def converged(context: Any, samples: int, *, denoised: bool) -> tuple[Any, str]:
    """The last picture of the view with these samples, in rows, and its status line. Needs no drawing."""
    context.scene.halfspace.preview_samples = samples
    context.scene.halfspace.use_preview_denoising = denoised
    view, engine = Viewport(), Engine()
    view.update(engine, context, bpy.context.evaluated_depsgraph_get())
    settle(view)
    view._engine = weakref.ref(engine)
    view._preview.look(views.seen(context))
    for _ in range(MOST_REDRAWS):
        if not view.tick():
            break
        time.sleep(0.01)
    else:
        pytest.fail("the picture never converges")
    return view._preview.picture.pixels.reshape(HEIGHT, WIDTH, 4), view.status()


def test_the_last_picture_stays_until_an_edit_is_read(
    context: Any, canvas: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewport, "SLICE_SECONDS", 1e-9)
    monkeypatch.setattr(viewport, "LONGEST_SECONDS", 3e-9)
    engine, view = Engine(), Viewport()
    view.update(engine, context, bpy.context.evaluated_depsgraph_get())
    assert view.status() == "Reading the scene"
    before = draw_until_done(view, engine, context, canvas)
    shown = view._preview.picture
    # Move the cube out of the view, then back into another place while the first edit is read.
    for steps, offset, longest in ((1, 50.0, 1e-9), (4, 20.0, 2e-9), (MOST_REDRAWS, 1.0, 3e-9)):
        bpy.data.objects["Cube"].location.x = offset
        bpy.context.view_layer.update()
        view.update(engine, context, bpy.context.evaluated_depsgraph_get())
        assert view._slice == longest
        for _ in range(steps):
            if view._newest is None:
                break
            assert (view._preview.picture, view.status().startswith("Reading the scene")) == (shown, True)
            view.draw(engine, context, bpy.context.evaluated_depsgraph_get())
    after = draw_until_done(view, engine, context, canvas)
    assert "Reading" not in view.status()
    fresh = Viewport()
    fresh.update(engine, context, bpy.context.evaluated_depsgraph_get())
    assert np.array_equal(after, draw_until_done(fresh, engine, context, canvas))
    assert not np.array_equal(before, after)


def test_what_an_evaluation_freed_is_read_from_the_start(
    context: Any, canvas: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewport, "SLICE_SECONDS", 0.0)
    engine, view = Engine(), Viewport()
    view.update(engine, context, bpy.context.evaluated_depsgraph_get())
    for _ in range(3):
        view.draw(engine, context, bpy.context.evaluated_depsgraph_get())
    first, remembered = view._newest, view._remembered
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    place("Other", cube("Other"), location=(1, 0, 0))
    bpy.context.view_layer.update()
    view.draw(engine, context, bpy.context.evaluated_depsgraph_get())
    assert first.outdated(bpy.context.evaluated_depsgraph_get())
    assert view._newest is not first
    assert view._remembered is not remembered
    draw_until_done(view, engine, context, canvas)
    assert {name for _, name in view._scene.geometry.runs()} == {"Other"}


@pytest.mark.parametrize("integrator", ["path", "ao"])
def test_the_noise_of_the_viewport_falls(context: Any, integrator: str) -> None:
    place("Wall", grid(4), location=(0, 3, 0), rotation_euler=(np.pi / 2, 0, 0), scale=(9, 9, 9))
    lamp("AREA", 800, size=4, location=(-3, -3, 3), rotation_euler=(0.9, 0, -0.8))
    bpy.context.view_layer.update()
    context.scene.halfspace.integrator = integrator
    reference, _ = converged(context, 1024, denoised=False)
    noisy, before = converged(context, 2, denoised=False)
    clean, after = converged(context, 2, denoised=True)
    assert (before, after) == ("Sample 2 of 2", "Sample 2 of 2 | Denoised")
    assert np.array_equal(noisy[..., 3], clean[..., 3])
    errors = [float(np.sqrt(np.mean((p[..., :3] - reference[..., :3]) ** 2))) for p in (noisy, clean)]
    assert errors[1] < 0.5 * errors[0]


def test_a_missing_library_is_noted_in_the_status_line(context: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_folders: Any) -> Any:
        raise denoise.DenoiseError("Open Image Denoise cannot be loaded: gone")

    monkeypatch.setattr(denoise, "load", missing)
    noisy, said = converged(context, 2, denoised=True)
    assert said == "Sample 2 of 2 | Not denoised: Open Image Denoise cannot be loaded: gone"
    assert np.array_equal(noisy, converged(context, 2, denoised=False)[0])


def test_samples_go_on_while_the_structure_changes(context: Any) -> None:
    place("Wall", grid(4), location=(0, 3, 0), rotation_euler=(np.pi / 2, 0, 0), scale=(9, 9, 9))
    lamp("AREA", 800, size=4, location=(-3, -3, 3), rotation_euler=(0.9, 0, -0.8))
    # One thread takes many times longer than three builds.
    render, samples = context.scene.render, 128
    render.threads_mode, render.threads = "FIXED", 1
    bpy.context.view_layer.update()
    undisturbed, _ = converged(context, samples, denoised=False)
    view, engine, group = Viewport(), Engine(), context.scene.halfspace
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(engine, context, depsgraph)
    settle(view)
    preview = view._preview
    preview.look(views.seen(context))
    view._engine = weakref.ref(engine)
    seen: list[int] = []
    structures = ["bvh-sah", "grid", "bih"]
    while view.tick():
        # Choose another structure after some samples at full resolution, each once the last one is built.
        job = preview._job
        if job is not None and job.settings.samples == samples:
            seen.append(preview.samples[0])
            if structures and seen[-1] and preview.preparing is None:
                group.structure = structures.pop(0)
                view.update(engine, context, depsgraph)
                settle(view)
                assert preview._job is job
        time.sleep(0.002)
    assert not structures, "the picture was done before"
    assert seen == sorted(seen)
    assert preview.samples == (samples, samples)
    assert preview._ready.session.spec == "bih"
    assert np.array_equal(preview.picture.pixels.reshape(HEIGHT, WIDTH, 4), undisturbed)


def test_the_start_of_denoising_is_a_sample(scene: Any) -> None:
    group = scene.halfspace
    assert reading.clean_from(group) == 0
    group.use_preview_denoising = True
    assert reading.clean_from(group) == 1
    group.preview_denoising_start_sample = 7
    assert reading.clean_from(group) == 7
    group.preview_denoising_start_sample = 0
    assert reading.clean_from(group) == 1


def test_a_viewport_that_goes_stops_its_work(context: Any) -> None:
    view, engine = Viewport(), Engine()
    context.scene.halfspace.preview_samples = 1 << 16
    view.update(engine, context, bpy.context.evaluated_depsgraph_get())
    settle(view)
    view._preview.look(views.seen(context))
    for _ in range(MOST_REDRAWS):
        view.tick()
        if view._preview._job is not None and view._preview._job.settings.samples > 1:
            break
        time.sleep(0.001)
    job, gone = view._preview._job.native, weakref.ref(view)
    del view
    gc.collect()
    assert gone() is None
    assert job.wait(300_000)
    assert job.cancelled


def test_a_border_is_rendered_and_nothing_else(context: Any) -> None:
    space = context.space_data
    space.use_render_border = True
    space.render_border_min_x, space.render_border_max_x = 0.25, 0.5
    space.render_border_min_y, space.render_border_max_y = 0.5, 2.0
    assert views.seen(context).border == (16, 24, 32, 48)


def test_the_border_of_a_camera_view_lies_in_the_camera_s_frame(context: Any) -> None:
    """Here the frame is the region, since the view is the camera's own."""
    context.region_data.view_perspective = "CAMERA"
    render = context.scene.render
    render.resolution_x, render.resolution_y = WIDTH, HEIGHT
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.5, 0.75, 0.25, 1.0
    assert views.seen(context).border == (32, 12, 48, 48)


def test_the_view_of_a_camera_is_the_camera(context: Any) -> None:
    seen = views.view_camera(context.region_data, np.zeros(3), context.space_data)
    assert seen.kind == "perspective"
    assert np.allclose(seen.to_world, np.array(context.scene.camera.matrix_world), atol=1e-6)
    left, right, bottom, top = seen.window
    assert (left, bottom) == pytest.approx((-right, -top))
    assert right / top == pytest.approx(WIDTH / HEIGHT)


def test_a_view_shows_no_more_than_its_own_objects(context: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    context.scene, context.space_data = bpy.context.scene, area.spaces.active
    for name in ("In", "Out"):
        item = bpy.data.objects.new(name, cube(name))
        context.scene.collection.objects.link(item)
        item.select_set(name == "In")
    found: list[Any] = []
    find = extract.Reading.found

    def see(read: Any) -> Any:
        found.append(find(read))
        return found[-1]

    def shown() -> set[str]:
        view, engine = Viewport(), Engine()
        view.update(engine, context, bpy.context.evaluated_depsgraph_get())
        settle(view)
        return {name for placement in found[-1].placements for name in placement.names}

    monkeypatch.setattr(extract.Reading, "found", see)
    assert shown() == {"In", "Out"}
    with bpy.context.temp_override(window=window, area=area, region=region, space_data=context.space_data):
        bpy.ops.view3d.localview(frame_selected=False)
    assert shown() == {"In"}
    context.space_data.show_object_viewport_mesh = False
    assert shown() == set()

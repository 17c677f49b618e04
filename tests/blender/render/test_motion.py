# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur compared with Cycles: a camera that moves and turns, and objects that move and change their shape."""

from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from addon.blender.measure import pictures
from addon.blender.read import between
from addon.blender.render import cameras, moving, shutter
from addon.core.session import refits
from tests.blender import atlas
from tests.blender.shapes import cube, look, material, place, world

SIZE, SAMPLES = 48, 256


def animate(item: Any, path: str, *values: Any) -> None:
    """Keys of a property at the frames 0, 1, ..., linear between them."""
    for frame, value in enumerate(values):
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)
    action = item.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


@pytest.fixture(name="stage")
def staged(scene: Any) -> Any:
    """A glowing cube below the camera in a dim world, while the shutter is open for a frame around frame 1."""
    atlas.with_cycles(scene)
    world()
    glow = material("Glow", Emission_Color=(1, 0.5, 0.2, 1), Emission_Strength=1.0)
    place("Cube", cube(size=1.0), glow)
    look((SIZE, SIZE), (0, 0, 6))
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, 1.0, "CENTER"
    scene.frame_set(1)
    atlas.configure(scene, SAMPLES, 1)
    return scene


def compared(scene: Any) -> tuple[np.ndarray[Any, Any], float]:
    """Our picture, and the root mean square of its difference from Cycles', relative to the spread of Cycles'."""
    ours, theirs = atlas.pair(scene)
    assert abs(ours.mean() / theirs.mean() - 1) < 0.01
    assert not atlas.warnings(scene)
    return ours, float(((ours - theirs) ** 2).mean() ** 0.5 / theirs.std())


def test_a_moving_and_turning_camera(stage: Any) -> None:
    animate(stage.camera, "location", (-1, 0, 6), (0, 0, 6), (1, 0.5, 6))
    animate(stage.camera, "rotation_euler", (0, 0, -0.5), (0, 0, 0), (0, 0.1, 0.7))
    stage.frame_set(1)
    ours, apart = compared(stage)
    assert apart < 0.05
    stage.render.use_motion_blur = False
    stage.render.engine = "HALFSPACE"
    still = pictures.render(stage)[..., :3]
    assert ((ours - still) ** 2).mean() ** 0.5 > 0.2 * still.std(), "without motion the picture is another one"


@pytest.mark.parametrize("position", ["START", "CENTER", "END"])
def test_a_moving_object(stage: Any, position: str) -> None:
    animate(bpy.data.objects["Cube"], "location", (-1, 0, 0), (0, 0.3, 0), (1, 0, 0))
    stage.frame_set(1)
    stage.render.motion_blur_position = position
    stage.halfspace.motion_steps = 32
    _, apart = compared(stage)
    assert apart < 0.1
    assert stage.frame_current == 1
    assert stage.frame_subframe == 0


@pytest.mark.parametrize("moves", ["camera", "object"])
def test_the_shutter_opens_and_closes_by_its_curve(stage: Any, moves: str) -> None:
    item, height = (stage.camera, 6) if moves == "camera" else (bpy.data.objects["Cube"], 0)
    animate(item, "location", (-1, 0, height), (0, 0.3, height), (1, 0, height))
    stage.frame_set(1)
    stage.halfspace.motion_steps = 64
    even, _ = compared(stage)
    points = stage.render.motion_blur_shutter_curve.curves[0].points
    for point, where in zip(points, ((0, 1), (0.5, 0.1), (1, 0)), strict=True):
        point.location = where
    stage.render.motion_blur_shutter_curve.update()
    uneven, apart = compared(stage)
    change = float(((uneven - even) ** 2).mean() ** 0.5 / even.std())
    assert apart < 0.1
    assert apart < 0.5 * change


@pytest.mark.parametrize("duration", [0.0, 0.3])
@pytest.mark.parametrize("moves", ["camera", "object"])
def test_a_rolling_shutter(stage: Any, moves: str, duration: float) -> None:
    item, height = (stage.camera, 6) if moves == "camera" else (bpy.data.objects["Cube"], 0)
    animate(item, "location", (-1, 0, height), (0, 0.3, height), (1, 0, height))
    stage.frame_set(1)
    stage.halfspace.motion_steps = 64
    together, _ = compared(stage)
    stage.cycles.rolling_shutter_type, stage.cycles.rolling_shutter_duration = "TOP", duration
    rolling, apart = compared(stage)
    assert apart < 0.1
    assert apart < 0.3 * float(((rolling - together) ** 2).mean() ** 0.5 / together.std())
    # The curve of the shutter is that of each row.
    points = stage.render.motion_blur_shutter_curve.curves[0].points
    for point, where in zip(points, ((0, 1), (0.5, 0.1), (1, 0)), strict=True):
        point.location = where
    stage.render.motion_blur_shutter_curve.update()
    _, apart = compared(stage)
    assert apart < 0.1


def looked_at(monkeypatch: pytest.MonkeyPatch) -> list[moving.Moving]:
    """What `Times.look` finds from now on."""
    looked: list[moving.Moving] = []

    def noted(*given: Any) -> Any:
        looked.append(look_at(*given))
        return looked[-1]

    look_at = moving.Times.look
    monkeypatch.setattr(moving.Times, "look", noted)
    return looked


def test_a_fast_object_does_not_hide_how_a_small_one_turns(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    fan = place("Fan", cube(size=0.1), bpy.data.materials["Glow"])
    animate(bpy.data.objects["Cube"], "location", (-8, 0, 0), (0, 0, 0), (8, 0, 0))
    animate(fan, "rotation_euler", (0, 0, -1), (0, 0, 0), (0, 0, 3))
    stage.frame_set(1)
    stage.render.engine, stage.halfspace.instancing, stage.halfspace.motion_steps = "HALFSPACE", "two-level", 8
    looked = looked_at(monkeypatch)
    pictures.render(stage)
    # Its speed changes in the middle, where the shutter's halves meet.
    assert [len(one.keys) for one in looked] == [5]


@pytest.mark.parametrize("layout", ["flatten", "two-level"])
def test_places_between_keys_are_those_that_are_read(stage: Any, layout: str, monkeypatch: pytest.MonkeyPatch) -> None:
    item, scene = bpy.data.objects["Cube"], stage
    animate(item, "location", (-1, 0, 0), (0, 0.3, 0), (1, 0, 0))
    animate(item, "rotation_euler", (0, 0, -0.6), (0, 0, 0), (0, 0, 0.6))
    animate(item, "scale", (1, 1, -1), (1, 1, -1.5), (1, 1, -2))
    stage.frame_set(1)
    scene.render.engine, scene.halfspace.instancing, scene.halfspace.motion_steps = "HALFSPACE", layout, 16
    looked = looked_at(monkeypatch)
    quick = pictures.render(scene)
    monkeypatch.setattr(moving.Times, "_keys", lambda *_: ())
    exact = pictures.render(scene)
    assert [len(one.keys) for one in looked] == [5, 0]
    assert [one.times for one in looked] == [16, 16]
    # The same samples meet nearly the same places.
    assert np.abs(quick - exact).mean() < 0.002 * exact.std()


def test_transforms_between_two() -> None:
    rng = np.random.default_rng(5)
    for angle, axis in ((0.0, "X"), (0.4, "Y"), (3.0, "Z"), (np.pi, "X"), (np.pi, "Y"), (np.pi, "Z")):
        a = Matrix.LocRotScale(rng.normal(size=3).tolist(), None, (1.0, 2.0, -0.5))
        turned = [Matrix.Rotation(angle * share, 4, axis) @ a for share in (0.0, 0.5, 1.0)]
        ends = np.array(turned[::2], np.float64)
        half = between.transforms(ends[:1], ends[1:], 0.5)[0]
        assert np.allclose(between.transforms(ends[:1], ends[1:], 0.0)[0], ends[0], atol=1e-6)
        assert np.allclose(between.transforms(ends[:1], ends[1:], 1.0)[0], ends[1], atol=1e-6)
        # The position goes straight; half a turn may go either way.
        assert np.allclose(half[:3, 3], ends[:, :3, 3].mean(axis=0))
        back = np.array(Matrix.Rotation(-angle / 2, 4, axis) @ a)[:3, :3]
        right = np.allclose(half[:3, :3], np.array(turned[1])[:3, :3], atol=1e-5)
        assert right or (angle == np.pi and np.allclose(half[:3, :3], back, atol=1e-5))


def test_an_object_that_changes_its_shape(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    item = bpy.data.objects["Cube"]
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="Long")
    for point in key.data:
        point.co.x *= 3
    for frame, value in enumerate((0.0, 0.5, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    stage.frame_set(1)
    stage.halfspace.motion_steps = 32
    # The structure of each time is fitted to that of the time before.
    stage.halfspace.structure = "bvh-sah"
    done = []

    def noted(*given: Any) -> Any:
        structure, what = fitted(*given)
        done.append(what)
        return structure, what

    fitted = refits.fitted
    monkeypatch.setattr(refits, "fitted", noted)
    _, apart = compared(stage)
    assert apart < 0.1
    assert done.count(refits.REFITTED) > 16


def test_a_shutter_that_never_opens_is_named(stage: Any) -> None:
    animate(bpy.data.objects["Cube"], "location", (-1, 0, 0), (0, 0, 0), (1, 0, 0))
    stage.frame_set(1)
    stage.render.engine = "HALFSPACE"
    stage.render.use_motion_blur = False
    still = pictures.render(stage)
    stage.render.use_motion_blur, stage.render.motion_blur_shutter = True, 0.0
    if shutter.interval(stage) is not None:
        pytest.skip("this Blender has no shutter of 0")
    assert np.array_equal(pictures.render(stage), still)
    assert any("shutter" in warning for warning in atlas.warnings(stage))


def test_the_shutter_opens_in_frames_that_are_not_stretched(stage: Any) -> None:
    stage.render.frame_map_old, stage.render.frame_map_new = 100, 50
    stage.frame_set(10)
    assert stage.frame_current_final == 20
    assert shutter.interval(stage) == (9.5, 10.5)


def test_without_a_view_that_is_used_the_camera_is_rendered(stage: Any) -> None:
    stage.render.use_multiview = True
    assert cameras.views(stage) == ["left", "right"]
    for view in stage.render.views:
        view.use = False
    assert cameras.views(stage) == [""]

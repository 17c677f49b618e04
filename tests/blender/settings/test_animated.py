# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that change over time: keyframes, drivers, and the random numbers of each frame."""

import itertools
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render import engine
from addon.blender.render.requested import render_settings
from addon.blender.render.viewport import Viewport
from tests.blender.shapes import grid, lamp, look, place, world

FRAMES = (1, 2, 3, 4, 5, 6, 7, 8)


@pytest.fixture(name="still")
def still_scene(scene: Any) -> Any:
    """A floor in soft light, with much noise, on which nothing moves."""
    scene.render.engine, scene.halfspace.samples = engine.ENGINE, 4
    place("Floor", grid(4), scale=(6, 6, 6))
    lamp("AREA", 800, size=4, location=(-3, -3, 6), rotation_euler=(0.5, -0.5, 0))
    look((48, 32), (0, -9, 4), 1.2)
    world(0.5, 0.5, 0.5)
    return scene


def frame(scene: Any, number: int, part: float = 0.0) -> Any:
    scene.frame_set(number, subframe=part)
    return pictures.render(scene)[..., :3].astype(float)


def test_frames_of_a_still_scene_differ_in_noise_and_agree_in_the_mean(still: Any) -> None:
    assert np.array_equal(frame(still, 1), frame(still, 2)), "as in Cycles, by default"
    still.halfspace.use_animated_seed = True
    frames = [frame(still, number) for number in FRAMES]
    assert np.array_equal(frame(still, 3), frames[2]), "a frame is the same each time"
    assert not np.array_equal(frame(still, 3, 0.5), frames[2])
    for one, other in itertools.pairwise(frames):
        assert (one != other).mean() > 0.5
    # The means agree with a picture of as many samples within the noise of both: four standard deviations.
    still.halfspace.use_animated_seed, still.halfspace.samples = False, 4 * len(FRAMES)
    reference = frame(still, 1)
    noise = np.std(frames, axis=0, ddof=1) / np.sqrt(len(FRAMES))
    means = np.array([np.mean(frames), np.mean(reference)])
    assert abs(means[0] - means[1]) < 4 * np.sqrt(2) * np.sqrt((noise**2).sum()) / noise.size
    # No noise stands still: that of the mean falls with the number of frames.
    spread = [np.mean((np.mean(frames[:count], axis=0) - reference) ** 2) for count in (1, len(FRAMES))]
    assert spread[1] < 0.5 * spread[0]


def test_seeds_of_frames_differ_by_seed_too(still: Any) -> None:
    still.halfspace.use_animated_seed = True
    found = set()
    for seed in range(8):
        for number in FRAMES:
            still.frame_set(number)
            still.halfspace.render_seed = seed
            found.add(engine.quality.seed(still))
    assert len(found) == 8 * len(FRAMES)


def driven(scene: Any, name: str, expression: str) -> None:
    """Let a setting follow an expression of the frame."""
    scene.driver_add(f"halfspace.{name}").driver.expression = expression


def keyed(scene: Any, name: str, **values: Any) -> None:
    """Keyframes of a setting at frames 1 and 11."""
    for number, value in zip((1, 11), values.values(), strict=True):
        setattr(scene.halfspace, name, value)
        scene.keyframe_insert(f"halfspace.{name}", frame=number)


@pytest.mark.parametrize("viewport", [False, True], ids=["render", "viewport"])
def test_keyframes_and_drivers_of_settings_are_followed(
    still: Any, monkeypatch: pytest.MonkeyPatch, *, viewport: bool
) -> None:
    keyed(still, "film_exposure", first=1.0, last=3.0)
    keyed(still, "caustics_refractive", first=True, last=False)
    driven(still, "clamp_indirect", "frame * 2")
    driven(still, "max_bounces", "frame")
    found: list[Any] = []

    class Picture(engine._Picture):
        def render(self) -> None:
            found.append(render_settings(self.engine, self.depsgraph))
            super().render()

    monkeypatch.setattr(engine, "_Picture", Picture)

    class Engine:
        """What a view refers to."""

    view, shown = Viewport(), Engine()
    for number in (1, 11):
        still.frame_set(number)
        if viewport:
            view.update(shown, SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
            assert view._preview is not None
            found.append(view._preview._settings)
        else:
            bpy.ops.render.render()
    told = [(one.exposure, one.caustics_refractive, one.clamp_indirect, one.max_bounces) for one in found]
    assert told == [(1.0, True, 2.0, 1), (3.0, False, 22.0, 11)]
    if view._preview is not None:
        view.stop()


def test_every_setting_of_pictures_can_move(scene: Any) -> None:
    fixed = [one.identifier for one in scene.halfspace.bl_rna.properties if not one.is_animatable]
    assert set(fixed) <= {"rna_type", "name", "overlay", "inspector", "compared"}

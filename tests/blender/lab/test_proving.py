# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes that are judged against Cycles: understood to the last node, and the same for every kind of tree."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read import camera
from addon.core.base import native
from addon.core.base.notes import Notes
from addon.core.session import session
from addon.core.structures.settings import RenderSettings
from addon.lab.pictures import proving
from tests.blender.shapes import read
from tests.kinds import KINDS

SIZE = (24, 16)


def rendered(scene: Any, moments: Sequence[Any], spec: str, threads: int = 1) -> bytes:
    """The bits of a small picture of the scene at these times."""
    module = native.load()
    arrays = moments[0]
    view = camera.read_camera(
        scene.camera,
        bpy.context.evaluated_depsgraph_get(),
        scene.camera.matrix_world,
        arrays.geometry.origin,
        Notes(),
        size=SIZE,
        pixel_aspect=(1, 1),
    )
    times = [session.Session.start(module, one, spec, threads=threads, keep_going=lambda _: True) for one in moments]
    settings = RenderSettings(*SIZE, samples=len(moments), max_bounces=3, threads=threads)
    job = times[0].render(view, settings, times=times if len(times) > 1 else ())
    session.watch(job, milliseconds=1000, keep_going=lambda _: True, show=lambda: None)
    out = np.empty(SIZE[0] * SIZE[1] * 4, np.float32)
    job.copy_into("Combined", out)
    assert np.isfinite(out).all()
    assert out.reshape(-1, 4)[:, :3].max() > 0
    return out.tobytes()


def assert_alike(scene: Any, moments: Sequence[Any]) -> None:
    """Trees of all kinds, and two threads, render the same bits."""
    reference = rendered(scene, moments, "brute")
    for spec in KINDS:
        assert rendered(scene, moments, spec) == reference, spec
    assert rendered(scene, moments, "kd", threads=2) == reference


@pytest.mark.parametrize("name", list(proving.SCENES))
def test_each_scene_is_understood_and_the_same_for_all_structures_and_threads(scene: Any, name: str) -> None:
    proving.build(name, scene, detail=0.05)
    bpy.context.view_layer.update()
    arrays, notes = read()
    assert notes == []
    assert 0 < len(arrays.geometry.triangles) < 2000
    assert_alike(scene, [arrays])


def test_the_moving_wheel_is_the_same_for_all_structures_and_threads(scene: Any) -> None:
    proving.build("wheel", scene, detail=0.05)
    moments = []
    for subframe in (0.65, 0.95):
        scene.frame_set(9, subframe=subframe)
        moments.append(read()[0])
    first, second = (one.geometry.vertices for one in moments)
    assert first.shape == second.shape
    assert not np.array_equal(first, second)
    assert_alike(scene, moments)

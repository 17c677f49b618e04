# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes that are judged beside Cycles: understood to the last node, and the same for every structure."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from shapes import read

from addon.blender.read import camera
from addon.core.base import native
from addon.core.base.notes import Notes
from addon.core.session import session
from addon.core.structures import catalogue
from addon.core.structures.settings import RenderSettings
from lab.pictures import proving

SIZE = (24, 16)


def rendered(scene: Any, arrays: Any, spec: str, threads: int = 1) -> bytes:
    """The bits of a small picture."""
    module = native.load()
    view = camera.read_camera(
        scene.camera,
        bpy.context.evaluated_depsgraph_get(),
        scene.camera.matrix_world,
        arrays.geometry.origin,
        Notes(),
        size=SIZE,
        pixel_aspect=(1, 1),
    )
    started = session.Session.start(module, arrays, spec, threads=threads, keep_going=lambda _: True)
    job = started.render(view, RenderSettings(*SIZE, samples=1, max_bounces=3, threads=threads))
    session.watch(job, milliseconds=1000, keep_going=lambda _: True, show=lambda: None)
    out = np.empty(SIZE[0] * SIZE[1] * 4, np.float32)
    job.copy_into("Combined", out)
    assert np.isfinite(out).all()
    assert out.reshape(-1, 4)[:, :3].max() > 0
    return out.tobytes()


@pytest.mark.parametrize("name", list(proving.SCENES))
def test_each_scene_is_understood_and_the_same_for_all_structures_and_threads(scene: Any, name: str) -> None:
    proving.build(name, scene, detail=0.05)
    bpy.context.view_layer.update()
    arrays, notes = read()
    assert notes == [] or name in proving.SIMPLIFIED
    assert 0 < len(arrays.geometry.triangles) < 2000
    reference = rendered(scene, arrays, "brute")
    for structure in catalogue.load().structures:
        assert rendered(scene, arrays, structure.id) == reference, structure.id
    assert rendered(scene, arrays, "kd", threads=2) == reference

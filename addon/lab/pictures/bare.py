# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a bare geometry, rendered without Blender: a light grey surface, a sun and a sky."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.measure.curve import plain_camera, plain_scene

if TYPE_CHECKING:
    from ...core.base.arrays import F32
    from ...core.base.interface import Native
    from ...core.scene.workload import Workload
    from ...core.structures.settings import RenderSettings

FULL = (1920, 1080)
"""Width and height of a picture of 100 percent, as in Blender."""

WAIT_MILLISECONDS = 100


def render(native: Native, workload: Workload, spec: str, settings: RenderSettings) -> F32:
    """The scene through its view: (height, width, 3) float32 linear RGB, rows from the bottom.

    Raises ValueError for a configuration that is not understood, MemoryError, and RuntimeError with the renderer's
    error.
    """
    structure = native.build(workload.vertices, workload.triangles, spec, threads=settings.threads)
    scene = native.RenderScene(structure, **plain_scene())
    camera = plain_camera(workload.view, settings.width / settings.height, workload.diagonal())
    job = native.render(scene, camera, replace(settings, passes=("Combined",)).as_dict(), threads=settings.threads)
    while not job.wait(WAIT_MILLISECONDS):
        pass
    if job.error is not None:
        raise RuntimeError(job.error)
    out = np.zeros(settings.width * settings.height * job.passes["Combined"], np.float32)
    job.copy_into("Combined", out)
    return np.ascontiguousarray(out.reshape(settings.height, settings.width, -1)[..., :3])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a bare geometry, rendered without Blender: a light grey surface, a sun and a sky."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.picture_files import Picture
from ...core.measure.curve import plain_camera, plain_scene

if TYPE_CHECKING:
    from ...core.base.interface import Native
    from ...core.scene.workload import Workload
    from ...core.structures.settings import RenderSettings

FULL = (1920, 1080)
"""Width and height of a picture of 100 percent, as in Blender."""

PASSES = ("Combined", "Depth", "Normal", "Traversal Steps", "Triangle Tests", "Leaf Depth")
"""Passes of a file with layers."""

CHANNELS = {"Combined": "RGBA", "Depth": "Z", "Normal": "XYZ"}
"""Blender's letters of the channels of passes; others have an X."""

WAIT_MILLISECONDS = 100


def render(
    native: Native, workload: Workload, spec: str, settings: RenderSettings, passes: Sequence[str] = ()
) -> tuple[Picture, dict[str, Any]]:
    """The scene through its view, scene linear: R, G and B, or all channels of these passes, named as Blender does.
    Also the recorded rays, as `RenderJob.recorded` returns them, where the settings request them.

    Raises ValueError for a configuration that is not understood, MemoryError, and RuntimeError with the renderer's
    error.
    """
    structure = native.build(workload.vertices, workload.triangles, spec, threads=settings.threads)
    scene = native.RenderScene(structure, **plain_scene())
    camera = plain_camera(workload.view, settings.width / settings.height, workload.diagonal())
    wanted = replace(settings, passes=tuple(passes) or ("Combined",))
    job = native.render(scene, camera, wanted.as_dict(), threads=settings.threads)
    while not job.wait(WAIT_MILLISECONDS):
        pass
    if job.error is not None:
        raise RuntimeError(job.error)
    recorded: dict[str, Any] = dict(job.recorded()) if settings.record_rays else {}
    found, names = [], []
    for name, channels in job.passes.items():
        out = np.zeros(settings.width * settings.height * channels, np.float32)
        job.copy_into(name, out)
        found.append(out.reshape(settings.height, settings.width, channels))
        names += [f"ViewLayer.{name}.{letter}" for letter in CHANNELS.get(name, "X")]
    if not passes:
        return Picture(np.ascontiguousarray(found[0][..., :3]), ("R", "G", "B")), recorded
    return Picture(np.concatenate(found, axis=2), tuple(names)), recorded

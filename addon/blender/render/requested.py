# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of the picture that Blender requests."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.base import denoise
from ...core.structures.settings import Mist, RenderSettings
from ..read import passes, view_layers
from ..session import reports
from ..settings import quality


def render_settings(engine: Any, depsgraph: Any) -> RenderSettings:
    """The settings of the picture of a view layer: size, border, samples, passes and quality."""
    scene = depsgraph.scene_eval
    render, group = scene.render, scene.halfspace
    width, height = engine.resolution_x, engine.resolution_y
    wanted = tuple(render_pass.name for render_pass in passes.wanted_passes(depsgraph.view_layer_eval))
    return RenderSettings(
        width=width,
        height=height,
        border=border_pixels(render, width, height) if render.use_border else None,
        samples=depsgraph.view_layer_eval.samples or group.samples,
        passes=denoise.with_features(wanted, quality.integrator(group)) if removes_noise(depsgraph) else wanted,
        time_limit=group.time_limit,
        mist=_mist(view_layers.world(depsgraph)),
        record_rays=reports.RECORD.of(scene) or 0,
        **quality.adaptive(group),
        **quality.settings(scene),
    )


def removes_noise(depsgraph: Any) -> bool:
    """Whether the noise of the picture of a view layer is removed. Cycles stores the switch of the layer."""
    layer = getattr(depsgraph.view_layer_eval, "cycles", None)
    return bool(depsgraph.scene_eval.halfspace.use_denoising and getattr(layer, "use_denoising", True))


def _mist(world: Any) -> Mist:
    """The mist pass's settings, which belong to the world."""
    if world is None:
        return Mist()
    found = world.mist_settings
    return Mist(found.start, found.depth, found.falloff)


def border_pixels(render: Any, width: int, height: int) -> tuple[int, int, int, int]:
    """The render border in pixels, rounded as in Blender: the product in f32, then towards zero."""
    size = np.array([width, height, width, height], np.float32)
    edges = np.array([render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y], np.float32)
    x0, y0, x1, y1 = (int(edge) for edge in edges * size)
    return x0, y0, x1, y1

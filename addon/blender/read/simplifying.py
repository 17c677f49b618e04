# SPDX-License-Identifier: GPL-3.0-or-later
"""*Simplify* of Cycles: objects left out of final renders, those outside of the camera's view or too far from it, and
the largest size of textures.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.base.arrays import F64
from .camera import seen_by


def texture_limit(depsgraph: Any) -> int | None:
    """The most texels of a side of an image; None if there is no limit."""
    scene = depsgraph.scene_eval
    cycles = getattr(scene, "cycles", None)
    if cycles is None or not scene.render.use_simplify:
        return None
    limit = cycles.texture_limit_render if depsgraph.mode == "RENDER" else cycles.texture_limit
    return None if limit == "OFF" else int(limit)


class Culling:
    """Objects that the scene's culling leaves out, as in Cycles: by their boxes, seen from the active camera."""

    def __init__(self, depsgraph: Any) -> None:
        scene = depsgraph.scene_eval
        cycles, item, render = getattr(scene, "cycles", None), scene.camera, scene.render
        self._by_view = self._by_distance = False
        # Cycles culls neither for panoramas nor for several views; the viewport does not read again when it turns.
        if cycles is None or not render.use_simplify or render.use_multiview or depsgraph.mode != "RENDER":
            return
        if item is None or item.type != "CAMERA" or item.data.type == "PANO":
            return
        self._margin, self._distance = cycles.camera_cull_margin, cycles.distance_cull_margin
        self._by_view, self._by_distance = cycles.use_camera_cull, cycles.use_distance_cull and self._distance > 0
        if not (self._by_view or self._by_distance):
            return
        self._view = seen_by(item, depsgraph)

    def leaves_out(self, item: Any, matrix: F64) -> bool:
        """Whether an object at this place, (4, 4) to the world, is left out."""
        if not (self._by_view or self._by_distance):
            return False
        asked = [
            test
            for switch, own, test in (
                (self._by_view, item.cycles.use_camera_cull, self._is_outside),
                (self._by_distance, item.cycles.use_distance_cull, self._is_far),
            )
            if switch and own
        ]
        if not asked:
            return False
        corners = np.array(item.bound_box, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        return all(test(corners) for test in asked)

    def _is_outside(self, corners: F64) -> bool:
        """Whether these corners, (8, 3), are all behind the camera or outside of its widened picture."""
        view, margin = self._view, self._margin
        local = (corners - view.to_world[:3, 3]) @ view.to_world[:3, :3]
        depth, span = -local[:, 2], view.clip_end - view.clip_start
        parallel = view.kind == "orthographic"
        # The depth as Blender's projection has it: 0 at the near plane, in units of the far one.
        along = (depth - view.clip_start) / span * (1.0 if parallel else view.clip_end)
        left, right, bottom, top = view.window
        plane = (
            local[:, :2] if parallel else local[:, :2] / np.where(depth == 0, np.finfo(np.float64).tiny, depth)[:, None]
        )
        seen = (plane - (left, bottom)) / (right - left, top - bottom)
        seen = np.where(along[:, None] < 0, 1 - seen, seen)
        if (along < -margin).all():
            return True
        return bool((seen.min(axis=0) >= 1 + margin).any() or (seen.max(axis=0) <= -margin).any())

    def _is_far(self, corners: F64) -> bool:
        """Whether the box around these corners, (8, 3), is beyond the distance."""
        place = self._view.to_world[:3, 3]
        nearest = np.clip(place, corners.min(axis=0), corners.max(axis=0))
        return bool(np.linalg.norm(place - nearest) > self._distance)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The size of a pixel of the scene's camera, which decides how finely round things are divided."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ....core.base.arrays import F64

MOST_PLACES = 32
"""Instances, those nearest to the camera, among which the smallest pixel is searched."""

PIXELS_ACROSS = 1000
"""Pixels across an object's box if the scene has no usable camera."""


@dataclass(frozen=True, eq=False)
class Pixels:
    """The size of pixels in the world.

    eye: (3,) float64. angle: size of a pixel at distance 1; 0 for a parallel camera. size: smallest size of a pixel,
    that of all for a parallel camera.
    """

    eye: F64
    angle: float
    size: float

    def at(self, points: F64) -> F64:
        """The size of a pixel at these points, (..., 3), of the world."""
        distances = np.linalg.norm(points - self.eye, axis=-1)
        sizes: F64 = np.maximum(self.angle * distances, self.size)
        return sizes


def pixels(depsgraph: Any) -> Pixels | None:
    """The pixels of the scene's camera at the resolution of final renders; None without a usable camera."""
    scene = depsgraph.scene_eval
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        return None
    frame = np.array([corner[:] for corner in camera.data.view_frame(scene=scene)], np.float64)
    across = max(scene.render.resolution_x, scene.render.resolution_y) * scene.render.resolution_percentage / 100
    width = np.ptp(frame, axis=0)[:2].max() / max(across, 1.0)
    depth = np.abs(frame[:, 2]).max()
    eye = np.array(camera.matrix_world, np.float64)[:3, 3]
    if camera.data.type == "ORTHO":
        found = Pixels(eye, 0.0, float(width))
    else:
        angle = width / depth if depth > 0 else 0.0
        found = Pixels(eye, float(angle), float(angle * camera.data.clip_start))
    usable = np.isfinite(eye).all() and np.isfinite([found.angle, found.size]).all() and found.angle + found.size > 0
    return found if usable else None


def sizes_within(view: Pixels | None, points: F64, matrices: F64) -> F64:
    """The size of the smallest pixel that covers each of these (k, ..., 3) points of an object, in the object's units.

    matrices: (p, 4, 4), its instances. The smallest size of all points of a row and of all instances is taken.
    """
    if view is None:
        extent = np.ptp(points.reshape(-1, 3), axis=0).max(initial=0.0) if points.size else 0.0
        return np.full(len(points), max(extent, 1e-12) / PIXELS_ACROSS)
    # Measure only the nearest instances, by their distance relative to their scale.
    scales = np.maximum(np.cbrt(np.abs(np.linalg.det(matrices[:, :3, :3]))), 1e-30)
    near = np.argsort(view.at(matrices[:, :3, 3]) / scales, kind="stable")[:MOST_PLACES]
    smallest = np.full(len(points), np.inf)
    for place in near.tolist():
        world = points @ matrices[place, :3, :3].T + matrices[place, :3, 3]
        found = view.at(world) / scales[place]
        np.minimum(smallest, found.reshape(len(points), -1).min(axis=1), out=smallest)
    return smallest

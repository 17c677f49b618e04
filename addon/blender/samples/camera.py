# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras that are placed by numbers: of scene files and of scenes built by script."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix

if TYPE_CHECKING:
    from ...core.base.arrays import F64
    from ...core.scene.workload import View


def see(scene: Any, view: View) -> None:
    """Add a camera with this view to the scene, and make it active."""
    data = bpy.data.cameras.new("Camera")
    data.sensor_fit = "VERTICAL"
    data.angle = np.radians(view.vertical_fov)
    distance = float(np.linalg.norm(view.target - view.eye))
    data.clip_start, data.clip_end = 1e-3 * distance, 1e4 * distance
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.camera.matrix_world = looking(view.eye, view.target, view.up)
    scene.collection.objects.link(scene.camera)


def looking(eye: F64, target: F64, up: F64) -> Any:
    """Transform of a camera or light at `eye` whose -Z points to `target` and whose +Y leans towards `up`."""
    back = np.array(eye, np.float64) - target
    back /= np.linalg.norm(back)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :] = np.stack([right, np.cross(back, right), back, eye], axis=1)
    return Matrix(matrix.tolist())

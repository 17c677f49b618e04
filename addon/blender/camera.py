# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras as `core.scene.Camera`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.scene import F64, Camera

if TYPE_CHECKING:
    from ..core.notes import Notes

FALLBACK = "PERSP"


def read_camera(
    item: Any,
    depsgraph: Any,
    matrix_world: Any,
    origin: F64,
    notes: Notes,
    *,
    size: tuple[int, int],
    pixel_aspect: tuple[float, float] = (1.0, 1.0),
) -> Camera:
    """An evaluated camera object seen in a frame of `size` pixels.

    matrix_world: the camera's place without scale; origin: (3,) float64, where the scene frame lies in the world.
    Shift, sensor fit and pixel aspect come out of Blender's own projection matrix. Kinds of camera that cannot be
    rendered go into `notes` and become a perspective one with the same lens.
    """
    if item.type != "CAMERA":
        notes.add("Not a camera, rendered with a default lens", item.name)
    elif item.data.type not in ("PERSP", "ORTHO"):
        notes.add("Only perspective and orthographic cameras are supported yet, rendered as perspective", item.name)
    elif item.data.dof.use_dof:
        notes.add("Depth of field is not supported yet, everything is sharp", item.name)
    projection = np.array(
        item.calc_matrix_camera(depsgraph, x=size[0], y=size[1], scale_x=pixel_aspect[0], scale_y=pixel_aspect[1]),
        np.float64,
    )
    to_world = np.array(matrix_world, np.float64, order="C")
    to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    to_world[:3, 3] -= origin
    data = item.data if item.type == "CAMERA" else None
    return Camera(
        kind="orthographic" if projection[3, 3] == 1.0 else "perspective",
        to_world=to_world,
        window=window(projection),
        clip_start=data.clip_start if data else 0.1,
        clip_end=data.clip_end if data else 1000.0,
    )


def window(projection: F64) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of what a projection matrix shows: at distance 1, or parallel in scene units.

    Solves projection · (x, y, -1, 1) = ±w for the edges of the picture, row by row.
    """
    w = 1.0 if projection[3, 3] == 0.0 else projection[3, 3]
    edges = []
    for row in (0, 1):
        scale = projection[row, row]
        shift = projection[row, 3] - projection[row, 2]
        edges += [(-w - shift) / scale, (w - shift) / scale]
    return (edges[0], edges[1], edges[2], edges[3])

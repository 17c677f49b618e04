# SPDX-License-Identifier: GPL-3.0-or-later
"""3D views turned to what the overlay shows: a node, or a ray from the side."""

from __future__ import annotations

from typing import Any

import numpy as np
from mathutils import Matrix, Vector

from ...core.base.arrays import F64

NODE_MARGIN, RAY_MARGIN, LEAST = 2.5, 1.2, 1e-4
"""Distance of a view in sizes of the node or of the ray that it frames, and the smallest size that is framed."""

ABOVE = 0.35
"""Angle in radians by which a view from the side looks down."""


def frame(screen: Any, points: F64, margin: float, across: F64 | None = None) -> bool:
    """Turn the largest 3D view of the screen to points (n, 3) in world space. Returns whether there is such a view.

    margin: distance of the view in sizes of the points' box. across: a direction (3,) that lies in the picture, from
    left to right or from right to left; by default the view looks along the same direction as before.
    """
    areas = [area for area in screen.areas if area.type == "VIEW_3D"] if screen is not None else []
    if not areas:
        return False
    view = max(areas, key=lambda area: area.width * area.height).spaces.active.region_3d
    low, high = points.min(axis=0), points.max(axis=0)
    if across is not None:
        view.view_rotation = sideways(across, np.array(view.view_rotation @ Vector((1.0, 0.0, 0.0))))
    view.view_perspective = "PERSP"
    view.view_location = Vector((low + high) / 2)
    view.view_distance = margin * max(float(np.linalg.norm(high - low)), LEAST)
    return True


def sideways(across: F64, right: F64) -> Any:
    """Rotation of a view whose horizontal axis is `across`, (3,), or its opposite, whichever is nearer to `right`, and
    that looks from slightly above wherever that is possible.
    """
    x = across / np.linalg.norm(across)
    x = -x if x @ right < 0 else x
    up = np.array([0.0, 0.0, 1.0]) - x[2] * x
    if np.linalg.norm(up) < 1e-3:
        up = np.array([0.0, 1.0, 0.0]) - x[1] * x
    up /= np.linalg.norm(up)
    out = np.cross(x, up)
    raised = np.cos(ABOVE) * out + np.sin(ABOVE) * up
    turn = np.stack([x, np.cross(raised, x), raised], axis=1)
    return Matrix(turn.tolist()).to_quaternion()

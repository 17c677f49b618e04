# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible part of a 3D view's region: its camera and its border."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.base.arrays import F64
from ...core.scene.scene import Camera
from ...core.session.preview import View
from .camera import lens, window


def seen(context: Any, pixel: int = 1) -> View:
    """The view of the region that is being drawn."""
    region, space, data = context.region, context.space_data, context.region_data
    camera = camera_object(context)
    return View(
        camera=view_camera(data, np.zeros(3), space, camera),
        width=region.width,
        height=region.height,
        border=_border(context, camera),
        pixel=pixel,
    )


def camera_object(context: Any) -> Any:
    """The camera that the view looks through, or None."""
    if context.region_data.view_perspective != "CAMERA":
        return None
    space = context.space_data
    item = space.camera if space.use_local_camera else context.scene.camera
    return item if item is not None and item.type == "CAMERA" else None


def view_camera(view: Any, origin: F64, space: Any, camera: Any = None) -> Camera:
    """A view as a camera. camera: the camera object that it looks through, None for a perspective or parallel view."""
    to_world = np.linalg.inv(np.array(view.view_matrix, np.float64))
    to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    to_world[:3, 3] -= origin
    projection = np.array(view.window_matrix, np.float64)
    parallel = bool(projection[3, 3] == 1.0)
    start, end = space.clip_start, space.clip_end
    if camera is not None:
        start, end = camera.data.clip_start, camera.data.clip_end
    elif parallel:
        start = -end  # a parallel view also shows objects behind its plane
    return Camera(
        kind="orthographic" if parallel else "perspective",
        to_world=to_world,
        window=window(projection),
        clip_start=start,
        clip_end=end,
        **(lens(camera, parallel=parallel) if camera is not None else {}),
    )


def _border(context: Any, camera: Any) -> tuple[int, int, int, int] | None:
    """The rendered part of the region in its pixels: the view's border, or the camera's in a camera
    view; None for all.
    """
    region, render = context.region, context.scene.render
    # Choose the border and the frame that it is relative to.
    if camera is None:
        source = context.space_data
        if not source.use_render_border:
            return None
        low, high = np.zeros(2), np.array([region.width, region.height], np.float64)
    else:
        source = render
        if not source.use_border:
            return None
        low, high = _frame(context, camera)
    # Convert the border to pixels of the region.
    x = np.array(
        [
            source.render_border_min_x if camera is None else source.border_min_x,
            source.render_border_max_x if camera is None else source.border_max_x,
        ]
    )
    y = np.array(
        [
            source.render_border_min_y if camera is None else source.border_min_y,
            source.render_border_max_y if camera is None else source.border_max_y,
        ]
    )
    x0, x1 = np.clip(np.round(low[0] + x * (high[0] - low[0])), 0, region.width).astype(int)
    y0, y1 = np.clip(np.round(low[1] + y * (high[1] - low[1])), 0, region.height).astype(int)
    if x0 >= x1 or y0 >= y1:
        # The border lies outside of the region: rendering one pixel avoids a special case.
        x0, y0 = min(x0, region.width - 1), min(y0, region.height - 1)
        x1, y1 = x0 + 1, y0 + 1
    return int(x0), int(y0), int(x1), int(y1)


def _frame(context: Any, camera: Any) -> tuple[F64, F64]:
    """The lower left and the upper right corner of the camera's frame, in pixels of the region."""
    region, data = context.region, context.region_data
    to_region = np.array(data.perspective_matrix, np.float64) @ np.array(camera.matrix_world.normalized(), np.float64)
    corners = np.array([(*corner, 1.0) for corner in camera.data.view_frame(scene=context.scene)])
    clip = corners @ to_region.T
    points = (clip[:, :2] / clip[:, 3:] + 1) / 2 * (region.width, region.height)
    return points.min(axis=0), points.max(axis=0)

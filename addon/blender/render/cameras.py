# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of the view that Blender renders."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...core.base.notes import Notes
from ..read import camera

if TYPE_CHECKING:
    from ...core.base.arrays import F64
    from ...core.scene.scene import Camera


def active(engine: Any, depsgraph: Any, origin: F64, notes: Notes) -> Camera:
    """The active camera for the engine's active view, in the scene frame with this origin. Raises RuntimeError without
    one.
    """
    scene = depsgraph.scene_eval
    item = engine.camera_override or scene.camera
    if item is None:
        raise RuntimeError("Cannot render, no camera")
    item = camera.of_view(item, scene, engine.active_view_get()).evaluated_get(depsgraph)
    render = scene.render
    view = camera.read_camera(
        item,
        depsgraph,
        engine.camera_model_matrix(item),
        origin,
        notes,
        size=(engine.resolution_x, engine.resolution_y),
        pixel_aspect=(render.pixel_aspect_x, render.pixel_aspect_y),
    )
    if not render.use_multiview or item.type != "CAMERA":
        return view
    return camera.shifted(view, item.data, engine.camera_shift_x(item))


def views(scene: Any) -> list[str]:
    """The names of the views that a scene renders; one without a name unless there are several."""
    render = scene.render
    used = [view.name for view in render.views if view.use] if render.use_multiview else []
    return used or [""]


def by_view(engine: Any, depsgraph: Any, origin: F64, notes: Notes) -> dict[str, Camera]:
    """The active camera of each view by its name, see `active`. Changes the engine's active view."""
    found = {}
    for name in views(depsgraph.scene_eval):
        engine.active_view_set(name)
        seen = Notes()
        found[name] = active(engine, depsgraph, origin, seen)
        notes.join(seen)  # once, not once for each view
    return found

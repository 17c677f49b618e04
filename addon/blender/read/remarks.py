# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes on unsupported settings of the whole scene, in addition to those of objects and materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .view_layers import unknown_passes

if TYPE_CHECKING:
    from ...core.base.notes import Notes


def remark(scene: Any, view_layer: Any, triangles: int, notes: Notes) -> None:
    """Note what is missing in a picture of this view layer."""
    render = scene.render
    if not triangles:
        notes.add("The scene has no surface, only the background is rendered", scene.name)
    if render.use_motion_blur:
        notes.add("Motion blur is not supported, objects are rendered without motion", scene.name)
    if render.use_freestyle:
        notes.add("Freestyle lines are not supported", scene.name)
    for name in unknown_passes(view_layer):
        notes.add(f"The pass {name} is not supported yet, and not rendered", view_layer.name)

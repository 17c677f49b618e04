# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that adds the showcase to the file."""

from __future__ import annotations

from typing import Any

import bpy

from . import showcase


class HALFSPACE_OT_showcase(bpy.types.Operator):
    """Adds the built-in scene, with the overlay if the scene before it has one."""

    bl_idname = "halfspace.showcase"
    bl_label = "New Showcase Scene"
    bl_description = "Add a scene with glass, metal and tilted geometry, lit and framed, ready to render"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        scene = bpy.data.scenes.new("Showcase")
        showcase.build(scene)
        scene.halfspace.overlay.show = context.scene.halfspace.overlay.show
        if context.window is not None:
            context.window.scene = scene
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_showcase,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of baking. Labels and places are those of Cycles; Blender's operator reads most of the settings."""

from __future__ import annotations

from typing import Any

import bpy

from .panels import EnginePanel, registered, rows

LIT = ("DIFFUSE", "GLOSSY", "TRANSMISSION")
"""Bakes of the light of one kind of shaders."""

VIEWED = ("COMBINED", "SHADOW", "EMIT", *LIT)
"""Bakes that depend on the direction from which the surface is seen."""


class HALFSPACE_PT_bake(EnginePanel, bpy.types.Panel):
    """Parts that are baked, of the selected objects into the images of their materials."""

    bl_label = "Bake"
    section = "Baking"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        scene = context.scene
        wanted = scene.halfspace.bake_type
        column.operator("object.bake", icon="RENDER_STILL").type = wanted
        column.prop(scene.halfspace, "bake_type")
        if wanted in VIEWED:
            row = column.row()
            row.active = scene.camera is not None
            row.prop(scene.render.bake, "view_from")


class HALFSPACE_PT_bake_influence(EnginePanel, bpy.types.Panel):
    """The parts of what is baked."""

    bl_label = "Influence"
    bl_parent_id = "HALFSPACE_PT_bake"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.scene.halfspace.bake_type in ("NORMAL", "COMBINED", *LIT)

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        bake, wanted = context.scene.render.bake, context.scene.halfspace.bake_type
        if wanted == "NORMAL":
            rows(column, bake, normal_space="Space", normal_r="Swizzle R", normal_g="G", normal_b="B")
            return
        light = column.column(heading="Lighting", align=True)
        rows(light, bake, "use_pass_direct", "use_pass_indirect")
        if wanted in LIT:
            light.prop(bake, "use_pass_color")
            return
        parts = column.column(heading="Contributions", align=True)
        rows(parts, bake, *(f"use_pass_{part}" for part in ("diffuse", "glossy", "transmission", "emit")))


class HALFSPACE_PT_bake_selected_to_active(EnginePanel, bpy.types.Panel):
    """Whether the surfaces of the selected objects are baked into the image of the active one."""

    bl_label = "Selected to Active"
    bl_parent_id = "HALFSPACE_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.render.bake, "use_selected_to_active", text="")

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        bake = context.scene.render.bake
        column.active = bake.use_selected_to_active
        column.prop(bake, "use_cage", text="Cage")
        if bake.use_cage:
            column.prop(bake, "cage_object")
        column.prop(bake, "cage_extrusion", text="Extrusion")
        column.prop(bake, "max_ray_distance")


class HALFSPACE_PT_bake_output(EnginePanel, bpy.types.Panel):
    """Where the pixels go."""

    bl_label = "Output"
    bl_parent_id = "HALFSPACE_PT_bake"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        bake = context.scene.render.bake
        column.prop(bake, "target")
        if bake.target == "IMAGE_TEXTURES":
            rows(column, bake, use_clear="Clear Image", margin_type="Margin", margin="Size")


CLASSES = registered(globals())

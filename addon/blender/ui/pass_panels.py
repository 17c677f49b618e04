# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the passes of a view layer and of light groups. Labels and places are those of Cycles."""

from __future__ import annotations

from typing import Any

import bpy

from ..read.passes import DATA_PASSES, MATTES, OWN_PASSES
from .panels import EnginePanel, registered, rows


class HALFSPACE_PT_passes(EnginePanel, bpy.types.Panel):
    """The passes of a view layer."""

    bl_label = "Passes"
    section = "Passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        layer = context.view_layer
        rows(column, layer, "use_pass_combined", *(one.switch for one in DATA_PASSES[1:]))
        column.separator()
        rows(column, layer.halfspace, *(one.switch for one in OWN_PASSES))


class HALFSPACE_PT_passes_light(EnginePanel, bpy.types.Panel):
    """The passes of a view layer that divide its light."""

    bl_label = "Light"
    bl_parent_id = "HALFSPACE_PT_passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        layer = context.view_layer
        for kind in ("diffuse", "glossy", "transmission"):
            rows = column.column(heading=kind.capitalize(), align=True)
            for part in ("direct", "indirect", "color"):
                rows.prop(layer, f"use_pass_{kind}_{part}", text=part.capitalize())
        rows = column.column(heading="Volume", align=True)
        for part in ("direct", "indirect"):
            rows.prop(layer.halfspace, f"use_pass_volume_{part}", text=part.capitalize())
        rows = column.column(heading="Other", align=True)
        rows.prop(layer, "use_pass_emit", text="Emission")
        rows.prop(layer, "use_pass_environment")
        rows.prop(layer.halfspace, "use_pass_shadow_catcher")


class HALFSPACE_PT_passes_cryptomatte(EnginePanel, bpy.types.Panel):
    """The passes of a view layer that tell objects and materials apart."""

    bl_label = "Cryptomatte"
    bl_parent_id = "HALFSPACE_PT_passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        layer = context.view_layer
        for kind, switch in MATTES.items():
            column.prop(layer, switch, text=kind)
        levels = column.column()
        levels.active = any(getattr(layer, switch) for switch in MATTES.values())
        levels.prop(layer, "pass_cryptomatte_depth", text="Levels")


class HALFSPACE_PT_passes_aov(EnginePanel, bpy.types.Panel):
    """The passes of a view layer that materials write."""

    bl_label = "Shader AOV"
    bl_parent_id = "HALFSPACE_PT_passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        layer = context.view_layer
        row = self.layout.row()
        row.column().template_list("VIEWLAYER_UL_aov", "aovs", layer, "aovs", layer, "active_aov_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_aov", icon="ADD", text="")
        buttons.operator("scene.view_layer_remove_aov", icon="REMOVE", text="")
        if layer.active_aov is not None and not layer.active_aov.is_valid:
            self.layout.label(text="Another pass has this name", icon="ERROR")


class HALFSPACE_PT_passes_lightgroups(EnginePanel, bpy.types.Panel):
    """The light groups of a view layer."""

    bl_label = "Light Groups"
    bl_parent_id = "HALFSPACE_PT_passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        layer = context.view_layer
        row = self.layout.row()
        row.column().template_list(
            "UI_UL_list", "lightgroups", layer, "lightgroups", layer, "active_lightgroup_index", rows=3
        )
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        buttons.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")
        buttons.separator()
        buttons.menu("VIEWLAYER_MT_lightgroup_sync", icon="DOWNARROW_HLT", text="")


class _LightGroupPanel(EnginePanel):
    bl_label = "Light Group"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layer, item = context.view_layer, getattr(context, self.block)
        row = self.column(moves=False).row(align=True)
        row.prop_search(item, "lightgroup", layer, "lightgroups", text="Light Group", results_are_suggestions=True)
        button = row.column(align=True)
        button.enabled = bool(item.lightgroup) and item.lightgroup not in layer.lightgroups
        button.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = item.lightgroup


class HALFSPACE_PT_object_light_group(_LightGroupPanel, bpy.types.Panel):
    """The light group of a lamp or a glowing object."""

    bl_parent_id = "OBJECT_PT_shading"
    block = bl_context = "object"


class HALFSPACE_PT_world_light_group(_LightGroupPanel, bpy.types.Panel):
    """The light group of the background."""

    block = bl_context = "world"


CLASSES = registered(globals())

# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in the Render, View Layer, Material, Light and World properties. Drawing only reads; it never builds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from ...core.base import native
from ...core.choose import choice
from ..measure import checking
from ..read.nodes import output_node
from ..read.passes import PASSES
from ..render.engine import ENGINE
from ..session import reports, trees
from . import manual, structure
from .texts import wrapped

STATISTICS = (
    ("Extraction", "extract_seconds", "{:.2f} s"),
    ("Build", "build_seconds", "{:.2f} s"),
    ("Render", "seconds", "{:.2f} s"),
    ("Rays", "mrays_s", "{:.2f} M/s"),
    ("Memory", "bytes", "{:,} bytes"),
    ("Nodes, axis", "nodes_axis", "{:,}"),
    ("Nodes, oblique", "nodes_oblique", "{:,}"),
    ("Leaves", "leaves", "{:,}"),
    ("Empty leaves", "leaves_empty", "{:,}"),
    ("References", "references", "{:,}"),
    ("References per triangle", "references_per_triangle", "{:.2f}"),
    ("Triangles in the largest leaf", "leaf_max", "{:,}"),
    ("Instances", "instances", "{:,}"),
    ("Meshes", "meshes", "{:,}"),
    ("Depth, largest", "depth_max", "{:,}"),
    ("Depth, mean", "depth_mean", "{:.1f}"),
    ("Expected cost", "sah_cost", "{:.2f}"),
)
"""Lines of the statistics panel: label, key, format."""


class _Panel:
    """A panel that appears only for this engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    section = ""
    """Heading of docs/manual.md that explains the panel."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE

    def draw_header_preset(self, context: Any) -> None:
        help_button(self.layout, self.section)  # type: ignore[attr-defined]

    def _column(self) -> Any:
        layout = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.use_property_decorate = False
        return layout.column()


class HALFSPACE_PT_structure(_Panel, bpy.types.Panel):
    """The acceleration structure and its parameters, or the reason why there is none."""

    bl_label = "Structure"
    section = "Structure"

    def draw(self, context: Any) -> None:
        column = self._column()
        if problem := native.problem():
            wrapped(column, problem, icon="ERROR")
            return
        group = context.scene.halfspace
        column.prop(group, "automatic")
        if group.automatic:
            wrapped(column, "The viewport and the overlay use:", icon="INFO")
        structure.draw(column, group)
        header, body = column.panel("HALFSPACE_memory", default_closed=True)
        header.label(text="Memory")
        if body is not None:
            body.prop(group, "instancing")
            body.prop(group, "memory_limit")


class HALFSPACE_PT_sampling(_Panel, bpy.types.Panel):
    """Number of samples, and length of paths."""

    bl_label = "Sampling"
    section = "Sampling"

    def draw(self, context: Any) -> None:
        column = self._column()
        group = context.scene.halfspace
        column.prop(group, "integrator")
        if group.integrator == "ao":
            column.prop(group, "ambient_distance")
        column.prop(group, "samples")
        column.prop(group, "use_adaptive")
        if group.use_adaptive:
            column.prop(group, "noise_threshold")
        column.prop(group, "time_limit")
        column.prop(group, "preview_samples", text="Viewport")
        if group.integrator != "ao":
            column.prop(group, "max_bounces")
            column.prop(group, "clamp_indirect")
        column.prop(group, "render_seed")


class HALFSPACE_PT_film(_Panel, bpy.types.Panel):
    """Settings of the background."""

    bl_label = "Film"
    section = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        self._column().prop(context.scene.render, "film_transparent", text="Transparent")


class HALFSPACE_PT_statistics(_Panel, bpy.types.Panel):
    """Costs, omissions and notes of the last picture."""

    bl_label = "Statistics"
    section = "Statistics"

    def draw(self, context: Any) -> None:
        layout = self.layout
        report = reports.last(context.scene)
        if report is None:
            layout.label(text="Nothing rendered yet")
            answers(layout, trees.last(context.scene))
            return
        layout.label(text=report.label)
        layout.label(text=f"{report.triangles:,} triangles")
        statistics(layout, {**report.statistics, "extract_seconds": report.extract_seconds}, report.triangles)
        if report.instances:
            wrapped(layout, report.instances[0].upper() + report.instances[1:], icon="INFO")
        tree = trees.last(context.scene)
        if tree is not None and tree.number != report.tree and checking.last(tree) is not None:
            layout.label(text=f"The picture: {report.answers}", icon="INFO")
        answers(layout, tree, report.answers)
        for title, lines, icon in (
            ("Not supported", report.warnings, "ERROR"),
            ("Why this structure", report.reasons, "SHADERFX"),
            ("Left out, at no cost", report.left_out, "INFO"),
        ):
            if lines:
                box = layout.box()
                box.label(text=title, icon=icon)
                for line in lines:
                    wrapped(box, line)


class HALFSPACE_PT_passes(_Panel, bpy.types.Panel):
    """The passes of a view layer."""

    bl_label = "Passes"
    section = "Passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        column = self._column()
        layer = context.view_layer
        column.prop(layer, "use_pass_combined")
        for render_pass in PASSES:
            if render_pass.switch and not render_pass.own:
                column.prop(layer, render_pass.switch)
        column.separator()
        for render_pass in PASSES:
            if render_pass.own:
                column.prop(layer.halfspace, render_pass.switch)


class HALFSPACE_PT_material(_Panel, bpy.types.Panel):
    """The object's material slots and the inputs of the active material's shader."""

    bl_label = "Surface"
    bl_context = "material"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.object is not None and context.object.type not in ("CAMERA", "LIGHT")

    def draw(self, context: Any) -> None:
        layout = self.layout
        item = context.object
        row = layout.row()
        row.template_list("MATERIAL_UL_matslots", "", item, "material_slots", item, "active_material_index")
        buttons = row.column(align=True)
        buttons.operator("object.material_slot_add", icon="ADD", text="")
        buttons.operator("object.material_slot_remove", icon="REMOVE", text="")
        layout.template_ID(item, "active_material", new="material.new")
        if item.mode == "EDIT":
            row = layout.row(align=True)
            row.operator("object.material_slot_assign", text="Assign")
            row.operator("object.material_slot_select", text="Select")
            row.operator("object.material_slot_deselect", text="Deselect")
        if item.active_material is not None:
            _surface(layout, item.active_material, "diffuse_color")


class HALFSPACE_PT_world(_Panel, bpy.types.Panel):
    """The inputs of the world's shader."""

    bl_label = "Surface"
    bl_context = "world"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.world is not None

    def draw(self, context: Any) -> None:
        _surface(self.layout, context.world, "color")


class HALFSPACE_PT_light(_Panel, bpy.types.Panel):
    """The settings of a light."""

    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.light is not None

    def draw(self, context: Any) -> None:
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self._column()
        column.prop(light, "use_temperature")
        if light.use_temperature:
            column.prop(light, "temperature")
        for name in ("color", "energy", "exposure", "normalize"):
            column.prop(light, name)
        column.separator()
        for name in _shape_properties(light):
            column.prop(light, name)
        column.prop(light, "use_shadow")


def help_button(layout: Any, section: str) -> None:
    """Add a button that opens the manual at this heading."""
    if section:
        layout.operator(manual.HALFSPACE_OT_manual.bl_idname, text="", icon="HELP", emboss=False).section = section


def statistics(layout: Any, numbers: Mapping[str, Any], triangles: int) -> None:
    """Draw a table of the known statistics."""
    values = dict(numbers)
    if "references" in values:
        values["references_per_triangle"] = values["references"] / max(triangles, 1)
    grid = layout.grid_flow(row_major=True, columns=2, even_columns=True)
    for label, key, form in STATISTICS:
        if key in values:
            grid.label(text=label)
            grid.label(text=form.format(values[key]))


def answers(layout: Any, tree: trees.Tree | None, known: str = "") -> None:
    """Draw the result of the last check of the structure, and the button that checks it. known: text
    without a check.
    """
    layout.operator(checking.HALFSPACE_OT_check.bl_idname, icon="VIEWZOOM")
    found = None if tree is None else checking.last(tree)
    if tree is None or found is None:
        if known or tree is not None:
            layout.label(text=known or choice.NOT_COMPARED, icon="INFO")
        return
    # State the errors, then the speeds of each ray set.
    errors, what = found.errors, f"{found.errors.rays:,} answers of {tree.label}"
    if found.right:
        wrapped(layout, f"{what} are those of brute force, bit for bit", icon="CHECKMARK")
    else:
        kinds = f"{errors.false_miss} hits lost, {errors.false_hit} invented, {errors.wrong_triangle} other triangles"
        wrong = f"{errors.wrong} of {what} differ from brute force"
        wrapped(layout, f"{wrong}: {kinds}, the others in t, u or v", icon="ERROR")
    grid = layout.grid_flow(row_major=True, columns=4, even_columns=False)
    for text in ("Rays", "Mray/s", "Steps", "Tests"):
        grid.label(text=text)
    for name, speed in found.mrays_s.items():
        for text in (name, f"{speed:.2f}", f"{found.steps[name]:.1f}", f"{found.tests[name]:.1f}"):
            grid.label(text=text)


def _shape_properties(light: Any) -> tuple[str, ...]:
    match light.type:
        case "POINT":
            return ("shadow_soft_size",)
        case "SPOT":
            return ("shadow_soft_size", "spot_size", "spot_blend")
        case "SUN":
            return ("angle",)
    two_sizes = light.shape in ("RECTANGLE", "ELLIPSE")
    return ("shape", "size", "size_y") if two_sizes else ("shape", "size")


def _surface(layout: Any, block: Any, plain: str) -> None:
    """Draw the inputs of the shader at a material's or a world's output, or the plain colour without nodes."""
    layout.use_property_split = True
    output = output_node(block.node_tree) if block.node_tree is not None else None
    if output is None:
        layout.prop(block, plain)
    else:
        layout.template_node_view(block.node_tree, output, output.inputs["Surface"])


CLASSES = (
    HALFSPACE_PT_structure,
    HALFSPACE_PT_sampling,
    HALFSPACE_PT_film,
    HALFSPACE_PT_statistics,
    HALFSPACE_PT_passes,
    HALFSPACE_PT_material,
    HALFSPACE_PT_world,
    HALFSPACE_PT_light,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the 3D viewport's sidebar, tab "Halfspace": the structure and its overlay. They work with any engine."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.base import native
from ...core.inspector import beside
from ...core.inspector import replay as replays
from ...core.overlay import planes
from ..inspector import second
from ..measure import checking, cost_maps
from ..overlay import choosing, drawing, picking, replaying
from ..render.engine import ENGINE
from ..session import building, trees
from ..settings import properties
from . import inspector_panels, panels, structure
from .texts import counted, fold, wrapped


class HALFSPACE_PT_view_structure(panels.SidebarPanel, bpy.types.Panel):
    """Settings of the structure, and the state of the last one built."""

    bl_label = "Structure"
    section = "Structure"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return True  # without the native module it shows the reason

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        if problem := native.problem():
            wrapped(layout, problem, icon="ERROR")
            return
        group = context.scene.halfspace
        structure.draw(layout.column(), group)
        layout.operator("halfspace.build_structure", icon="MOD_BUILD")
        if (done := building.progress()) is not None:
            layout.progress(factor=done, text="Building")
        if problem := building.problem():
            wrapped(layout, problem, icon="ERROR")
        _tree(layout, context.scene, group)


def _tree(layout: Any, scene: Any, group: Any) -> None:
    """Properties of the last structure, and whether scene and settings have changed since."""
    tree = trees.last(scene)
    if tree is None:
        layout.label(text="Nothing built yet", icon="INFO")
        return
    numbers = tree.structure.statistics
    row = layout.row()
    column = row.column(align=True)
    column.label(text=tree.label)
    column.label(text=f"{tree.count:,} triangles")
    made = f"Refitted in {numbers['refit_seconds']:.3f} s" if numbers.get("refits") else ""
    made = made or f"Built in {numbers['build_seconds']:.2f} s"
    column.label(text=f"{made}, {checking.words(tree)}")
    column.label(text=f"{numbers['bytes'] / 2**20:.1f} MiB")
    nodes = numbers["nodes_axis"] + numbers["nodes_oblique"]
    column.label(text=f"{counted(nodes, 'node')}, {counted(numbers['leaves'], 'leaf', 'leaves')}")
    column.label(text=f"Depth {numbers['depth_max']}")
    row.operator("halfspace.free_structure", text="", icon="X")
    if tree.stale:
        layout.label(text="The scene has changed since", icon="ERROR")
    elif tree.spec != properties.spec(group):
        layout.label(text="Built with other settings", icon="ERROR")


class HALFSPACE_PT_view_statistics(panels.SidebarPanel, bpy.types.Panel):
    """Costs of the last structure, and the check of its answers, for engines without the panel of the last picture."""

    bl_label = "Statistics"
    bl_options = {"DEFAULT_CLOSED"}
    section = "Statistics"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.engine != ENGINE

    def draw(self, context: Any) -> None:
        panels.of_tree(self.layout, trees.last(context.scene))


class HALFSPACE_PT_view_overlay(panels.SidebarPanel, bpy.types.Panel):
    """Settings of the overlay."""

    bl_label = "Overlay"
    section = "Overlay"

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.halfspace.overlay, "show", text="")

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.halfspace.overlay
        layout.active = settings.show
        # Select the parts.
        parts = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
        parts.use_property_split = False
        for part in choosing.PARTS:
            parts.prop_enum(settings, "parts", part)
        # Show the settings of the selected parts only.
        if "PLANES" in settings.parts:
            area = getattr(context, "area", None)
            region = next((one for one in area.regions if one.type == "WINDOW"), None) if area is not None else None
            shown = drawing.shown(context.scene, "PLANES", None if region is None else region.as_pointer())
            _depth_and_kinds(layout, settings, trees.last(context.scene), shown)
        if "CELLS" in settings.parts:
            layout.prop(settings, "least")
        if "BEAM" in settings.parts:
            layout.prop(settings, "beam_spacing")
        # Show the numbers of the last drawing.
        if settings.show:
            if "PLANES" in settings.parts:
                _planes(layout, drawing.shown(context.scene, "PLANES"), trees.last(context.scene))
            if "CELLS" in settings.parts:
                _cells(layout, drawing.shown(context.scene, "CELLS"))
        layout.prop(settings, "auto_update")
        if (column := fold(layout, "look", "Look")) is not None:
            _look(column, settings)


def _look(column: Any, settings: Any) -> None:
    """The look of lines and surfaces."""
    column.row().prop(settings, "style", expand=True)
    column.prop(settings, "opacity")
    column.prop(settings, "behind")
    if settings.style != "FILL":
        column.prop(settings, "line_width")
    column.prop(settings, "max_count")
    column.prop(settings, "cuts")
    column.prop(settings, "legend")


def _depth_and_kinds(layout: Any, settings: Any, tree: trees.Tree | None, shown: Any = None) -> None:
    """Both ends of the depth, or what is chosen automatically; buttons of the kinds that the tree has, once there is
    one. shown: the planes in this view, or None.
    """
    survey = tree.known_survey if tree is not None else None
    column = layout.column(align=True)
    column.prop(settings, "depth_auto")
    if settings.depth_auto and survey is not None and shown is not None:
        column.label(text=_chosen(shown, len(survey.counts) - 1))
    row = column.row(align=True)
    row.use_property_split = False
    row.prop(settings, "depth_min", text="From", slider=True)
    row.prop(settings, "depth_max", text="To", slider=True)
    if settings.depth_auto and survey is not None and survey.grid is not None:
        column.prop(settings, "slice_axis")
        if settings.slice_axis != "AUTO":
            column.prop(settings, "slice_place", slider=True)
    flow = layout.grid_flow(row_major=True, columns=3, even_columns=True, align=True)
    flow.use_property_split = False
    for kind in () if survey is None else survey.kinds:
        flow.prop_enum(settings, "kinds", kind)


def _chosen(shown: planes.Planes, deepest: int) -> str:
    """The automatic choice for a structure with levels 0 to `deepest`."""
    if shown.across >= 0:
        return f"One layer of cells across {planes.KINDS[shown.across]}"
    plain = shown.depth[: len(shown) - shown.marked]
    return f"Levels up to {int(plain.max(initial=0))} of {max(deepest, 0)}"


def _planes(layout: Any, shown: Any, tree: trees.Tree | None) -> None:
    """The number of planes shown, and of those hidden by the limit; the built-in scene, where there is none."""
    if shown is None:
        return
    survey = None if tree is None else tree.known_survey
    if survey is not None and not survey.counts.any():
        wrapped(layout, "No planes: so few triangles are one leaf", icon="INFO")
        layout.operator("halfspace.showcase", icon="SCENE_DATA")
        return
    layout.label(text=f"{counted(len(shown), 'plane')} shown")
    if shown.hidden or not shown.complete:
        least = "" if shown.complete else "at least "
        layout.label(text=f"{least}{shown.hidden:,} hidden by the limit", icon="HIDE_ON")


def _cells(layout: Any, cells: Any) -> None:
    """The number of leaves shown and hidden, and the meaning of their colours."""
    if cells is None:
        return
    fullest = f", up to {int(cells.count.max()):,} triangles each" if len(cells) else ""
    layout.label(text=f"{counted(len(cells), 'leaf', 'leaves')} shown{fullest}")
    if cells.hidden:
        layout.label(text=f"{cells.hidden:,} hidden by the limit", icon="HIDE_ON")


class HALFSPACE_PT_view_ray(panels.SidebarPanel, bpy.types.Panel):
    """The path of one ray."""

    bl_label = "One Ray"
    section = "One Ray"

    def draw(self, context: Any) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.operator(picking.HALFSPACE_OT_pick_ray.bl_idname, icon="EYEDROPPER")
        row.operator(picking.HALFSPACE_OT_forget_ray.bl_idname, text="", icon="X")
        _replay(layout, context.scene)
        for part in ("RAY", "BEAM"):
            found = drawing.shown(context.scene, part) if part in context.scene.halfspace.overlay.parts else None
            for line in found.lines() if found is not None else ():
                layout.label(text=line)
        _ray_beside(layout, context.scene)


def _ray_beside(layout: Any, scene: Any) -> None:
    """The picked ray in the last structure and in the second one, side by side."""
    layout.prop(scene.halfspace, "second")
    tree = trees.last(scene)
    if tree is None or picking.last(scene) is None or not second.chosen(scene):
        return
    found = second.paths(scene)
    if found is None:
        layout.operator(second.HALFSPACE_OT_build_second.bl_idname, icon="MOD_BUILD")
    else:
        inspector_panels.beside_rows(layout, (tree.spec, second.chosen(scene)), beside.of_paths(*found))


def _replay(layout: Any, scene: Any) -> None:
    """The slider that replays the picked ray, with the numbers of its step."""
    if picking.last(scene) is None:
        return
    settings, tree = scene.halfspace.inspector, trees.last(scene)
    column = layout.column(align=True)
    column.prop(settings, "replaying")
    if not settings.replaying:
        return
    column.prop(settings, "step", slider=False)
    found = replaying.known(scene)
    if tree is None or tree.known_table is None or found is None:
        return
    step = min(settings.step, len(found))
    column.label(text=f"Step {step:,} of {len(found):,}")
    for line in replays.words(tree.known_table, found.steps[step - 1]) if step else ():
        column.label(text=line)
    column.label(text=f"So far {found.inner(step):,} inner nodes, {found.tested(step):,} tests")
    if found.hidden:
        column.label(text=f"{found.hidden:,} more nodes before the hit was known")
    column.operator("halfspace.go_to_node", text="Select This Node", icon="OUTLINER_OB_MESH").to = "STEP"
    inspector_panels.export(column, "STEPS")


class HALFSPACE_PT_view_costs(panels.SidebarPanel, bpy.types.Panel):
    """Cost maps of the pixels."""

    bl_label = "Cost Maps"
    bl_options = {"DEFAULT_CLOSED"}
    section = "Cost Maps"

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.scene.halfspace, "cost")
        layout.prop(context.scene.halfspace, "second")
        layout.operator(cost_maps.HALFSPACE_OT_cost_map.bl_idname, icon="IMAGE_DATA")
        inspector_panels.range_and_cursor(layout, context.scene)


def _popover(panel: Any, context: Any) -> None:
    """A line in Blender's own overlays popover."""
    if native.problem() is None:
        panel.layout.separator()
        panel.layout.prop(context.scene.halfspace.overlay, "show", text="Halfspace Structure")


CLASSES = tuple(sorted(panels.registered(globals()), key=lambda panel: panel is not HALFSPACE_PT_view_overlay))
"""The overlay, which the tab is for, comes first."""


def register() -> None:
    """Add the line in the overlays popover."""
    bpy.types.VIEW3D_PT_overlay.append(_popover)


def unregister() -> None:
    """Undo `register`."""
    bpy.types.VIEW3D_PT_overlay.remove(_popover)

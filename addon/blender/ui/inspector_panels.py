# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the inspector: the tree, its worst rays and its levels in 3D views, and the maps in Image Editors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

from ...core.inspector import beside, node_view
from ...core.inspector.beside import Row
from ...core.measure import costmap
from ...core.tree.table import KIND_LABELS
from ..inspector import exporting, levels, second, worst
from ..measure import cost_maps
from ..session import trees
from . import histogram_icons, panels
from .texts import wrapped

MOST_CHILDREN = 8
"""Number of children that are listed on a page, each with a button."""


class _InspectorPanel(panels.SidebarPanel):
    bl_options = {"DEFAULT_CLOSED"}


def _tree(layout: Any, scene: Any) -> trees.Tree | None:
    """The last structure; without one, a button that builds it."""
    tree = trees.last(scene)
    if tree is None:
        layout.label(text="Nothing built yet", icon="INFO")
        layout.operator("halfspace.build_structure", icon="MOD_BUILD")
    return tree


class HALFSPACE_PT_view_tree(_InspectorPanel, bpy.types.Panel):
    """The tree, node by node."""

    bl_label = "Tree"
    section = "Tree"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_decorate = False
        settings = scene.halfspace.inspector
        tree = _tree(layout, scene)
        if tree is None:
            if settings.isolated:
                layout.prop(settings, "isolated")
            return
        row = layout.row(align=True)
        for to, text, icon in (
            ("ROOT", "Root", "TRIA_UP_BAR"),
            ("PARENT", "Parent", "TRIA_UP"),
            ("PREVIOUS", "", "TRIA_LEFT"),
            ("NEXT", "", "TRIA_RIGHT"),
        ):
            row.operator("halfspace.go_to_node", text=text, icon=icon).to = to
        row = layout.row(align=True)
        row.operator("halfspace.go_to_node", text="Costliest Child", icon="TRIA_DOWN").to = "COSTLIEST"
        row.operator("halfspace.go_to_node", text="Costliest Leaf", icon="TRIA_DOWN_BAR").to = "LEAF"
        row = layout.row(align=True)
        row.prop(settings, "node")
        row.operator("halfspace.frame_node", text="", icon="VIEWZOOM")
        row.prop(settings, "alone", text="", icon="HIDE_ON" if settings.alone else "HIDE_OFF")
        layout.prop(settings, "isolated")
        if tree.known_table is not None:
            _node(layout, tree, settings)
        export(layout, "NODES")


def _node(layout: Any, tree: trees.Tree, settings: Any) -> None:
    """The numbers of the selected node, and a button for each child of a page."""
    table = tree.known_table
    assert table is not None, "the caller looked"
    node = settings.node if settings.node < len(table) else 0
    column = layout.column(align=True)
    for line in node_view.words(table, node):
        column.label(text=line)
    children = table.children_of(node)
    pages = -(-len(children) // MOST_CHILDREN)
    first = MOST_CHILDREN * (min(settings.page, max(pages, 1)) - 1)
    column = layout.column(align=True)
    if pages > 1:
        last = min(first + MOST_CHILDREN, len(children))
        column.label(text=f"Children {first + 1:,} to {last:,} of {len(children):,}")
        column.prop(settings, "page", text=f"Page of {pages:,}")
    whole = float(table.costs_below[0]) or 1.0
    for number, child in enumerate(children[first : first + MOST_CHILDREN].tolist(), first):
        share = table.costs_below[child] / whole
        text = f"{KIND_LABELS[table.kind[child]]}, {table.references[child]:,} triangles, {share:.1%}"
        button = column.operator("halfspace.go_to_node", text=text, icon="DOT")
        button.to, button.index = "CHILD", number


class HALFSPACE_PT_view_worst(_InspectorPanel, bpy.types.Panel):
    """The worst rays and their reasons, in two structures side by side."""

    bl_label = "Worst Rays"
    section = "Worst Rays"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_decorate = False
        tree = _tree(layout, scene)
        if tree is None:
            return
        settings = scene.halfspace.inspector
        column = layout.column(align=True)
        column.row(align=True).prop(settings, "rays", expand=True)
        column.row(align=True).prop(settings, "order", expand=True)
        column.prop(settings, "width")
        row = layout.row(align=True)
        row.operator("halfspace.worst_ray", text="Worst", icon="VIEWZOOM").move = 0
        row.operator("halfspace.worst_ray", text="", icon="TRIA_LEFT").move = -1
        row.operator("halfspace.worst_ray", text="", icon="TRIA_RIGHT").move = 1
        layout.prop(settings, "from_side")
        layout.prop(scene.halfspace, "second")
        found = worst.known(scene)
        for line in found.lines if found is not None else ():
            wrapped(layout, line)
        if found is not None and found.beside is not None and found.beside.spec == second.chosen(scene):
            beside_rows(layout, (tree.spec, found.beside.spec), found.beside.rows)
            for line in found.beside.lines:
                wrapped(layout, line)
        export(layout, "RAYS")


class HALFSPACE_PT_view_levels(_InspectorPanel, bpy.types.Panel):
    """The cost of each level, of two structures side by side."""

    bl_label = "Levels"
    section = "Levels"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        if _tree(layout, scene) is None:
            return
        layout.prop(scene.halfspace, "second")
        layout.operator("halfspace.measure_levels", icon="TIME")
        found = levels.known(scene)
        if found is None:
            return
        other = found.beside
        if other is not None and other.spec == second.chosen(scene):
            settings = scene.halfspace.inspector
            for name, measured in zip(beside.titles((found.spec, other.spec)), (found, other), strict=True):
                layout.label(text=name)
                for line in measured.lines:
                    wrapped(layout, line)
            layout.row(align=True).prop(settings, "column", expand=True)
            rows = beside.of_levels(found.levels, other.levels, settings.column)
            title = f"Level, {beside.COLUMNS[settings.column]}"
            beside_rows(layout, (found.spec, other.spec), rows, title)
        else:
            _levels(layout, found)
        export(layout, "LEVELS")
        export(layout, "PAGE")


def _levels(layout: Any, found: levels.Measured) -> None:
    """All numbers of the levels of one structure."""
    for line in found.lines:
        wrapped(layout, line)
    grid = layout.grid_flow(row_major=True, columns=len(beside.COLUMNS) + 1, even_columns=True, align=True)
    for title in ("Level", *beside.COLUMNS.values()):
        grid.label(text=title)
    for level in found.levels.levels:
        grid.label(text=f"{level.level}")
        for key in beside.COLUMNS:
            grid.label(text=beside.cell(level, key))


def beside_rows(layout: Any, specs: tuple[str, str], rows: Sequence[Row], title: str = "") -> None:
    """Numbers of two structures in columns under their names."""
    grid = layout.grid_flow(row_major=True, columns=3, even_columns=True, align=True)
    for text in (title, *beside.titles(specs)):
        grid.label(text=text)
    for row in rows:
        for text in row:
            grid.label(text=text)


class HALFSPACE_PT_image_maps(_InspectorPanel, bpy.types.Panel):
    """The range and the cursor of the cost maps."""

    bl_space_type = "IMAGE_EDITOR"
    bl_label = "Cost Map"
    bl_options = set()
    section = "Cost Maps"

    def draw(self, context: Any) -> None:
        range_and_cursor(self.layout, context.scene)


def range_and_cursor(layout: Any, scene: Any) -> None:
    """Each map's histogram with the ends of its range under it, the numbers under the cursor, and the files of the
    last cost map.
    """
    kept = cost_maps.KEPT.of(scene)
    if kept is None:
        layout.label(text="No cost map yet", icon="INFO")
        return
    # Each map has a range of its own.
    end = costmap.scale_end([values for _, values in kept.maps])
    for number, ((title, values), own) in enumerate(zip(kept.maps, kept.ranges(scene), strict=True)):
        if own is None:
            continue
        column = layout.column(align=True)
        if len(kept.maps) > 1:
            column.label(text=title)
        histogram_icons.draw(column, number, values, (own.low / 100 * end, own.high / 100 * end, end))
        row = column.row(align=True)
        row.prop(own, "low", text="From", slider=True)
        row.prop(own, "high", text="To", slider=True)
    layout.operator("halfspace.map_cursor", icon="EYEDROPPER")
    if kept.cursor is not None:
        column, row_number = kept.cursor
        for title, values in kept.maps:
            layout.label(text=f"{title}: {values[row_number, column]:,.4g}")
    export(layout, "MAP")
    export(layout, "PICTURE")


def export(layout: Any, what: str) -> None:
    """A button that writes a file."""
    label = next(name for key, name, *_ in exporting.WHAT if key == what)
    layout.operator("halfspace.export_inspector", text=f"Export {label}", icon="EXPORT").what = what


CLASSES = panels.registered(globals())

# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.halfspace.overlay`: settings of the structure's display in the 3D viewport."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ...core.overlay.planes import KINDS
from . import signals

DEEPEST = 60

KIND_ITEMS = (
    ("X", "X", "Planes across the X axis, in its colour"),
    ("Y", "Y", "Planes across the Y axis, in its colour"),
    ("Z", "Z", "Planes across the Z axis, in its colour"),
    ("OBLIQUE", "Oblique", "Planes that are not perpendicular to an axis"),
    ("SLABS", "Slabs", "Pairs of planes between which the triangles of a child lie"),
    ("OCTANTS", "Octants", "The three planes of a node with eight children"),
    ("BOXES", "Boxes", "The faces of a box around the triangles of a node"),
)
assert tuple(item[0] for item in KIND_ITEMS) == KINDS


def _redraw(group: Any, _context: Any) -> None:
    signals.look_changed.fire(group.id_data)


def _start_changed(group: Any, context: Any) -> None:
    """A depth was chosen by hand: the other end makes room for it."""
    group.depth_auto = False
    if group.depth_max < group.depth_min:
        group.depth_max = group.depth_min
    _redraw(group, context)


def _end_changed(group: Any, context: Any) -> None:
    group.depth_auto = False
    if group.depth_min > group.depth_max:
        group.depth_min = group.depth_max
    _redraw(group, context)


def _follow(group: Any, _context: Any) -> None:
    signals.visibility_changed.fire(group.id_data)


def _rebuild(group: Any, _context: Any) -> None:
    signals.structure_changed.fire(group.id_data)


class HalfspaceOverlaySettings(bpy.types.PropertyGroup):
    """Settings of the structure's display in the viewport."""

    show: BoolProperty(  # type: ignore[valid-type]
        name="Structure",
        description="Show the structure over the scene: its planes, its leaves, the path of a ray",
        default=False,
        update=_follow,
    )
    parts: EnumProperty(  # type: ignore[valid-type]
        name="Show",
        description="What of the structure is shown. Shift-click for several",
        items=[
            ("PLANES", "Planes", "The planes that split space, each cut to its cell", 1),
            ("CELLS", "Leaves", "The cells of leaves, the brighter the more triangles they hold", 2),
            ("RAY", "Ray", "The path of the picked ray: its cells in order, planes and triangles", 4),
            ("BEAM", "Beam", "The tile of rays around it: its leaves, or its polygons in each cell of an octree", 8),
            ("NODE", "Node", "The node selected in the inspector, with its children and their triangles", 16),
        ],
        options={"ENUM_FLAG"},
        default={"PLANES", "RAY"},
        update=_redraw,
    )
    least: IntProperty(  # type: ignore[valid-type]
        name="From Triangles",
        description="Smallest number of triangles of the leaves that are shown. Higher values show only where the "
        "structure splits too little",
        default=1,
        min=0,
        soft_max=64,
        update=_redraw,
    )
    auto_update: BoolProperty(  # type: ignore[valid-type]
        name="Auto Update",
        description="Build again, in the background, a moment after the scene or the structure's settings changed. "
        "Large scenes keep all cores busy meanwhile",
        default=True,
        update=_rebuild,
    )
    depth_min: IntProperty(  # type: ignore[valid-type]
        name="Depth From",
        description="Smallest depth of nodes whose planes are shown; the root has depth 0",
        default=0,
        min=0,
        max=DEEPEST,
        update=_start_changed,
    )
    depth_max: IntProperty(  # type: ignore[valid-type]
        name="To",
        description="Largest depth of nodes whose planes are shown. Each level has at most twice as many as the last",
        default=6,
        min=0,
        max=DEEPEST,
        update=_end_changed,
    )
    depth_auto: BoolProperty(  # type: ignore[valid-type]
        name="Depth Automatic",
        description="Show the levels from the root on that a line of sight from the view's place can pass: four or "
        "five surfaces behind each other; the highest oblique planes or turned boxes besides; of a grid one layer of "
        "cells. Moving an end of the depth turns this off",
        default=True,
        update=_redraw,
    )
    cuts: BoolProperty(  # type: ignore[valid-type]
        name="Cuts",
        description="Draw bold lines on the scene where planes cut it, of the shallowest and the oblique planes first",
        default=True,
        update=_redraw,
    )
    slice_axis: EnumProperty(  # type: ignore[valid-type]
        name="Slice",
        description="Of a grid: the axis across which the layer of cells lies that is shown",
        items=[
            ("AUTO", "Automatic", "The layer that is seen best from the view's place", 0),
            ("X", "X", "A layer across X", 1),
            ("Y", "Y", "A layer across Y", 2),
            ("Z", "Z", "A layer across Z", 3),
        ],
        default="AUTO",
        update=_redraw,
    )
    slice_place: FloatProperty(  # type: ignore[valid-type]
        name="Place",
        description="Of a grid: place of the layer along its axis, from the first to the last one",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_redraw,
    )
    legend: BoolProperty(  # type: ignore[valid-type]
        name="Legend",
        description="Explain the colours in the corner of the view",
        default=True,
        update=_redraw,
    )
    kinds: EnumProperty(  # type: ignore[valid-type]
        name="Kinds",
        description="Which planes are shown. Shift-click for several",
        items=[(*item, 1 << number) for number, item in enumerate(KIND_ITEMS)],
        options={"ENUM_FLAG"},
        default=set(KINDS),
        update=_redraw,
    )
    style: EnumProperty(  # type: ignore[valid-type]
        name="Style",
        description="How planes are drawn",
        items=[
            ("OUTLINE", "Outline", "Lines along the edges of planes", 0),
            ("FILL", "Fill", "Translucent surfaces", 1),
            ("BOTH", "Both", "Translucent surfaces with lines along their edges", 2),
        ],
        default="BOTH",
        update=_redraw,
    )
    opacity: FloatProperty(  # type: ignore[valid-type]
        name="Opacity",
        description="Opacity of the shallowest planes; deeper ones are fainter",
        default=0.9,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_redraw,
    )
    line_width: FloatProperty(  # type: ignore[valid-type]
        name="Line Width",
        description="Line width of the shallowest planes; deeper ones are thinner",
        default=2.5,
        min=1.0,
        max=10.0,
        subtype="PIXEL",
        update=_redraw,
    )
    beam_spacing: FloatProperty(  # type: ignore[valid-type]
        name="Beam Spacing",
        description="Distance between two rays of the tile, in pixels of the view in which the ray was picked. "
        "Larger values give a wider beam, whose rays share fewer cells",
        default=4.0,
        min=0.1,
        soft_max=32.0,
        max=1000.0,
        subtype="PIXEL",
        update=_redraw,
    )
    behind: FloatProperty(  # type: ignore[valid-type]
        name="Behind",
        description="How much of the opacity remains where objects are in front of a plane",
        default=0.15,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_redraw,
    )
    max_count: IntProperty(  # type: ignore[valid-type]
        name="Limit",
        description="Largest number of polygons shown, for planes and for leaves, shallowest and fullest first. More "
        "take longer to draw",
        default=20_000,
        min=1,
        soft_max=100_000,
        max=400_000,
        update=_redraw,
    )


CLASSES = (HalfspaceOverlaySettings,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.halfspace.inspector`: the selected node, the step of the picked ray, the order of the worst rays, ranges."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty

from . import signals

MOST_STEPS = 100_000
"""Upper end of the step slider; a path ends earlier."""


def _redraw(group: Any, _context: Any) -> None:
    signals.look_changed.fire(group.id_data)


def _node_changed(group: Any, context: Any) -> None:
    """Another node was selected: its list of children begins at the first."""
    group.page = 1
    signals.node_changed.fire(group.id_data)
    _redraw(group, context)


def _isolation_changed(group: Any, _context: Any) -> None:
    signals.node_changed.fire(group.id_data)


def _range_changed(group: Any, _context: Any) -> None:
    signals.range_changed.fire(group.id_data)


class HalfspaceMapRange(bpy.types.PropertyGroup):
    """The range of one cost map, named by `range_name`."""

    low: FloatProperty(  # type: ignore[valid-type]
        name="From",
        description="Pixels of this map below this share of its scale lose their colour",
        default=0.0,
        min=0.0,
        max=100.0,
        subtype="PERCENTAGE",
        update=_range_changed,
    )
    high: FloatProperty(  # type: ignore[valid-type]
        name="To",
        description="Pixels of this map above this share of its scale lose their colour",
        default=100.0,
        min=0.0,
        max=100.0,
        subtype="PERCENTAGE",
        update=_range_changed,
    )


class HalfspaceInspectorSettings(bpy.types.PropertyGroup):
    """Settings of the inspector."""

    node: IntProperty(  # type: ignore[valid-type]
        name="Node",
        description="The selected node, counted in preorder; 0 is the root",
        default=0,
        min=0,
        update=_node_changed,
    )
    page: IntProperty(  # type: ignore[valid-type]
        name="Page",
        description="Which children of the node are listed, eight to a page",
        default=1,
        min=1,
    )
    alone: BoolProperty(  # type: ignore[valid-type]
        name="Hide Other Parts",
        description="Of the overlay, show the selected node, its children and its triangles alone, without planes, "
        "leaves and rays. Objects stay",
        default=False,
        update=_redraw,
    )
    isolated: BoolProperty(  # type: ignore[valid-type]
        name="Isolate Objects",
        description="Show only the objects that triangles of the selected node belong to, in Blender's local view. "
        "Off shows all objects again",
        default=False,
        update=_isolation_changed,
    )
    from_side: BoolProperty(  # type: ignore[valid-type]
        name="From the Side",
        description="Turn the 3D view to the side of the worst ray, which is a dot in the camera's view",
        default=True,
    )
    replaying: BoolProperty(  # type: ignore[valid-type]
        name="Step by Step",
        description="Show the picked ray up to one step of its traversal",
        default=False,
        update=_redraw,
    )
    step: IntProperty(  # type: ignore[valid-type]
        name="Step",
        description="Number of visited nodes up to which the ray is shown. Drag to replay the traversal",
        default=1,
        min=1,
        max=MOST_STEPS,
        update=_redraw,
    )
    rays: EnumProperty(  # type: ignore[valid-type]
        name="Rays",
        description="Which rays are searched for the worst",
        items=[
            ("primary", "Camera", "One ray through the centre of each pixel", 0),
            ("shadow", "Shadow", "From the surface that each camera ray hits to one light", 1),
            ("diffuse", "Bounce", "From there in a random direction", 2),
        ],
        default="primary",
    )
    order: EnumProperty(  # type: ignore[valid-type]
        name="By",
        description="What makes a ray bad",
        items=[
            ("STEPS", "Steps", "Nodes visited, leaves included", 0),
            ("TESTS", "Tests", "Triangles tested", 1),
            ("TIME", "Time", "Nanoseconds per ray of 64 neighbours, as they are traced for a picture", 2),
        ],
        default="STEPS",
    )
    width: IntProperty(  # type: ignore[valid-type]
        name="Width",
        description="Number of camera rays side by side that are searched",
        default=256,
        min=8,
        max=2048,
    )
    ranges: CollectionProperty(type=HalfspaceMapRange)  # type: ignore[valid-type]
    column: EnumProperty(  # type: ignore[valid-type]
        name="Column",
        description="Which numbers of the levels are side by side",
        items=[
            ("NODES", "Nodes", "Nodes and leaves", 0),
            ("SAH", "SAH", "Share of the expected SAH cost", 1),
            ("OVERLAP", "EPO", "End-point overlap", 2),
            ("TIME", "Time", "Nanoseconds of a camera ray, fitted", 3),
        ],
        default="SAH",
    )


def range_name(quantity: str, place: int) -> str:
    """The name of the range of a map: of the key of its quantity, and its place among the maps side by side, from 0."""
    return f"{quantity} {place}"


CLASSES = (HalfspaceMapRange, HalfspaceInspectorSettings)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: the overlay from inside and outside of a room, and isolated objects through undo and redo.

Runs inside Blender, with the extension installed; see `panel_steps.py`. What each view shows, and which objects are
visible after each step, are written as JSON to overlay_steps.json in the folder of the pictures.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector
from window_areas import EXTENSION, area_of, within

OUT = Path(os.environ.get("WINDOW_OUT", "/job/out"))

STRUCTURES = ("octree-net", "bvh-sah", "grid", "kd")

VIEWS = {"inside": ((-8.0, -4.5, 1.7), (3.0, 1.0, 1.5)), "outside": ((26.0, -24.0, 19.0), (0.0, 0.0, 2.0))}
"""Eye and target of each view."""

found: dict[str, Any] = {}


def furnish() -> None:
    """A room with columns and boxes; Blender's cube stays in the middle."""
    scene = bpy.context.scene
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 2.5))
    room = bpy.context.object
    room.name, room.scale = "Room", (10, 6, 2.5)
    room.display_type = "WIRE"
    for x in range(-8, 9, 4):
        for y in (-3, 3):
            bpy.ops.mesh.primitive_cylinder_add(radius=0.4, depth=5, location=(x, y, 2.5))
            bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(x + 2, y / 2, 0.5))
    for item in scene.objects:
        item.select_set(item.name == "Cube")


def look(area: Any, name: str) -> None:
    """Place the view."""
    eye, target = (Vector(place) for place in VIEWS[name])
    view = area.spaces.active.region_3d
    view.view_perspective = "PERSP"
    view.view_rotation = (target - eye).to_track_quat("-Z", "Y")
    view.view_distance = (target - eye).length
    view.view_location = target


def visible(area: Any) -> list[str]:
    """Names of the visible objects with triangles."""
    bpy.context.view_layer.update()
    space = area.spaces.active
    items = bpy.context.scene.objects
    return sorted(item.name for item in items if item.type == "MESH" and item.visible_in_viewport_get(space))


def planes(area: Any) -> Iterator[Any]:
    """Show what is shown at first of each structure, in each view."""
    drawing = sys.modules[f"{EXTENSION}.blender.overlay.drawing"]
    scene = bpy.context.scene
    settings = scene.halfspace.overlay
    settings.auto_update, settings.show, settings.parts = False, True, {"PLANES"}
    for structure in STRUCTURES:
        scene.halfspace.structure = structure
        with within(area):
            bpy.ops.halfspace.build_structure()
        for name in VIEWS:
            look(area, name)
            yield 1.5
            shown = drawing.shown(scene, "PLANES", area.as_pointer())
            found[f"{structure} {name}"] = [len(shown), shown.levels.start, shown.levels.stop, shown.across]
            yield f"{structure}-{name}"


def isolation(area: Any) -> Iterator[Any]:
    """Isolate the objects of a node, undo, redo, and show everything again."""
    found["before"] = visible(area)
    with within(area):
        bpy.ops.halfspace.go_to_node(to="LEAF")
        bpy.ops.ed.undo_push(message="Before")
    bpy.context.scene.halfspace.inspector.isolated = True
    with within(area):
        bpy.ops.ed.undo_push(message="Isolated")
    yield 1.0
    found["isolated"] = visible(area)
    yield "isolated"
    for step in ("undo", "redo"):
        with within(area):
            getattr(bpy.ops.ed, step)()
        yield 1.0
        found[step] = visible(area)
        yield step
    bpy.context.scene.halfspace.inspector.isolated = False
    yield 1.0
    found["after"] = visible(area)
    found["local"] = area.spaces.active.local_view is not None
    found["selected"] = sorted(item.name for item in bpy.context.view_layer.objects.selected)


def steps() -> Iterator[Any]:
    """Show the overlay, then isolated objects."""
    furnish()
    area = area_of("VIEW_3D")
    yield 0.5
    yield from planes(area)
    yield from isolation(area)
    (OUT / "overlay_steps.json").write_text(json.dumps(found), encoding="utf-8")

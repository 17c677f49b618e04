# SPDX-License-Identifier: GPL-3.0-or-later
"""The last structure that was built, by a render or on demand, for whoever wants to look at it. Never saved.

Only one is kept, of whatever scene, since a tree over millions of triangles takes hundreds of megabytes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import bpy

from ..core.scene import F64

IGNORED_TYPES = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Objects that can move without any triangle moving."""


@dataclass(eq=False)
class Tree:
    """A native structure in the scene frame whose origin lies at `origin` (3,) in the world.

    stale: the scene has changed since. number: of all structures, so that what was made from one can be told from
    what was made from the next without keeping it alive.
    """

    structure: Any
    origin: F64
    spec: str
    label: str
    triangles: int
    scene_uid: int
    stale: bool = False
    number: int = field(default_factory=itertools.count(1).__next__)


_tree: Tree | None = None


def keep(scene: Any, structure: Any, origin: F64, *, spec: str, label: str, triangles: int) -> None:
    """Remember a structure of this scene in place of the last one."""
    global _tree  # noqa: PLW0603 (one per Blender, as said above)
    _tree = Tree(structure, origin.copy(), spec, label, triangles, scene.original.session_uid)
    if not bpy.app.background:
        # Renders keep their trees from a thread of theirs; timers run where redrawing is allowed.
        bpy.app.timers.register(redraw)


def last(scene: Any) -> Tree | None:
    """The structure of this scene, if the last one is of this scene."""
    if _tree is not None and _tree.scene_uid == scene.original.session_uid:
        return _tree
    return None


def clear() -> None:
    """Forget the structure and free its memory."""
    global _tree  # noqa: PLW0603
    _tree = None
    if not bpy.app.background:
        bpy.app.timers.register(redraw)


def note_changes(scene: Any, depsgraph: Any) -> bool:
    """Mark the scene's structure as stale when an update could have moved a triangle. Returns whether one could."""
    if not any(_moves_triangles(update) for update in depsgraph.updates):
        return False
    tree = last(scene)
    if tree is not None and not tree.stale:
        tree.stale = True
        redraw()
    return True


def _moves_triangles(update: Any) -> bool:
    if not (update.is_updated_geometry or update.is_updated_transform):
        return False
    item = update.id
    if isinstance(item, bpy.types.Object):
        return item.type not in IGNORED_TYPES
    # A geometry node tree or a mesh also updates the objects that use it; objects that come or go, their collection.
    return isinstance(item, bpy.types.Collection)


def redraw() -> None:
    """Ask every 3D view to draw itself again, from whatever thread."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def redraw_panels() -> None:
    """Ask only the sidebars and the properties to draw themselves again: progress must not cost a 3D view."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
            elif area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()

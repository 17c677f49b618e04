# SPDX-License-Identifier: GPL-3.0-or-later
"""The last structure that was built, by a render or on demand, for whoever wants to look at it. Never saved.

Only one is kept, of whatever scene, since a tree over millions of triangles takes hundreds of megabytes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...core.base.arrays import F32, F64, I32
from ...core.scene.scene import Geometry

IGNORED_TYPES = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Objects that can move without any triangle moving."""


@dataclass(eq=False)
class Tree:
    """A native structure in the scene frame whose origin lies at `origin` (3,) in the world.

    vertices, triangles: (n, 3) float32 and (m, 3) int32, what it was built over. A render need not show what the
    viewport shows, and the scene goes on: whoever compares its answers needs these very triangles, and the native
    structure does not give them back. read: the scene's `moment` when they were read. number: of all structures, so
    that what was made from one can be told from what was made from the next without keeping it alive.
    """

    structure: Any
    origin: F64
    vertices: F32
    triangles: I32
    spec: str
    label: str
    scene_uid: int
    read: int
    number: int = field(default_factory=itertools.count(1).__next__)

    @property
    def count(self) -> int:
        """How many triangles there are."""
        return len(self.triangles)

    @property
    def stale(self) -> bool:
        """Whether triangles of the scene may have moved since they were read."""
        return moved(self.scene_uid, self.read)


_tree: Tree | None = None

_moments: dict[int, int] = {}
"""How often triangles have moved, by the scene's number."""

_frames: dict[int, float] = {}
"""The frame at which that was last known."""


def moment(scene: Any) -> int:
    """To be asked before the scene is read, and kept with what was read: it changes when triangles move."""
    uid = scene.original.session_uid
    _frames[uid] = scene.frame_float
    return _moments.setdefault(uid, 0)


def moved(scene_uid: int, read: int) -> bool:
    """Whether triangles of this scene may have moved since that moment."""
    return read != _moments.get(scene_uid, 0)


def keep(scene: Any, structure: Any, geometry: Geometry, *, spec: str, label: str, read: int) -> Tree:
    """Remember a structure of this scene, built over this geometry, in place of the last one.

    Of the geometry only what a `Tree` says is kept: its normals and UVs can take more memory than its triangles.
    """
    global _tree  # noqa: PLW0603 (one per Blender, as said above)
    uid, origin = scene.original.session_uid, geometry.origin.copy()
    _tree = Tree(structure, origin, geometry.vertices, geometry.triangles, spec, label, uid, read)
    if not bpy.app.background:
        # Renders keep their trees from a thread of theirs; timers run where redrawing is allowed.
        bpy.app.timers.register(redraw)
    return _tree


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


def scene_of(uid: int) -> Any:
    """The scene with this number, None if it is gone."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == uid), None)


def usable(scene: Any, spec: str) -> Tree | None:
    """The structure of this scene, if it is this configuration and triangles have not moved since."""
    tree = last(scene)
    return tree if tree is not None and tree.spec == spec and not tree.stale else None


def note_changes(scene: Any, depsgraph: Any) -> bool:
    """Go on to another moment when an update could have moved a triangle. Returns whether one could."""
    if not any(_moves_triangles(update) for update in depsgraph.updates):
        return False
    tree, uid = last(scene), scene.original.session_uid
    fresh = tree is not None and not tree.stale
    _moments[uid] = _moments.get(uid, 0) + 1
    if fresh:
        redraw()
    return True


def note_frame(scene: Any, depsgraph: Any) -> bool:
    """The same when a frame was evaluated, if it is another one: each render ends with the frame that it began with."""
    uid, frame = scene.original.session_uid, scene.frame_float
    if _frames.get(uid) == frame:
        return False
    _frames[uid] = frame
    return note_changes(scene, depsgraph)


def forget_moments() -> None:
    """Start anew, when nothing that was read is kept any more."""
    _moments.clear()
    _frames.clear()


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""The last built structure, of a render or on demand, for inspection. Never saved.

Only one is kept for all scenes, because a tree over millions of triangles takes hundreds of megabytes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...core.base.arrays import F32, F64, I32
from ...core.measure.check import Check
from ...core.overlay import depths
from ...core.overlay.depths import Survey
from ...core.scene.owners import owners
from ...core.scene.scene import Geometry, Source
from ...core.tree import table
from ...core.tree.table import Table
from .. import state
from ..settings import signals
from ..state import SceneState, Slot

IGNORED_TYPES = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Objects that can move without any triangle moving."""


NUMBERS = itertools.count(1)
"""The numbers of trees."""


@dataclass(eq=False)
class Tree:
    """A native structure in the scene frame whose origin is at `origin` (3,) in world space.

    vertices, triangles: (n, 3) float32 and (m, 3) int32, its input. They are needed to check its answers: the native
    structure does not return them, and the scene may have changed or differ between render and viewport. sources: the
    objects of the triangles. state, read: of the scene, and its `moment` when the triangles were read. number: a unique
    id, which outlives the structure. known_table, known_survey: results of `table` and `survey` once they were called;
    panels show only what is known. check: of its answers, once it was made.
    """

    structure: Any
    origin: F64
    vertices: F32
    triangles: I32
    spec: str
    label: str
    state: SceneState
    read: int
    sources: tuple[Source, ...] = ()
    number: int = field(default_factory=NUMBERS.__next__, init=False)
    known_table: Table | None = field(default=None, init=False)
    known_survey: Survey | None = field(default=None, init=False)
    check: Check | None = field(default=None, init=False)

    def table(self) -> Table:
        """The nodes of the tree, read at the first call. Raises TreeError."""
        if self.known_table is None:
            self.known_table = table.read(self.structure, self.vertices, self.triangles)
            _redraw_panels_soon()
        return self.known_table

    def survey(self) -> Survey:
        """The kinds of planes and their levels, looked up at the first call."""
        if self.known_survey is None:
            self.known_survey = depths.survey(self.structure)
            _redraw_panels_soon()
        return self.known_survey

    def owners(self, triangles: I32) -> set[str]:
        """Full names of the objects that triangles, (t,) indices, belong to."""
        return owners(self.sources, triangles)

    @property
    def count(self) -> int:
        """Number of triangles."""
        return len(self.triangles)

    @property
    def stale(self) -> bool:
        """Whether triangles of the scene may have moved since they were read."""
        return self.read != self.state.moment


TREE: Slot[Tree] = Slot()

last = TREE.of
"""The last structure, if it is of this scene."""


def moment(scene: Any) -> int:
    """A number to read before the scene, and to keep with what was read: it changes when triangles move."""
    now = state.of(scene)
    now.frame = scene.frame_float
    return now.moment


def keep(scene: Any, structure: Any, geometry: Geometry, *, spec: str, label: str, read: int) -> Tree:
    """Keep a structure of this scene, built over this geometry, in place of the last one.

    Only the fields of `Tree` are kept of the geometry: normals and UVs can take more memory than the triangles.
    """
    origin, arrays = geometry.origin.copy(), (geometry.vertices, geometry.triangles)
    tree = Tree(structure, origin, *arrays, spec, label, state.of(scene), read, geometry.sources)
    TREE.keep_only(scene, tree)
    if not bpy.app.background:
        # Renders run on their own thread; timers run where redrawing is allowed.
        bpy.app.timers.register(announce)
    return tree


def announce() -> None:
    """Redraw for a new structure, and let those follow it who show parts of it."""
    redraw()
    for tree in TREE.all():
        if (scene := tree.state.scene) is not None:
            signals.tree_changed.fire(scene)


def clear() -> None:
    """Forget the structure and free its memory."""
    TREE.free()
    if not bpy.app.background:
        bpy.app.timers.register(redraw)


def stop() -> None:
    """Forget the structure, and redraw at once: no timer of the extension may outlast it."""
    clear()
    for soon in (announce, redraw, redraw_panels):
        while bpy.app.timers.is_registered(soon):
            bpy.app.timers.unregister(soon)
    redraw()


def usable(scene: Any, spec: str) -> Tree | None:
    """The structure of this scene, if it has this configuration and triangles have not moved since."""
    tree = last(scene)
    return tree if tree is not None and tree.spec == spec and not tree.stale else None


def note_changes(scene: Any, depsgraph: Any) -> bool:
    """Advance the scene's moment if an update could have moved a triangle. Returns whether one could."""
    if not any(_moves_triangles(update) for update in depsgraph.updates):
        return False
    # Redraw only when the shown tree becomes outdated.
    tree = last(scene)
    fresh = tree is not None and not tree.stale
    state.of(scene).moment = next(state.MOMENTS)
    if fresh:
        redraw()
    return True


def note_frame(scene: Any, depsgraph: Any) -> bool:
    """`note_changes` after the evaluation of a frame, if the frame is new: a render ends by evaluating its first frame
    again.
    """
    now, frame = state.of(scene), scene.frame_float
    if now.frame == frame:
        return False
    now.frame = frame
    return note_changes(scene, depsgraph)


def _moves_triangles(update: Any) -> bool:
    if not (update.is_updated_geometry or update.is_updated_transform):
        return False
    item = update.id
    if isinstance(item, bpy.types.Object):
        return item.type not in IGNORED_TYPES
    # Updates of a geometry node tree or a mesh include the objects that use it; added or removed objects, their
    # collection.
    return isinstance(item, bpy.types.Collection)


def redraw() -> None:
    """Tag every 3D view for redrawing, from any thread."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _redraw_panels_soon() -> None:
    """Let panels show what has just become known; a view that is being drawn cannot tag regions itself."""
    if not bpy.app.background:
        bpy.app.timers.register(redraw_panels)


def redraw_panels() -> None:
    """Tag only sidebars and properties for redrawing: progress must not cost a redraw of a 3D view."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
            elif area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing of the last structure in the 3D viewport: planes, leaves, the path of a ray. Drawing never builds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import bpy
import gpu
import numpy as np
from bpy.app.handlers import persistent
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...core.base.arrays import F64
from ...core.overlay import planes, sight
from ...core.overlay.legend import Entry
from .. import state
from ..measure import comparing
from ..session import building, trees
from ..settings import signals
from ..state import Slot
from . import choosing, legend, replaying

OWN_COLOURS = {
    "OBLIQUE": (1.0, 0.72, 0.16),
    "SLABS": (0.86, 0.46, 1.0),
    "OCTANTS": (0.30, 0.93, 0.82),
    "BOXES": (0.97, 0.90, 0.78),
}
"""Gold, violet, turquoise and ivory: distant from Blender's red, green and blue axes and from each other."""


@dataclass(frozen=True, eq=False)
class _Batches:
    """One level in GPU batches. A part that the style does not use is None."""

    width: float
    lines: Any
    edging: Any
    fill: Any


@dataclass(frozen=True, eq=False)
class _Drawing:
    """The batches of one part of the picture, for the tree with this number and certain settings.

    chosen: the shown data. place: of the viewer for whom `seen` describes the surfaces; empty if all planes have one.
    passes: depth test and levels, drawn in order: behind objects first, then in front of them.
    """

    tree: int
    key: tuple[Any, ...]
    chosen: Any
    place: tuple[float, ...]
    seen: planes.Panes | None
    passes: tuple[tuple[str, list[_Batches]], ...]


FORWARD = 0.002
"""Share of the distance to the viewer by which the overlay lies before surfaces."""

EDGING, EDGING_WIDTH = 0.5, 1.5
"""Opacity of the dark edging of lines relative to that of the lines, and its width on both sides together in pixels:
light lines are seen on light walls.
"""

MOST_VIEWS = 8
"""Number of 3D views whose batches are kept."""

DRAWINGS: Slot[dict[tuple[str, int], _Drawing]] = Slot()
"""By part and view, the last made at the end."""

_handles: list[Any] = []


def colours() -> dict[str, tuple[float, float, float]]:
    """The colour of each kind: the theme's axis colours, and our own."""
    theme = bpy.context.preferences.themes[0].user_interface
    axes = {"X": theme.axis_x, "Y": theme.axis_y, "Z": theme.axis_z}
    return {**{kind: (axis[0], axis[1], axis[2]) for kind, axis in axes.items()}, **OWN_COLOURS}


def shown(scene: Any, part: str = "PLANES", view: int | None = None) -> Any:
    """The last drawn data of a part of this scene in a view, for the panel's numbers: Planes, Cells, Path, Beam, or
    None. view: as for `paint`; None for any.
    """
    tree, drawings = trees.last(scene), DRAWINGS.of(scene) or {}
    found = [drawing for (of, where), drawing in drawings.items() if of == part and view in (None, where)]
    return found[-1].chosen if found and tree is not None and found[-1].tree == tree.number else None


def paint(scene: Any, size: tuple[int, int], view: int = 0) -> None:
    """Draw the scene's structure with the current matrices into a view of `size` pixels. view: a number of its own for
    each view, whose viewers may be at different places.
    """
    tree = trees.last(scene)
    if tree is None or not scene.halfspace.overlay.show:
        return
    drawings = [_drawing(scene, tree, part, view) for part in choosing.parts(scene)]
    with gpu.matrix.push_pop():
        # The matrix contains the world position, so that vertices keep their precision far from the world's origin.
        _forward(tree)
        gpu.matrix.translate(tree.origin.tolist())
        gpu.state.blend_set("ALPHA")
        gpu.state.depth_mask_set(False)
        try:
            for drawing in drawings:
                for test, levels in drawing.passes if drawing is not None else ():
                    gpu.state.depth_test_set(test)
                    _paint_levels(levels, size)
        finally:
            gpu.state.depth_test_set("NONE")
            gpu.state.blend_set("NONE")


def _forward(tree: trees.Tree) -> None:
    """Move what is drawn towards the viewer by a little, on its line of sight: lines on surfaces stay before them."""
    view = gpu.matrix.get_model_view_matrix()
    if gpu.matrix.get_projection_matrix()[3][3] != 0:
        box = tree.survey().box
        nearer = Matrix.Translation((0.0, 0.0, FORWARD * float(np.linalg.norm(box[1] - box[0]))))
    else:
        nearer = Matrix.Diagonal((1.0 - FORWARD,) * 3).to_4x4()
    gpu.matrix.load_matrix(nearer @ view)


def _paint_levels(levels: list[_Batches], size: tuple[int, int]) -> None:
    """Draw all surfaces before all lines, so that lines stay crisp."""
    surface = gpu.shader.from_builtin("SMOOTH_COLOR")
    for level in levels:
        if level.fill is not None:
            level.fill.draw(surface)
    line = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR")
    line.bind()
    line.uniform_float("viewportSize", size)
    for level in levels:
        if level.lines is not None:
            line.uniform_float("lineWidth", level.width + EDGING_WIDTH)
            level.edging.draw(line)
            line.uniform_float("lineWidth", level.width)
            level.lines.draw(line)


def _viewer(tree: trees.Tree) -> F64:
    """The place of the viewer of the current matrices, (3,) in the tree's frame, in steps of the structure."""
    box = tree.survey().box
    back = np.array(gpu.matrix.get_model_view_matrix().inverted(), np.float64)
    parallel = gpu.matrix.get_projection_matrix()[3][3] != 0
    eye = sight.parallel(-back[:3, 2], box) if parallel else back[:3, 3] - tree.origin
    return np.array(sight.rounded(eye, box))


def _drawing(scene: Any, tree: trees.Tree, part: str, view: int) -> _Drawing | None:
    """The batches of a part, rebuilt only if the tree, the ray, a setting or the place of the viewer has changed."""
    drawings = DRAWINGS.of(scene) or {}
    settings, tints = scene.halfspace.overlay, colours()
    eye = _viewer(tree) if part == "PLANES" else np.zeros(3)
    chosen_by = choosing.chosen_by(scene, tree, part, eye)
    step = replaying.step(scene) if part == "RAY" else None
    known = drawings.get((part, view))
    known = known if known is not None and known.tree == tree.number else None
    # Reuse the data if only the look has changed.
    chosen = known.chosen if known is not None and known.key[0] == chosen_by else choosing.choose(tree, part, chosen_by)
    if chosen is None:
        drawings.pop((part, view), None)
        return None
    # Surfaces that would veil the view are left out, unless nothing but surfaces is to be shown.
    place = tuple(eye.tolist()) if part == "PLANES" and settings.style != "FILL" else ()
    if known is not None and known.chosen is chosen and known.place == place:
        seen = known.seen
    else:
        seen = planes.panes(chosen, eye) if place else None
    look = (settings.style, settings.opacity, settings.line_width, settings.behind, tuple(tints.values()), step)
    look = (*look, None if seen is None else seen.key())
    if known is not None and known.key == (chosen_by, look):
        if known.place != place:
            drawings[part, view] = known = replace(known, place=place)
        return known
    # Convert the data to batches for each depth test with visible opacity.
    style = "BOTH" if part in choosing.WHOLE else settings.style
    passes = tuple(
        (test, [_batches(level, style) for level in choosing.levels(scene, part, chosen, tints, opacity, seen)])
        for test, opacity in _tests(settings, part)
        if opacity > 0
    )
    made = _Drawing(tree.number, (chosen_by, look), chosen, place, seen, passes)
    # Keep the batches of the last views only: a view may have been closed.
    drawings.pop((part, view), None)
    drawings[part, view] = made
    for former in [other for other in drawings if other[0] == part][:-MOST_VIEWS]:
        del drawings[former]
    DRAWINGS.keep(scene, drawings)
    return made


def _tests(settings: Any, part: str) -> tuple[tuple[str, float], ...]:
    """Depth tests of a part, with its opacity for each. A ray is drawn entirely, without a test; its triangles coincide
    with the surfaces of objects, where a depth test would tear them into strips.
    """
    if part in choosing.WHOLE:
        return (("ALWAYS", settings.opacity),)
    return ("GREATER", settings.opacity * settings.behind), ("LESS_EQUAL", settings.opacity)


def _batches(level: planes.Level, style: str) -> _Batches:
    line, surface = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR"), gpu.shader.from_builtin("SMOOTH_COLOR")
    lines = edging = fill = None
    if style != "FILL" and len(level.lines):
        lines = batch_for_shader(line, "LINES", {"pos": level.lines, "color": level.line_colours})
        dark = level.line_colours * np.array([0.0, 0.0, 0.0, EDGING], np.float32)
        edging = batch_for_shader(line, "LINES", {"pos": level.lines, "color": dark})
    if style != "OUTLINE" and len(level.triangles):
        fill = batch_for_shader(surface, "TRIS", {"pos": level.triangles, "color": level.fill_colours})
    return _Batches(level.width, lines, edging, fill)


def _draw_view() -> None:
    """Blender's callback for each 3D view."""
    context = bpy.context
    if context.space_data.overlay.show_overlays:
        paint(context.scene, (context.region.width, context.region.height), context.region.as_pointer())


def legend_of(scene: Any, view: int | None = None) -> list[Entry]:
    """The lines of the legend for what is drawn of this scene in a view; none if it is switched off."""
    overlay = scene.halfspace.overlay
    if not (overlay.show and overlay.legend):
        return []
    return choosing.legend_of(scene, {part: shown(scene, part, view) for part in choosing.parts(scene)}, colours())


def _draw_legend() -> None:
    """Blender's callback for the pixels of each 3D view."""
    context = bpy.context
    if context.space_data.overlay.show_overlays:
        tools = next((region for region in context.area.regions if region.type == "TOOLS"), None)
        left = tools.width if tools is not None and context.preferences.system.use_region_overlap else 0
        legend.draw(legend_of(context.scene, context.region.as_pointer()), left, context.preferences.system.ui_scale)


@persistent
def _scene_changed(scene: Any, depsgraph: Any) -> None:
    """After each evaluation: drop deleted scenes, record changes, and schedule a rebuild."""
    if depsgraph.mode != "VIEWPORT":
        return
    state.drop(kept=bpy.data.scenes)
    if trees.note_changes(scene, depsgraph):
        building.request(scene)


@persistent
def _frame_changed(scene: Any, depsgraph: Any) -> None:
    """After each evaluation of a frame, which is not among the depsgraph updates."""
    if depsgraph.mode == "VIEWPORT" and trees.note_frame(scene, depsgraph):
        building.request(scene)


@persistent
def follow(*_: Any) -> None:
    """Attach to Blender's drawing while any scene shows the overlay, and detach otherwise."""
    wanted = any(scene.halfspace.overlay.show for scene in bpy.data.scenes)
    if wanted and not _handles:
        for function, when in ((_draw_view, "POST_VIEW"), (_draw_legend, "POST_PIXEL")):
            _handles.append(bpy.types.SpaceView3D.draw_handler_add(function, (), "WINDOW", when))
    elif not wanted and _handles:
        _let_go()
    for scene in bpy.data.scenes:
        if not scene.halfspace.overlay.show:
            DRAWINGS.keep(scene, None)


def _file_loaded(_scene: Any) -> None:
    """Stop work on the former file, and begin with this one."""
    building.stop()
    comparing.stop()
    _begin()


@persistent
def _stepped(*_: Any) -> None:
    """After undo or redo: show the overlay and the range of the maps as the settings request."""
    follow()
    for scene in bpy.data.scenes:
        signals.range_changed.fire(scene)


def _begin() -> None:
    """Show the overlay as the open file's settings request."""
    follow()
    for scene in bpy.data.scenes:
        building.request(scene)


def _visibility_changed(_scene: Any) -> None:
    follow()
    trees.redraw()


def _look_changed(_scene: Any) -> None:
    trees.redraw()


def _let_go() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def _watched() -> tuple[tuple[Any, Any], ...]:
    """Blender's handler lists, and the functions registered in them while the add-on is enabled.

    Loading files and undo change the overlay's setting without a callback. Changes of triangles are tracked even if
    nothing is shown, because a structure may be kept; it costs a check per update until one moves triangles.
    """
    handlers = bpy.app.handlers
    return (
        (handlers.undo_post, _stepped),
        (handlers.redo_post, _stepped),
        (handlers.depsgraph_update_post, _scene_changed),
        (handlers.frame_change_post, _frame_changed),
    )


def register() -> None:
    """Register handlers for undo steps and scene changes, and listen to settings and loaded files."""
    signals.file_loaded.connect(_file_loaded)
    signals.visibility_changed.connect(_visibility_changed)
    signals.look_changed.connect(_look_changed)
    for handlers, function in _watched():
        handlers.append(function)
    # While an add-on is being enabled, Blender restricts access to the file, which may be open already. Without a
    # window timers never run, and Blender keeps even those that were unregistered.
    if not bpy.app.background:
        bpy.app.timers.register(_begin, first_interval=0.0)


def unregister() -> None:
    """Undo `register`, and stop building."""
    signals.look_changed.disconnect(_look_changed)
    signals.visibility_changed.disconnect(_visibility_changed)
    signals.file_loaded.disconnect(_file_loaded)
    for handlers, function in _watched():
        handlers.remove(function)
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
    _let_go()
    building.stop()
    trees.stop()

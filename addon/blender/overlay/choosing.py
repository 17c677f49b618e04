# SPDX-License-Identifier: GPL-3.0-or-later
"""Contents of the overlay: data of each part by the scene's settings, its levels, and its legend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ...core.base.arrays import F64
from ...core.inspector import node_view, replay_view
from ...core.overlay import beams, cells, layers, legend, planes, polygons, turned
from ...core.overlay.depths import First
from ...core.overlay.legend import Entry
from ...core.tree.table import TreeError
from ..session import trees
from . import picking, replaying

PARTS = ("CELLS", "PLANES", "NODE", "BEAM", "RAY")
"""The parts in drawing order."""

WHOLE = ("NODE", "BEAM", "RAY")
"""The parts that are drawn entirely, also behind objects, in one style."""


def parts(scene: Any) -> list[str]:
    """The parts that are drawn, in order; only the selected node where it is to be alone."""
    wanted = scene.halfspace.overlay.parts
    if scene.halfspace.inspector.alone and "NODE" in wanted:
        return ["NODE"]
    return [part for part in PARTS if part in wanted]


def first(settings: Any, tree: trees.Tree, eye: F64) -> First:
    """The levels of planes that are shown to a viewer at `eye`, (3,) in the tree's frame."""
    if not settings.depth_auto:
        return First(settings.depth_min, settings.depth_max)
    survey = tree.survey()
    found = survey.first(eye)
    if found.layer is None or survey.grid is None or settings.slice_axis == "AUTO":
        return found
    # Take the layer of a grid that was chosen by hand.
    axis = "XYZ".index(settings.slice_axis)
    last = len(survey.grid.walls[axis]) - 2
    return replace(found, layer=(axis, round(settings.slice_place * last)))


def chosen_by(scene: Any, tree: trees.Tree, part: str, eye: F64) -> tuple[Any, ...]:
    """The settings that select a part's data, for a viewer at `eye`, (3,) in the tree's frame."""
    settings = scene.halfspace.overlay
    if part == "CELLS":
        return (settings.least, settings.max_count)
    if part == "NODE":
        return (scene.halfspace.inspector.node,)
    if part == "RAY":
        return (picking.last(scene),)
    if part == "BEAM":
        return picking.last(scene), settings.beam_spacing
    kinds = tuple(kind for kind in planes.KINDS if kind in settings.kinds)
    return (first(settings, tree, eye), kinds, settings.max_count, settings.cuts)


def choose(tree: trees.Tree, part: str, by: tuple[Any, ...]) -> Any:
    """The data of a part for these settings; None if there is nothing to draw."""
    if part == "CELLS":
        return cells.choose(tree.structure, *by)
    if part == "NODE":
        try:
            return node_view.choose(tree.table(), *by, tree.vertices, tree.triangles)
        except TreeError:
            return None
    if part == "RAY":
        (ray,) = by
        return None if ray is None else ray.path(tree)
    if part == "BEAM":
        ray, spacing = by
        return None if ray is None else ray.beam(tree, spacing)
    shown, kinds, most, are_cut = by
    found = _planes(tree, shown, kinds, most)
    return planes.cut(found, tree.vertices, tree.triangles) if are_cut else found


def _planes(tree: trees.Tree, shown: First, kinds: tuple[str, ...], most: int) -> planes.Planes:
    """The polygons of a view."""
    survey = tree.survey()
    if shown.layer is not None and survey.grid is not None:
        walls = layers.cut(survey.grid, shown.layer, kinds)
        return planes.joined(walls, *layers.squares(survey.grid, shown.layer))
    marked, other = shown.marked and "OBLIQUE" in kinds, tuple(kind for kind in kinds if kind != "OBLIQUE")
    found = planes.choose(tree.structure, (shown.low, shown.high), other if marked else kinds, most)
    found = planes.within(found, tree.vertices, tree.triangles)
    if marked and survey.turned:
        try:
            return planes.joined(found, turned.outermost(tree.table()))
        except TreeError:
            return found
    if marked and survey.oblique is not None:
        return planes.joined(found, survey.oblique)
    return found


def levels(
    scene: Any, part: str, chosen: Any, tints: Any, opacity: float, seen: planes.Panes | None = None
) -> list[planes.Level]:
    """The levels of a part's data with the scene's line width; a ray that is replayed ends at its step. seen: the
    surfaces of planes.
    """
    width = scene.halfspace.overlay.line_width
    if part == "CELLS":
        return cells.levels(chosen, opacity, width)
    if part == "NODE":
        return node_view.levels(chosen, opacity, width)
    if part == "BEAM":
        kind = polygons if isinstance(chosen, polygons.PolygonBeam) else beams
        return kind.levels(chosen, opacity, width)
    if part == "RAY":
        tree, step = trees.last(scene), replaying.step(scene)
        found = replaying.replay(scene, tree, chosen) if step is not None and tree is not None else None
        if tree is None or step is None or found is None:
            return cells.path_levels(chosen, tints, opacity, width)
        until = replay_view.upto(tree.table(), chosen, found, step)
        made = cells.path_levels(until, tints, opacity, width)
        return made + replay_view.highlight(tree.table(), found, step, opacity, width)
    return planes.levels(chosen, tints, opacity, width, seen)


def legend_entries(part: str, shown: Any, tints: Any) -> list[Entry]:
    """The legend of one part's data."""
    if part == "PLANES":
        return legend.of_planes(shown, tints)
    if part == "CELLS":
        return legend.of_cells(int(shown.count.min()), int(shown.count.max())) if len(shown) else []
    if part == "NODE":
        return legend.of_node(node_view.NODE_RGB, len(shown.children), len(shown.corners))
    if isinstance(shown, polygons.PolygonBeam):
        return legend.of_polygons(shown)
    return legend.of_ray() if part == "RAY" else legend.of_beam()


def legend_of(scene: Any, shown: Mapping[str, Any], tints: Any) -> list[Entry]:
    """The legend of all parts that are drawn. shown: the data of each part, or None."""
    found: list[Entry] = []
    for part, data in shown.items():
        if data is not None:
            found += legend_entries(part, data, tints)
    if shown.get("RAY") is not None and replaying.step(scene) is not None:
        found += legend.of_step(replay_view.STEP_RGB)
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""Contents of the overlay: data of each part by the scene's settings, its levels, and its legend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...core.base.arrays import F64
from ...core.inspector import node_view, replay_view
from ...core.overlay import beams, cells, layers, legend, planes
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
    return tree.survey().first(eye) if settings.depth_auto else First(settings.depth_min, settings.depth_max)


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
    return (first(settings, tree, eye), kinds, settings.max_count)


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
        return None if ray is None else beams.follow(tree.structure, *ray.tile(tree.origin, spacing))
    shown, kinds, most = by
    grid = tree.survey().grid if shown.layer is not None else None
    if grid is not None:
        return layers.cut(grid, shown.layer, kinds)
    return planes.choose(tree.structure, (shown.low, shown.high), kinds, most)


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
        return beams.levels(chosen, opacity, width)
    if part == "RAY":
        tree, step = trees.last(scene), replaying.step(scene)
        found = replaying.replay(scene, tree, chosen) if step is not None and tree is not None else None
        if tree is None or step is None or found is None:
            return cells.path_levels(chosen, tints, opacity, width)
        until = replay_view.upto(tree.table(), chosen, found, step)
        made = cells.path_levels(until, tints, opacity, width)
        return made + replay_view.highlight(tree.table(), found, step, opacity, width)
    return planes.levels(chosen, tints, opacity, width, seen)


def legend_of_planes(shown: planes.Planes, tints: Any) -> list[Entry]:
    """The kinds and levels of the planes that are shown."""
    kinds = [name for number, name in enumerate(planes.KINDS) if (shown.kind == number).any()]
    ends = (shown.levels.start, shown.levels.stop - 1) if len(shown) else (0, 0)
    return legend.of_planes(kinds, ends, tints, shown.across)


def legend_entries(part: str, shown: Any, tints: Any) -> list[Entry]:
    """The legend of one part's data."""
    if part == "PLANES":
        return legend_of_planes(shown, tints)
    if part == "CELLS":
        return legend.of_cells(int(shown.count.min()), int(shown.count.max())) if len(shown) else []
    if part == "NODE":
        return legend.of_node(node_view.NODE_RGB)
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

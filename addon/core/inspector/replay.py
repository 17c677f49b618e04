# SPDX-License-Identifier: GPL-3.0-or-later
"""The traversal of one ray, node by node, with the numbers of each step.

Native paths list leaves: the tested ones in the order of the traversal, each with the number of inner nodes that the
traversal had counted by then. Inner nodes are reconstructed: one is visited before the first leaf below it is; a node
that the ray meets before its hit, but none of whose leaves it meets, follows its parent. Other nodes beyond the hit
that were visited before the hit was known have no step of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..overlay.cells import Path
from ..tree import location
from ..tree.table import KIND_LABELS, LEAF, Table

ROUNDED = 2.0**-23
"""Largest relative difference between the parameter of a hit and that number before it was rounded to f32."""


@dataclass(frozen=True)
class Step:
    """One visited node.

    node: its row in the table. depth: of the node. enter, leave: ray parameters in its region, NaN if only the error
    bound led the traversal there. tests: triangles tested. leaf: index of the visit in the path, -1 for inner nodes.
    reached: inner nodes that the traversal had counted when it tested this leaf, -1 where it tested none.
    """

    node: int
    depth: int
    enter: float
    leave: float
    tests: int
    leaf: int
    reached: int = -1


@dataclass(frozen=True, eq=False)
class Replay:
    """The steps of a path in order. hidden: inner nodes that the traversal counted without a step here."""

    steps: tuple[Step, ...]
    hidden: int

    def __len__(self) -> int:
        return len(self.steps)

    def tested(self, upto: int) -> int:
        """Number of triangles tested in the first `upto` steps."""
        return sum(step.tests for step in self.steps[:upto])

    def inner(self, upto: int) -> int:
        """Number of inner nodes among the first `upto` steps."""
        return sum(step.leaf < 0 for step in self.steps[:upto])


def replay(table: Table, path: Path) -> Replay:
    """The steps of a path through the tree of this table."""
    steps: list[Step] = []
    visited = leaves(table, path)
    above = {node for leaf in visited for node in table.ancestors(leaf)}
    seen: set[int] = set()
    for visit, leaf in enumerate(visited):
        for node in table.ancestors(leaf)[:-1]:
            if node not in seen:
                seen.add(node)
                enter, leave = span(table, path, node)
                steps.append(Step(node, int(table.depth[node]), enter, leave, 0, -1))
                steps += _dead_ends(table, path, node, above)
        tests, reached = (int(path.cells.count[visit]), int(path.reached[visit])) if path.tested[visit] else (0, -1)
        steps.append(Step(leaf, int(table.depth[leaf]), *_within(path, visit), tests, visit, reached))
    if not visited:
        steps += _dead_ends(table, path, -1, above)
    inner = sum(step.leaf < 0 for step in steps)
    return Replay(tuple(steps), max(path.steps - inner, 0))


def _within(path: Path, visit: int) -> tuple[float, float]:
    """Ray parameters at which the ray enters and leaves a visited leaf, the last at most that of its hit.

    A hit on the side of the leaf at which the ray enters may be rounded to a parameter before it. Leaves beyond a hit,
    tested before that was known, have their whole interval.
    """
    enter, leave = float(path.enter[visit]), float(path.leave[visit])
    return (enter, enter) if path.t < enter <= path.t * (1.0 + ROUNDED) else (enter, leave)


def _dead_ends(table: Table, path: Path, node: int, above: set[int]) -> list[Step]:
    """Inner nodes below a node, and not above any visited leaf, that the ray meets before its hit. node: -1 for all.

    None of a ray to any hit, which need not visit all nodes before it.
    """
    found: list[Step] = []
    if path.any_hit:
        return found
    waiting = [0] if node < 0 else table.children_of(node)[::-1].tolist()
    while waiting:
        child = waiting.pop()
        if table.kind[child] == LEAF or child in above:
            continue
        enter, leave = span(table, path, child)
        if enter <= path.t:
            found.append(Step(child, int(table.depth[child]), enter, leave, 0, -1))
            waiting += table.children_of(child)[::-1].tolist()
    return found


def leaves(table: Table, path: Path) -> list[int]:
    """The row of each visited leaf: of those with as many triangles, the one whose box is nearest to its cell."""
    count = len(path.cells)
    boxes = np.zeros((count, 6))
    for visit in range(count):
        first, last = path.cells.offsets[path.cells.cells[visit : visit + 2]]
        corners = path.cells.vertices[first:last].astype(np.float64)
        boxes[visit] = np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    # Find the leaves around the middle of each cell; one that rounding hides is searched among all.
    slack = float(np.abs(table.scene).max()) * location.INWARDS
    best, nearest = np.full(count, -1), np.full(count, np.inf)
    for place, node in location.levels(table, 0.5 * (boxes[:, :3] + boxes[:, 3:]), slack):
        fits = (table.kind[node] == LEAF) & (table.counts[node] == path.cells.count[place])
        for visit, leaf in zip(place[fits].tolist(), node[fits].tolist(), strict=True):
            distance = float(np.abs(table.bounds[leaf] - boxes[visit]).sum())
            if distance < nearest[visit]:
                best[visit], nearest[visit] = leaf, distance
    for visit in np.flatnonzero(best < 0).tolist():
        known = np.flatnonzero((table.kind == LEAF) & (table.counts == path.cells.count[visit]))
        best[visit] = known[np.abs(table.bounds[known] - boxes[visit]).sum(axis=1).argmin()]
    return [int(leaf) for leaf in best]


def span(table: Table, path: Path, node: int) -> tuple[float, float]:
    """Ray parameters at which the ray enters and leaves a node's region, from 0 on; NaN twice if it misses it."""
    start, end = table.wall_offsets[node : node + 2]
    walls = table.walls[start:end]
    if start == end:
        sides = np.concatenate([-np.eye(3), np.eye(3)])
        walls = np.concatenate([sides, (table.bounds[node] * np.repeat([-1.0, 1.0], 3))[:, None]], axis=1)
    # Clip the ray to the half-spaces of the region.
    speed, height = walls[:, :3] @ path.direction, walls[:, 3] - walls[:, :3] @ path.origin
    with np.errstate(divide="ignore", invalid="ignore"):
        at = height / speed
    enter = max(0.0, float(at[speed < 0].max(initial=0.0)))
    leave = float(at[speed > 0].min(initial=np.inf))
    missed = enter > leave or bool((height[speed == 0] < 0).any())
    return (np.nan, np.nan) if missed else (enter, leave)


def against(replay: Replay, counted: int) -> str:
    """The difference of the steps that are shown to the counted number of visited nodes, in words; empty if none.

    Kernels of planes step over an empty child without a visit; here it is a step, since the ray passes it.
    """
    more = len(replay) - counted
    if more > 0:
        return f"{more:,} of them the traversal does not count, such as empty leaves that it steps over"
    return f"{-more:,} more were visited before the hit was known, beyond it" if more < 0 else ""


def words(table: Table, step: Step) -> list[str]:
    """The numbers of a step as lines of text."""
    kind = KIND_LABELS[table.kind[step.node]]
    ends = f"{step.enter:.4g} to {step.leave:.4g}" if np.isfinite(step.enter) else "outside, within the error bound"
    lines = [f"Node {step.node:,}: {kind}, level {step.depth}", f"Ray interval: {ends}"]
    if step.leaf >= 0:
        count = int(table.counts[step.node])
        lines.append(f"{step.tests:,} of {count:,} triangles tested" if count else "An empty leaf")
        if step.reached >= 0:
            lines.append(f"Counted by then: {step.reached:,} inner nodes")
    else:
        lines.append(
            f"{len(table.children_of(step.node))} children, {int(table.references[step.node]):,} triangles below"
        )
    return lines

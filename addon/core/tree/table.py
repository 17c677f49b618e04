# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of a tree as columns: place in the tree, region, and the cost that the surface area heuristic expects.

Costs have the units of `Structure.statistics["sah_cost"]`: 1 per axis-aligned step, 5 per oblique step, 80 per triangle
test. The sum over all nodes is the expected cost of a random ray that meets the scene's box.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32
from ..structures.ways import nodes_of
from . import regions

if TYPE_CHECKING:
    from ..base.interface import Structure

X, Y, Z, OBLIQUE, SLABS, OCTANTS, BOXES, LEAF = range(8)
"""Kinds of nodes, as `Structure.export` numbers them."""

KIND_LABELS = ("X plane", "Y plane", "Z plane", "oblique planes", "slabs", "octants", "boxes", "leaf")
"""The kinds in words."""

OBLIQUE_COST, TEST_COST = 5.0, 80.0
"""Costs of an oblique step and of a triangle test in steps along an axis (Hoobergs 2019, section 5.1)."""

OCTANT_STEPS = 3
"""Planes with which a ray is compared at a node of eight octants."""

MOST_NODES = 4_000_000
"""Largest number of nodes of a tree that is read: about 1 GB."""


class TreeError(ValueError):
    """The tree cannot be read. The message states why."""


@dataclass(frozen=True, eq=False)
class Table:
    """A tree in preorder; lists of different lengths per node lie one after another.

    kind: (n,) uint8. parent: (n,) int32, -1 for the root. depth: (n,). bounds: (n, 6), lower and upper corner of the
    box around the node's region, scene frame. child_offsets, children: (n + 1,), (n - 1,). walls: (w, 4), half-spaces
    of regions that are no boxes. triangle_offsets, triangles: references of leaves. scene: (6,), box of all triangles.
    steps: (n,), steps of a visit in units of an axis step. partitions: whether regions of siblings have no common inner
    points.
    """

    kind: NDArray[np.uint8]
    parent: I32
    depth: I32
    bounds: F64
    child_offsets: NDArray[np.int64]
    children: NDArray[np.int64]
    wall_offsets: NDArray[np.int64]
    walls: F64
    triangle_offsets: NDArray[np.int64]
    triangles: I32
    scene: F64
    steps: F64
    partitions: bool

    def __len__(self) -> int:
        return len(self.kind)

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """(n,), number of nodes of each subtree, the node included."""
        return self._summed(np.ones(len(self), np.int64))

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """(n,), triangles in each leaf, 0 for inner nodes."""
        return np.diff(self.triangle_offsets)

    @cached_property
    def references(self) -> NDArray[np.int64]:
        """(n,), triangles in the leaves of each subtree; one in several leaves counts several times."""
        return self._summed(self.counts)

    @cached_property
    def shares(self) -> F64:
        """(n,), probability that a random ray that meets the scene's box meets the node: the ratio of their areas."""
        inside_low = np.maximum(self.bounds[:, :3], self.scene[:3])
        inside_high = np.minimum(self.bounds[:, 3:], self.scene[3:])
        areas = np.where((inside_high >= inside_low).all(axis=1), _box_areas(inside_low, inside_high), 0.0)
        walled = np.flatnonzero(np.diff(self.wall_offsets))
        if len(walled):
            found = regions.faces(self.walls, self.wall_offsets, self.bounds)
            areas[walled] = 0.0
            np.add.at(areas, found.owner, found.areas())
        whole = float(_box_areas(self.scene[None, :3], self.scene[None, 3:])[0])
        return areas / whole if whole > 0 else np.zeros(len(self))

    @cached_property
    def costs(self) -> F64:
        """(n,), expected cost of a random ray at each node alone: of its steps, or of its tests."""
        return self.shares * (self.steps + TEST_COST * self.counts)

    @cached_property
    def costs_below(self) -> F64:
        """(n,), expected cost of each subtree, the node included."""
        return self._summed(self.costs)

    @cached_property
    def kinds(self) -> tuple[int, ...]:
        """The kinds of inner nodes that occur."""
        return tuple(int(kind) for kind in np.unique(self.kind[self.kind != LEAF]))

    def children_of(self, node: int) -> NDArray[np.int64]:
        """The children of a node, in the order of the tree."""
        return self.children[self.child_offsets[node] : self.child_offsets[node + 1]]

    def triangles_of(self, node: int) -> I32:
        """The distinct triangles in the leaves of a subtree, ascending."""
        end = node + int(self.sizes[node])
        return np.unique(self.triangles[self.triangle_offsets[node] : self.triangle_offsets[end]])

    def sibling(self, node: int, step: int) -> int:
        """The sibling `step` places after a node, cyclically; the node itself if it is the root."""
        if self.parent[node] < 0:
            return node
        siblings = self.children_of(int(self.parent[node]))
        place = int(np.flatnonzero(siblings == node)[0])
        return int(siblings[(place + step) % len(siblings)])

    def ancestors(self, node: int) -> list[int]:
        """The nodes from the root to a node, both included."""
        found = [node]
        while self.parent[found[-1]] >= 0:
            found.append(int(self.parent[found[-1]]))
        return found[::-1]

    def costliest_child(self, node: int) -> int:
        """The child whose subtree has the largest expected cost; the node itself if it is a leaf."""
        children = self.children_of(node)
        return int(children[np.argmax(self.costs_below[children])]) if len(children) else node

    def costliest_leaf(self) -> int:
        """The leaf with the largest expected cost."""
        leaves = np.flatnonzero(self.kind == LEAF)
        return int(leaves[np.argmax(self.costs[leaves])])

    def node_faces(self, node: int) -> list[F64]:
        """The polygons of the faces of a node's region, (v, 3) each."""
        start, end = self.wall_offsets[node : node + 2]
        if start == end:
            return regions.box_faces(self.bounds[node])
        found = regions.faces(self.walls[start:end], np.array([0, end - start]), self.bounds[node : node + 1])
        return np.split(found.vertices, found.offsets[1:-1])

    def _summed(self, values: NDArray[Any]) -> NDArray[Any]:
        """Sums over subtrees, level by level from the deepest."""
        sums = values.copy()
        for depth in range(int(self.depth.max(initial=0)), 0, -1):
            level = np.flatnonzero(self.depth == depth)
            np.add.at(sums, self.parent[level], sums[level])
        return sums


def read(structure: Structure, vertices: F32, triangles: I32) -> Table:
    """The tree of a native structure over these triangles. Raises TreeError if it has none or too
    many nodes, or if no vertex is finite.
    """
    numbers = structure.statistics
    nodes = numbers["nodes_axis"] + numbers["nodes_oblique"] + numbers["leaves"]
    if nodes > MOST_NODES:
        raise TreeError(f"the tree has {nodes:,} nodes; the inspector reads up to {MOST_NODES:,}")
    found = structure.export()
    if not len(found["node_kind"]):
        raise TreeError("the structure has no tree")
    is_grid = nodes_of(structure.spec) == "cells"
    kind, planes = found["node_kind"], found["plane_kind"]
    used = vertices[np.unique(triangles)].astype(np.float64) if len(triangles) else np.zeros((1, 3))
    used = used[np.isfinite(used).all(axis=1)]
    if not len(used):
        raise TreeError("no vertex is finite")
    return Table(
        kind=kind,
        parent=found["node_parent"],
        depth=found["node_depth"].astype(np.int32),
        bounds=found["node_bounds"],
        child_offsets=found["child_offsets"].astype(np.int64),
        children=found["children"].astype(np.int64),
        wall_offsets=found["wall_offsets"].astype(np.int64),
        walls=found["walls"],
        triangle_offsets=found["triangle_offsets"].astype(np.int64),
        triangles=found["triangles"].astype(np.int32),
        scene=np.concatenate([used.min(axis=0), used.max(axis=0)]),
        steps=_steps(kind, found["plane_offsets"].astype(np.int64), planes, is_grid=is_grid),
        partitions=not np.isin(kind, (SLABS, BOXES)).any(),
    )


def _steps(kind: NDArray[np.uint8], offsets: NDArray[np.int64], planes: NDArray[np.uint8], *, is_grid: bool) -> F64:
    """(n,), cost of the steps of a visit of each node. In a grid a ray steps from cell to cell."""
    if is_grid:
        return np.where(kind == LEAF, 1.0, 0.0)
    steps = np.where(kind == LEAF, 0.0, 1.0)
    steps[kind == OCTANTS] = OCTANT_STEPS
    # A node is oblique if any of its planes is.
    oblique = np.concatenate([[0], np.cumsum(planes == OBLIQUE)])
    steps[(oblique[offsets[1:]] > oblique[offsets[:-1]]) & (kind != LEAF)] = OBLIQUE_COST
    return steps


def _box_areas(low: F64, high: F64) -> F64:
    x, y, z = (high - low).T
    areas: F64 = 2.0 * (x * y + y * z + z * x)
    return areas

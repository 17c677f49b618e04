# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that contain points of surfaces: the depth of the leaf, and the nodes that a ray to the point visits in vain.

End-point overlap (Aila, Karras and Laine 2013) charges a node with the surface inside its region of triangles that no
leaf below it holds. Here the surface is a set of points, so that it has a value for each pixel and each level.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32
from .table import LEAF, TEST_COST, Table

INWARDS, OUTWARDS = 2.0**-21, 2.0**-40
"""Distances by which regions of trees that partition space are smaller, and others larger, in units of the largest
coordinate, as in the native end-point overlap: a triangle may lie in the plane between two regions.
"""

SAMPLE, SEED = 32_768, 2013
"""Number of points of a sample of the surface, and the seed of all samples."""


class Owners:
    """Answers which triangles the leaves below a node hold."""

    def __init__(self, table: Table) -> None:
        """Sort the references of the table's leaves by triangle, then by leaf."""
        leaves = np.repeat(np.arange(len(table)), table.counts)
        self._nodes = len(table)
        self._keys = np.sort(table.triangles.astype(np.int64) * self._nodes + leaves)
        self._sizes = table.sizes

    def below(self, triangles: NDArray[Any], nodes: NDArray[Any]) -> NDArray[np.bool_]:
        """(k,), whether a leaf below each of these nodes, or the node itself, holds the triangle at its place."""
        first = triangles.astype(np.int64) * self._nodes + nodes
        start = np.searchsorted(self._keys, first)
        found: NDArray[np.bool_] = np.searchsorted(self._keys, first + self._sizes[nodes]) > start
        return found


def levels(table: Table, points: F64, slack: float) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """For each level of the tree, from the root on: pairs of a point and a node whose region contains it.

    slack: distance by which regions are larger, scene frame. Yields indices of points and of nodes.
    """
    place, node = np.arange(len(points)), np.zeros(len(points), np.int64)
    while len(place):
        inside = _contains(table, points[place], node, slack)
        place, node = place[inside], node[inside]
        yield place, node
        # Go on to all children of these nodes.
        counts = (table.child_offsets[1:] - table.child_offsets[:-1])[node]
        starts = np.repeat(table.child_offsets[node] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
        place, node = np.repeat(place, counts), table.children[starts + np.arange(counts.sum())]


def _contains(table: Table, points: F64, nodes: NDArray[np.int64], slack: float) -> NDArray[np.bool_]:
    """(k,), whether the region of each node contains the point at its place."""
    bounds = table.bounds[nodes]
    inside: NDArray[np.bool_] = ((points >= bounds[:, :3] - slack) & (points <= bounds[:, 3:] + slack)).all(axis=1)
    counts = np.diff(table.wall_offsets)[nodes]
    rows = np.flatnonzero(inside & (counts > 0))
    if not len(rows):
        return inside
    # Compare with the half-spaces of regions that are no boxes.
    counts = counts[rows]
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]])
    walls = table.walls[np.repeat(table.wall_offsets[nodes[rows]] - begins, counts) + np.arange(counts.sum())]
    heights = (np.repeat(points[rows], counts, axis=0) * walls[:, :3]).sum(axis=1) - walls[:, 3]
    inside[rows] = np.maximum.reduceat(heights, begins) <= slack
    return inside


def slack(table: Table) -> float:
    """The distance by which regions are larger when overlap is measured; negative if the tree partitions space."""
    return float(np.abs(table.scene).max()) * (-INWARDS if table.partitions else OUTWARDS)


def overlap(table: Table, points: F64, triangles: NDArray[Any]) -> F64:
    """(levels, n), cost at each level of the nodes that contain a point but do not hold its triangle below them.

    points: (n, 3), on the triangles with these indices, (n,). Costs as in `Table`.
    """
    owners, each = Owners(table), table.steps + TEST_COST * table.counts
    made = np.zeros((int(table.depth.max(initial=0)) + 1, len(points)))
    for level, (place, node) in enumerate(levels(table, points, slack(table))):
        vain = ~owners.below(triangles[place], node)
        np.add.at(made[level], place[vain], each[node[vain]])
    return made


def leaf_depths(table: Table, points: F64, triangles: NDArray[Any]) -> NDArray[np.int32]:
    """(n,), depth of the shallowest leaf that contains each point and holds its triangle; -1 if there is none.

    points: (n, 3), on the triangles with these indices, (n,), up to rounding to float32.
    """
    owners = Owners(table)
    found = np.full(len(points), -1, np.int32)
    for place, node in levels(table, points, float(np.abs(table.scene).max()) * INWARDS):
        leaf = (table.kind[node] == LEAF) & (found[place] < 0)
        holds = leaf & owners.below(triangles[place], node)
        found[place[holds]] = table.depth[node[holds]]
    return found


def surface(vertices: F32, triangles: I32, count: int = SAMPLE) -> tuple[F64, NDArray[np.int64]]:
    """Random points of all triangles together, uniform by area: (count, 3), and the triangle of each. Fixed seed."""
    rng = np.random.default_rng(SEED)
    corners = vertices.astype(np.float64)[triangles]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.nan_to_num(np.linalg.norm(np.cross(*sides), axis=1), posinf=0.0)
    if not areas.sum():
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    chosen = np.searchsorted(np.cumsum(areas), rng.random(count) * areas.sum(), side="right")
    chosen = np.minimum(chosen, len(areas) - 1)
    u, v = np.sqrt(rng.random(count)), rng.random(count)
    return corners[chosen, 0] + (u * (1 - v))[:, None] * sides[0][chosen] + (u * v)[:, None] * sides[1][chosen], chosen

# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 2.1 and figures 2.1 and 3.1: planes that builders try at each level, and how many of them differ.

The triangles of every node are those of the leaves below it. A node of n triangles that is split tries 2 n planes along
each of its directions. Directions of RBSP, of the kd-tree and of Ize's trees are the same at all nodes, so their planes
are the ends of all triangles along them. Random directions differ at each node. For directions from normals the draw is
repeated: K triangles of each node, and a normal that a node above has drawn gives no new plane.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.scene.workload import Workload
from ..export.trees import LEAF
from .plan import AXES

if TYPE_CHECKING:
    from ...core.base.interface import Structure

Ints = NDArray[np.int64]

KINDS = ("kd", "rbsp", "ize", "random", "wn")
"""Trees that the figures compare."""


@dataclass(frozen=True)
class Level:
    """One level. planes: tried at its nodes. distinct: different ones, of this level and of those above."""

    depth: int
    nodes: int
    planes: int
    distinct: int


def formula(kind: str, n: int, k: int) -> float:
    """The number of different planes of a whole tree over n triangles according to the thesis (balanced, no triangle in
    both children).
    """
    if kind == "wn":
        return 2 * k * n * (math.log2(n / k) + 0.5)
    return {"kd": 6.0, "rbsp": 2.0 * k, "ize": 10.0}.get(kind, 2 * k * math.log2(n)) * n


def node_triangles(tree: Mapping[str, NDArray[Any]]) -> Iterator[tuple[int, Ints, Ints, Ints]]:
    """Level by level from the deepest: depth, inner nodes, and pairs of these nodes and their triangles, by node."""
    parent, depth = tree["node_parent"].astype(np.int64), tree["node_depth"].astype(np.int64)
    offsets = tree["triangle_offsets"].astype(np.int64)
    triangles = tree["triangles"].astype(np.int64)
    count = int(triangles.max(initial=0)) + 1
    owner = np.repeat(np.arange(len(depth)), np.diff(offsets))
    inner = tree["node_kind"] != LEAF
    keys = np.zeros(0, np.int64)
    for level in range(int(depth.max(initial=0)), -1, -1):
        # The triangles of the nodes of this level: of its leaves, and of the children of its inner nodes.
        leaves = depth[owner] == level
        keys = np.unique(np.concatenate([keys, owner[leaves] * count + triangles[leaves]]))
        node = keys // count
        mine = inner[node]
        yield level, np.flatnonzero(inner & (depth == level)), node[mine], keys[mine] % count
        keys = np.unique(parent[node] * count + keys % count) if level else keys


def levels(structure: Structure, workload: Workload, kind: str, k: int, seed: int = 1) -> list[Level]:
    """The levels of one tree. k: number of directions, the axes included."""
    tree = {key: np.asarray(value) for key, value in structure.export().items()}
    found = list(node_triangles(tree))[::-1]
    tried = {"kd": AXES, "ize": 5}.get(kind, k)
    drawn = _Draws(tree["node_parent"], normals(workload), k, np.random.default_rng(seed)) if kind == "wn" else None
    fixed = _ends(workload, structure, k) if kind in {"kd", "rbsp", "ize"} else 0
    rows: list[Level] = []
    distinct = 0
    for depth, nodes, owners, triangles in found:
        if not len(nodes):
            continue
        planes = 2 * tried * len(triangles)
        new = drawn.new(nodes, owners, triangles) if drawn is not None else planes
        distinct = fixed or distinct + new
        rows.append(Level(depth, len(nodes), planes, min(distinct, sum(row.planes for row in rows) + planes)))
    return rows


def normals(workload: Workload) -> Ints:
    """The number of each triangle's normal; equal or opposite normals share one."""
    corners = workload.vertices[workload.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    first = np.argmax(unit != 0, axis=1)
    unit *= np.where(np.take_along_axis(unit, first[:, None], 1) < 0, -1.0, 1.0)
    _, inverse = np.unique(unit.astype(np.float32) + np.float32(0), axis=0, return_inverse=True)
    return np.asarray(inverse, np.int64).reshape(-1)


def _ends(workload: Workload, structure: Structure, k: int) -> int:
    """The number of different ends of all triangles along the directions of a tree whose directions are fixed, and for
    Ize's the four planes of each triangle.
    """
    corners = workload.vertices[workload.triangles]
    directions = list(np.eye(3))
    if structure.spec.startswith("rbsp"):
        # The thirteen directions of the cube, as the builder has them.
        half = [(0.5, y, z) for y in (0.5, -0.5) for z in (0.5, -0.5)]
        faces = [one for sign in (0.5, -0.5) for one in ((0.5, sign, 0.0), (0.5, 0.0, sign), (0.0, 0.5, sign))]
        directions += [np.array(one) for one in (*half, *faces)]
    count = 4 * len(corners) if structure.spec.startswith("bsp-ize") else 0
    for direction in directions[:k]:
        heights = (corners @ direction.astype(np.float32)).astype(np.float32)
        count += len(np.unique(np.concatenate([heights.min(axis=1), heights.max(axis=1)])))
    return count


class _Draws:
    """Draws of K triangles per node, level by level from the root."""

    def __init__(self, parent: NDArray[Any], normal: Ints, k: int, random: np.random.Generator) -> None:
        self._parent, self._normal, self._k, self._random = parent.astype(np.int64), normal, k, random
        self._drawn: list[tuple[Ints, Ints]] = []

    def new(self, nodes: Ints, owners: Ints, triangles: Ints) -> int:
        """The planes of these nodes that no node above them has tried."""
        # Choose the K triangles of each node with the smallest random numbers.
        order = np.lexsort((self._random.random(len(owners)), owners))
        starts = np.searchsorted(owners[order], nodes)
        sizes = np.diff(np.append(starts, len(owners)))
        picks = starts[:, None] + np.arange(self._k)
        there = np.arange(self._k) < sizes[:, None]
        chosen = self._normal[triangles[order[np.minimum(picks, len(owners) - 1)]]]
        chosen = np.where(there, chosen, -1 - np.arange(self._k))
        fresh = there.copy()
        for j in range(1, self._k):
            fresh[:, j] &= ~(chosen[:, :j] == chosen[:, j : j + 1]).any(axis=1)
        # Drop normals that an ancestor drew.
        above = self._parent[nodes]
        for known, theirs in reversed(self._drawn):
            place = np.searchsorted(known, above)
            old = theirs[place]
            fresh &= ~(chosen[:, :, None] == old[:, None, :]).any(axis=2)
            above = self._parent[above]
        self._drawn.append((nodes, chosen))
        return int((2 * sizes[:, None] * fresh).sum())


def table(found: Mapping[str, Sequence[Level]], n: int, k: int) -> list[dict[str, Any]]:
    """Table 2.1 and its continuation: by tree, planes per level and different ones, measured and by formula."""
    rows = []
    for kind, own in found.items():
        rows.append(
            {
                "kind": kind,
                "widest": max((level.planes for level in own), default=0) / n,
                "distinct": (own[-1].distinct if own else 0) / n,
                "per_level_formula": {"kd": 6, "ize": 10}.get(kind, 2 * k),
                "distinct_formula": formula(kind, n, k) / n,
            }
        )
    return rows

# SPDX-License-Identifier: GPL-3.0-or-later
"""One node of a tree as coloured lines and surfaces for a viewport: its region, its children, and their triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base import colours
from ..base.arrays import F32, F64, I32
from ..overlay import cells, planes
from ..overlay.planes import Level, Shape
from ..tree.table import KIND_LABELS, LEAF, TEST_COST, Table

NODE_RGB = (1.0, 1.0, 1.0)
"""Colour of the node's region."""

MOST_TRIANGLES = 20_000
"""Largest number of triangles below a node that are drawn."""

REGION_FILL, CHILD_FILL = (0.0, 0.05), (0.06, 0.16)
"""Opacity of the faces of the region and of its children, at their centre and their rim, relative to their lines."""


@dataclass(frozen=True, eq=False)
class NodeView:
    """A node that is shown. children: their rows. region, parts: polygons of its faces, and of those of each child.
    corners: (t, 3, 3) of the triangles below it, none if there are more than MOST_TRIANGLES. hidden: their number then.
    """

    node: int
    children: tuple[int, ...]
    heat: F64
    region: list[F64]
    parts: list[list[F64]]
    corners: F32
    hidden: int


def choose(table: Table, node: int, vertices: F32, triangles: I32) -> NodeView:
    """The view of a node of a tree over these triangles; a row beyond the last is the root."""
    node = node if node < len(table) else 0
    children = table.children_of(node).tolist()
    costs = table.costs_below[children]
    below = table.triangles_of(node)
    shown = below if len(below) <= MOST_TRIANGLES else below[:0]
    return NodeView(
        node,
        tuple(children),
        costs / costs.max() if len(costs) and costs.max() > 0 else np.zeros(len(costs)),
        table.node_faces(node),
        [table.node_faces(child) for child in children],
        np.ascontiguousarray(vertices[triangles[shown]], np.float32),
        len(below) - len(shown),
    )


def levels(view: NodeView, opacity: float, width: float) -> list[Level]:
    """The levels of a node: triangles faintest, then its children, brighter where they cost more, and its region."""
    made: list[Level] = []
    if len(view.corners):
        made.append(cells.triangles(view.corners, cells.TESTED_RGB, 0.5 * opacity, 1.0, 0.25))
    for heat, faces in zip(view.heat, view.parts, strict=True):
        rgb = colours.false_colour(np.array([colours.CELLS_FROM + (1 - colours.CELLS_FROM) * heat]))[0]
        made += outline(faces, rgb.tolist(), 0.8 * opacity, max(0.7 * width, 1.0), CHILD_FILL)
    return made + outline(view.region, NODE_RGB, opacity, 1.4 * width, REGION_FILL)


def outline(
    faces: list[F64], rgb: Sequence[float], strength: float, width: float, fill: tuple[float, float]
) -> list[Level]:
    """The faces of a region in one colour; no level without faces."""
    if not faces:
        return []
    offsets = np.concatenate([[0], np.cumsum([len(face) for face in faces])]).astype(np.int32)
    shape = Shape(
        np.concatenate(faces).astype(np.float32),
        offsets,
        np.tile(np.array(rgb, np.float32), (len(faces), 1)),
        np.full(len(faces), strength, np.float32),
    )
    return [planes.level(shape, np.arange(len(faces)), 0, width, fill)]


def words(table: Table, node: int) -> list[str]:
    """The numbers of a node as lines of text."""
    low, high = table.bounds[node, :3], table.bounds[node, 3:]
    size = " × ".join(f"{side:.4g}" for side in high - low)
    whole = float(table.costs_below[0])
    share = table.costs_below[node] / whole if whole else 0.0
    lines = [f"Level {table.depth[node]}: {KIND_LABELS[table.kind[node]]}", f"Box {size}"]
    lines.append(f"Met by {percent(table.shares[node])} of random rays")
    if table.kind[node] == LEAF:
        return [*lines, f"{table.counts[node]:,} triangles", f"{percent(share)} of the SAH cost"]
    own = table.costs[node] / whole if whole else 0.0
    return [
        *lines,
        f"{len(table.children_of(node)):,} children, {table.sizes[node]:,} nodes below",
        f"{table.references[node]:,} triangles in the leaves below, each counted once per leaf",
        f"{percent(share)} of the SAH cost",
        f"{percent(own)} in its own steps",
        *_saving(table, node),
    ]


def percent(share: float) -> str:
    """A share as a percentage with one decimal place, or, below 1 %, with two significant digits."""
    value = 100.0 * float(share)
    return f"{value:.1f}%" if value >= 1.0 or not value else f"{value:.2g}%"


def _saving(table: Table, node: int) -> list[str]:
    """The saving of a node's split against a leaf with its triangles."""
    leaf = float(table.shares[node]) * TEST_COST * len(table.triangles_of(node))
    below = float(table.costs_below[node])
    return [f"The split saves {1 - below / leaf:.1%} of the cost as a leaf"] if leaf > 0 else []

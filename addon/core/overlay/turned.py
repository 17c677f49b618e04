# SPDX-License-Identifier: GPL-3.0-or-later
"""The outermost turned boxes of a tree as polygons."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from ..tree import regions
from ..tree.table import Table
from .planes import KINDS, Planes

MOST, MOST_AREA = 160, 1.5
"""Number of turned boxes that are shown, and their surface together in that of the scene's box: more cannot be told
apart.
"""


def outermost(table: Table, most: int = MOST) -> Planes:
    """The faces of the turned boxes that lie in no other turned box: the largest, at most `most`, and no more than have
    MOST_AREA together.

    hidden counts the other boxes that lie in none.
    """
    # Find the nodes with half-spaces of their own and no ancestor that has some.
    turned = np.diff(table.wall_offsets) > 0
    below = np.zeros(len(table), bool)
    for depth in range(1, int(table.depth.max(initial=0)) + 1):
        level = np.flatnonzero(table.depth == depth)
        parents = table.parent[level]
        below[level] = below[parents] | turned[parents]
    outer = np.flatnonzero(turned & ~below)
    area = _areas(table.bounds[outer])
    order = np.argsort(-area, kind="stable")
    largest, whole = outer[order], float(_areas(table.scene[None])[0])
    few = int(np.searchsorted(np.cumsum(area[order]), MOST_AREA * whole)) + 1
    shown = np.sort(largest[: min(few, most)])
    # Cut the faces of each.
    counts = np.diff(table.wall_offsets)[shown]
    offsets = np.concatenate([[0], np.cumsum(counts)])
    rows = np.repeat(table.wall_offsets[shown] - offsets[:-1], counts) + np.arange(offsets[-1])
    faces = regions.faces(table.walls[rows], offsets, table.bounds[shown])
    return Planes(
        faces.vertices.astype(np.float32),
        faces.offsets.astype(np.int32),
        table.depth[shown][faces.owner].astype(np.int32),
        np.full(len(faces.owner), KINDS.index("OBLIQUE"), np.int32),
        hidden=len(outer) - len(shown),
        complete=True,
        body=faces.owner.astype(np.int32),
    )


def _areas(boxes: F64) -> F64:
    """(n,), surfaces of boxes (n, 6): the turned boxes in them are slower to measure and in the same order, nearly."""
    x, y, z = (boxes[:, 3:] - boxes[:, :3]).T
    found: F64 = 2.0 * (x * y + y * z + z * x)
    return found

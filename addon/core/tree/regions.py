# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of convex regions that are given by half-spaces, for many regions at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64

CHUNK = 20_000
"""Number of faces clipped at once: it bounds the memory of the polygons."""

REACH = 4.0
"""Half the side of the square that is cut to a face, in diagonals of the region's box."""

INSIDE = 1e-12
"""Distance outside of a half-space up to which a vertex counts as inside, in diagonals of the region's box."""


FAR = 1e30
"""Height of a half-space that cuts nothing, in diagonals of the region's box."""


@dataclass(frozen=True, eq=False)
class Faces:
    """Polygons of faces, one after another. owner: (f,), region of each face. offsets: (f + 1,), first vertex of each
    face. vertices: (v, 3).
    """

    owner: NDArray[np.int64]
    offsets: NDArray[np.int64]
    vertices: F64

    def areas(self) -> F64:
        """(f,), area of each face."""
        return areas(self.vertices, self.offsets)


def box_faces(box: F64) -> list[F64]:
    """The six faces of a box, (4, 3) each, two across each axis. box: (6,), lower and upper corner."""
    made = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for height in (box[axis], box[3 + axis]):
            ring = np.tile(box[:3], (4, 1))
            ring[1:3, first], ring[2:, second], ring[:, axis] = box[3 + first], box[3 + second], height
            made.append(ring)
    return made


def areas(vertices: F64, offsets: NDArray[np.int64]) -> F64:
    """(f,), area of plane polygons. vertices: (v, 3). offsets: (f + 1,), first vertex of each; none is empty."""
    sizes = np.diff(offsets)
    if not len(sizes):
        return np.zeros(0)
    first = np.repeat(vertices[offsets[:-1]], sizes, axis=0)
    following = np.arange(1, len(vertices) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    crossed = np.cross(vertices - first, vertices[following] - first)
    found: F64 = 0.5 * np.linalg.norm(np.add.reduceat(crossed, offsets[:-1]), axis=1)
    return found


def faces(walls: F64, offsets: NDArray[Any], bounds: F64) -> Faces:
    """The faces of regions.

    walls: (w, 4), outward unit normal and height of each half-space. offsets: (n + 1,), first wall of each region.
    bounds: (n, 6), a box around each region. Walls that do not touch the region have no face.
    """
    owner = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    parts = [
        _clipped(walls, offsets, bounds, np.arange(start, min(start + CHUNK, len(walls))), owner)
        for start in range(0, len(walls), CHUNK)
    ]
    if not parts:
        return Faces(np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros((0, 3)))
    sizes = np.concatenate([sizes for _, sizes, _ in parts])
    return Faces(
        np.concatenate([owners for owners, _, _ in parts]),
        np.concatenate([[0], np.cumsum(sizes)]),
        np.concatenate([vertices for _, _, vertices in parts]),
    )


def _clipped(
    walls: F64, offsets: NDArray[Any], bounds: F64, rows: NDArray[np.int64], owner: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], F64]:
    """Owners, numbers of vertices and vertices of the faces on these walls, without the empty ones."""
    own = owner[rows]
    middle = 0.5 * (bounds[own, :3] + bounds[own, 3:])
    size = np.maximum(np.linalg.norm(bounds[own, 3:] - bounds[own, :3], axis=1), np.finfo(np.float64).tiny)
    # Start with a square in the plane of each wall, in units of the region's size around its middle.
    normal = walls[rows, :3]
    height = (walls[rows, 3] - (normal * middle).sum(axis=1)) / size
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    along = np.cross(normal, across)
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    polygon = (height[:, None] * normal)[:, None] + REACH * (
        signs[None, :, :1] * across[:, None] + signs[None, :, 1:] * along[:, None]
    )
    count = np.full(len(rows), 4)
    # Cut it with each other wall of its region.
    for place in range(int(np.diff(offsets)[own].max(initial=0))):
        other = offsets[own].astype(np.int64) + place
        applies = (other < offsets[own + 1]) & (other != rows)
        cutting = walls[np.minimum(other, len(walls) - 1)]
        limit = (cutting[:, 3] - (cutting[:, :3] * middle).sum(axis=1)) / size
        polygon, count = _cut(polygon, count, cutting[:, :3], np.where(applies, limit, FAR))
    kept = count > 2
    mask = np.arange(polygon.shape[1])[None] < count[:, None]
    placed = polygon * size[:, None, None] + middle[:, None]
    return own[kept], count[kept], placed[kept][mask[kept]]


def _cut(polygon: F64, count: NDArray[np.int64], normal: F64, limit: F64) -> tuple[F64, NDArray[np.int64]]:
    """Convex polygons cut to half-spaces (Sutherland and Hodgman 1974). polygon: (f, v, 3), of which `count` are used.

    Returns polygons with room for one more vertex, and their counts.
    """
    rows, room = polygon.shape[:2]
    place = np.arange(room)[None]
    used = place < count[:, None]
    following = np.where(place + 1 < count[:, None], place + 1, 0)
    outside = (polygon * normal[:, None]).sum(axis=2) - limit[:, None] - INSIDE
    inside = used & (outside <= 0)
    after = np.take_along_axis(outside, following, axis=1)
    crosses = used & ((outside <= 0) != (after <= 0))
    # Emit each vertex inside, and the point where an edge leaves or enters.
    share = np.where(crosses, outside / np.where(crosses, outside - after, 1.0), 0.0)
    target = np.take_along_axis(polygon, following[..., None], axis=1)
    cut = polygon + share[..., None] * (target - polygon)
    points = np.stack([polygon, cut], axis=2).reshape(rows, 2 * room, 3)
    chosen = np.stack([inside, crosses], axis=2).reshape(rows, 2 * room)
    # Move the chosen points to the front.
    order = np.argsort(~chosen, axis=1, kind="stable")[:, : room + 1]
    return np.take_along_axis(points, order[..., None], axis=1), chosen.sum(axis=1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines along which planes of a structure cut the triangles of the scene: they show where a plane lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32

MOST_PAIRS = 8_000_000
"""Largest number of pairs of a polygon and a triangle that are compared: a fraction of a second."""

MOST_POLYGONS, MOST_SLABS = 64, 20
"""Largest numbers of polygons and of sides of slabs that are cut: more lines would cover the scene."""


@dataclass(frozen=True, eq=False)
class Cuts:
    """Line segments. ends: (s, 2, 3) float32, scene frame. owner: (s,) int32, the polygon of each."""

    ends: F32
    owner: I32


def find(polygons: NDArray[Any], vertices: F32, offsets: NDArray[Any], mesh: tuple[F32, I32]) -> Cuts:
    """The segments of these convex polygons, in their order, up to the limits.

    polygons: their numbers. vertices, offsets: as in Planes. mesh: (n, 3) corners and (m, 3) triangles.
    """
    most = min(MOST_POLYGONS, MOST_PAIRS // max(len(mesh[1]), 1))
    made, owners = [np.zeros((0, 2, 3))], [np.zeros(0, np.int32)]
    corners, triangles = mesh[0].astype(np.float64) if most else made[0], mesh[1]
    for number in polygons[:most].tolist():
        ring = vertices[offsets[number] : offsets[number + 1]].astype(np.float64)
        segments = clipped(crossed(corners, triangles, ring), ring)
        made.append(segments)
        owners.append(np.full(len(segments), number, np.int32))
    return Cuts(np.concatenate(made).astype(np.float32), np.concatenate(owners))


def crossed(corners: F64, triangles: I32, ring: F64) -> F64:
    """(s, 2, 3), segments along which triangles cross the plane of a ring (v, 3) of points."""
    normal = _normal(ring)
    with np.errstate(invalid="ignore"):
        heights = ((corners - ring.mean(axis=0)) @ normal)[triangles]
        above = heights > 0
    rows = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1) & np.isfinite(heights).all(axis=1))
    # One corner lies alone on its side; the segment's ends are on the two edges from it.
    heights, above = heights[rows], above[rows]
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    points, every = corners[triangles[rows]], np.arange(len(rows))
    first, height = points[every, alone], heights[every, alone]
    ends = []
    for step in (1, 2):
        other = (alone + step) % 3
        share = height / (height - heights[every, other])
        ends.append(first + share[:, None] * (points[every, other] - first))
    found: F64 = np.stack(ends, axis=1)
    return found


def clipped(segments: F64, ring: F64) -> F64:
    """(s, 2, 3), the parts of segments in the plane of a convex ring that lie in it (Cyrus and Beck 1978)."""
    normal, inside = _normal(ring), ring.mean(axis=0)
    way = segments[:, 1] - segments[:, 0]
    low, high = np.zeros(len(segments)), np.ones(len(segments))
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        inwards = np.cross(normal, b - a)
        inwards *= np.sign((inside - a) @ inwards)
        height, slope = (segments[:, 0] - a) @ inwards, way @ inwards
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -height / slope
        low = np.where(slope > 0, np.maximum(low, at), low)
        high = np.where(slope < 0, np.minimum(high, at), high)
        high = np.where((slope == 0) & (height < 0), -1.0, high)
    kept = low < high
    ends: F64 = segments[kept, :1] + np.stack([low, high], axis=1)[kept, :, None] * way[kept, None]
    return ends


def _normal(ring: F64) -> F64:
    """The normal of a ring of points, of length one; zero if they lie on a line."""
    spokes = ring - ring.mean(axis=0)
    normal = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    found: F64 = normal / length if length > 0 else np.zeros(3)
    return found

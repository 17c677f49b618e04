# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres as triangles: icosahedra whose triangles are divided into four, again and again."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import F32, F64, I32

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_LEVELS = 4
"""Divisions of a sphere: it has 20 × 4^levels triangles."""

DEVIATION = 0.125
"""Largest distance in pixels between a sphere and its triangles, while the limit above allows it."""


def level_of(radius: float, pixel: float) -> int:
    """The number of divisions of a sphere of this radius, where a pixel has this size in the same unit."""
    for level in range(1, MOST_LEVELS):
        # An edge of the sphere's triangles spans about 63 degrees divided by 2^level.
        if radius * (1 - math.cos(math.radians(63.4) / 2 ** (level + 1))) <= DEVIATION * pixel:
            return level
    return MOST_LEVELS


@cache
def sphere(level: int) -> tuple[F64, F64, I32]:
    """Positions and normals, each (n, 3), and outward triangles, (m, 3), of a unit sphere.

    The positions are scaled to the mean silhouette of the sphere over all directions (Cauchy: a quarter of the surface
    of a convex body).
    """
    normals, triangles = _icosahedron()
    for _ in range(level):
        normals, triangles = _divided(normals, triangles)
    a, b, c = (normals[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    positions = normals * math.sqrt(4 * math.pi / area)
    for array in (positions, normals, triangles):
        array.flags.writeable = False
    return positions, normals, triangles


def spheres(centres: F32, radii: F32, level: int) -> tuple[F32, F32, I32]:
    """The same for a sphere around each of the centres, (k, 3), one after the other, as float32."""
    positions, normals, triangles = sphere(level)
    n = len(positions)
    placed = centres.astype(np.float64)[:, None] + radii.astype(np.float64)[:, None, None] * positions
    first = np.arange(len(centres), dtype=np.int32)[:, None, None] * np.int32(n)
    return (
        placed.reshape(-1, 3).astype(np.float32),
        np.tile(normals.astype(np.float32), (len(centres), 1)),
        np.ascontiguousarray((first + triangles).reshape(-1, 3), np.int32),
    )


def _icosahedron() -> tuple[F64, I32]:
    golden = (1 + math.sqrt(5)) / 2
    short, long = 1 / math.hypot(1, golden), golden / math.hypot(1, golden)
    corners = [(0.0, s * short, t * long) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    # A face joins three vertices at the distance of an edge.
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < 2.1 * short
    faces = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    outward = np.dot(np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a]), vertices[a]) > 0
                    faces.append((a, b, c) if outward else (a, c, b))
    return vertices, np.array(faces, np.int32)


def _divided(normals: F64, triangles: I32) -> tuple[F64, I32]:
    """Each triangle as four, with the middles of the edges moved out to the sphere."""
    a, b, c = triangles.T
    edges = np.sort(np.concatenate([np.stack(pair, axis=1) for pair in ((a, b), (b, c), (c, a))]), axis=1)
    known, number = np.unique(edges, axis=0, return_inverse=True)
    middles: NDArray[np.float64] = normals[known].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    ab, bc, ca = (number.reshape(-1) + len(normals)).reshape(3, -1)
    parts = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([normals, middles]), np.concatenate(parts).astype(np.int32)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of the lessons' scenes: vertices (n, 3) float32 and triangles (m, 3) int32."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...core.base.arrays import F32, F64, I32

Mesh = tuple[F32, I32]

SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Corners of the sides of a box, whose corners are in the order of x, y, z, the last the fastest."""


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """Meshes as one."""
    vertices: list[F32] = []
    triangles: list[I32] = []
    count = 0
    for corners, faces in meshes:
        vertices.append(corners)
        triangles.append(np.ascontiguousarray(faces + count, np.int32))
        count += len(corners)
    return np.concatenate(vertices), np.concatenate(triangles)


def box(low: Iterable[float], high: Iterable[float]) -> Mesh:
    """A box along the axes."""
    ends = np.array([[*low], [*high]], np.float32)
    corners = np.array([[ends[x, 0], ends[y, 1], ends[z, 2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    halves = [half for a, b, c, d in SIDES for half in ((a, b, c), (a, c, d))]
    return corners.astype(np.float32), np.array(halves, np.int32)


def sphere(centre: Iterable[float], radius: float, around: int) -> Mesh:
    """A sphere of `around` meridians and half as many parallels."""
    across = around // 2
    v = np.arange(1, across)[:, None] * (np.pi / across)
    u = np.arange(around)[None, :] * (2 * np.pi / around)
    rings = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v) + 0 * u], axis=-1).reshape(-1, 3)
    points = np.concatenate([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]]) * radius + np.array([*centre])
    here = np.arange((across - 1) * around, dtype=np.int32).reshape(across - 1, around)
    turned = np.roll(here, -1, axis=1)
    quads = np.stack([here[:-1], here[1:], turned[1:], here[:-1], turned[1:], turned[:-1]], axis=-1).reshape(-1, 3)
    top, bottom = np.full(around, here.size, np.int32), np.full(around, here.size + 1, np.int32)
    caps = [np.stack([top, here[0], turned[0]], axis=-1), np.stack([bottom, turned[-1], here[-1]], axis=-1)]
    return points.astype(np.float32), np.ascontiguousarray(np.concatenate([quads, *caps]), np.int32)


def turned(mesh: Mesh, matrix: F64) -> Mesh:
    """A mesh turned by a (3, 3) matrix."""
    return (mesh[0].astype(np.float64) @ matrix.T).astype(np.float32), mesh[1]

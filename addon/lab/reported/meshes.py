# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes and rays of the reports: vertices (n, 3), triangles (m, 3), origins and directions (r, 3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]
Mesh = tuple[F64, NDArray[np.int64]]

QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Faces of a box whose corner number has one bit for each axis."""


def mesh(vertices: ArrayLike, triangles: ArrayLike) -> Mesh:
    """A mesh from lists."""
    return np.asarray(vertices, np.float64), np.asarray(triangles, np.int64)


def box(low: ArrayLike, high: ArrayLike) -> Mesh:
    """A closed box of twelve triangles."""
    ends = np.array([low, high], np.float64)
    corners = [[ends[i >> 2 & 1, 0], ends[i >> 1 & 1, 1], ends[i & 1, 2]] for i in range(8)]
    triangles = [[q[0], q[i], q[i + 1]] for q in QUADS for i in (1, 2)]
    return mesh(corners, triangles)


def subdivided(given: Mesh, levels: int) -> Mesh:
    """The mesh with each triangle split into four at the midpoints of its edges, `levels` times."""
    vertices, triangles = given
    for _ in range(levels):
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts]).reshape(-1, 3)
        vertices, places = np.unique(corners, axis=0, return_inverse=True)
        triangles = places.reshape(-1, 3)
    return vertices, triangles


def three_sphere(radius: float, across: int, down: int) -> Mesh:
    """The latitudes and longitudes of SphereGeometry in three.js, whose poles are fans."""
    vertices, triangles = [], []
    for y in range(down + 1):
        for x in range(across + 1):
            phi, theta = 2 * np.pi * x / across, np.pi * y / down
            ring = np.sin(theta)
            vertices.append([-radius * np.cos(phi) * ring, radius * np.cos(theta), radius * np.sin(phi) * ring])
    for y in range(down):
        for x in range(across):
            a, b = y * (across + 1) + x + 1, y * (across + 1) + x
            c, d = b + across + 1, a + across + 1
            triangles += [[a, b, d]] * (y > 0) + [[b, c, d]] * (y < down - 1)
    return mesh(vertices, triangles)


def tube(radius: float, sides: int) -> Mesh:
    """The side of a cylinder around z, from z = -1 to 1, with a ring of vertices at z = 0 as well."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vertices = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (-1.0, 0.0, 1.0)])
    first = np.concatenate([np.arange(sides), sides + np.arange(sides)])
    after = first // sides * sides + (first + 1) % sides
    lower = np.stack([first, after, after + sides], axis=1)
    return vertices, np.concatenate([lower, np.stack([first, after + sides, first + sides], axis=1)])


def joined(*meshes: Mesh) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    triangles = [triangles + start for (_, triangles), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def rotation(axis: ArrayLike, degrees: float) -> F64:
    """The matrix of a rotation about an axis through the origin (Rodrigues)."""
    x, y, z = np.asarray(axis, np.float64) / np.linalg.norm(np.asarray(axis, np.float64))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def cosine_hemisphere(u: F64, v: F64) -> F64:
    """Directions around +z, uniform points of the unit square mapped to the disk concentrically (Shirley and Chiu)."""
    x, y = 2 * u - 1, 2 * v - 1
    steep = np.abs(x) < np.abs(y)
    radius = np.where(steep, y, x)
    ratio = np.divide(np.where(steep, x, y), radius, out=np.zeros_like(radius), where=radius != 0)
    angle = np.where(steep, np.pi / 2 - np.pi / 4 * ratio, np.pi / 4 * ratio)
    p, q = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([p, q, np.sqrt(np.maximum(0, 1 - p * p - q * q))], axis=-1)


class Pcg32:
    """The random numbers of pbrt-v4 (class RNG in util/rng.h): PCG32 of O'Neill 2014."""

    MULTIPLIER = 0x5851F42D4C957F2D
    MASK = (1 << 64) - 1

    def __init__(self, sequence: int) -> None:
        """The stream of this number, from the place that pbrt derives from it."""
        self._state, self._step = 0, (sequence << 1 | 1) & self.MASK
        self.integer()
        self._state = (self._state + self._mixed(sequence)) & self.MASK
        self.integer()

    def _mixed(self, v: int) -> int:
        # MixBits of pbrt's util/hash.h.
        v = ((v ^ v >> 31) * 0x7FB5D329728EA185) & self.MASK
        v = ((v ^ v >> 27) * 0x81DADEF4BC2DD44D) & self.MASK
        return v ^ v >> 33

    def integer(self) -> int:
        """32 random bits."""
        old = self._state
        self._state = (old * self.MULTIPLIER + self._step) & self.MASK
        bits, turn = ((old >> 18 ^ old) >> 27) & 0xFFFFFFFF, old >> 59
        return (bits >> turn | bits << (-turn & 31)) & 0xFFFFFFFF

    def below(self, limit: int) -> int:
        """A random integer from 0 to limit - 1."""
        threshold = (1 << 32) % limit
        while (number := self.integer()) < threshold:
            pass
        return number % limit

    def uniform(self) -> float:
        """A float32 from 0 up to, without, 1."""
        return float(min(np.float32(1) - np.finfo(np.float32).epsneg, np.float32(self.integer() * 2.0**-32)))

    def on_sphere(self) -> F64:
        """A point of the unit sphere."""
        z, phi = 1 - 2 * self.uniform(), 2 * np.pi * self.uniform()
        ring = np.sqrt(max(0.0, 1 - z * z))
        return np.array([ring * np.cos(phi), ring * np.sin(phi), z])


def pbrt_sphere() -> Mesh:
    """The closed spiky sphere of pbrt-v4's test Triangle.Watertight."""
    random, rows, columns = Pcg32(12111), 16, 16
    vertices: list[Any] = []
    for row in range(rows):
        for column in range(columns):
            theta, phi = np.pi * row / (rows - 1), 2 * np.pi * column / (columns - 1)
            if row in (0, rows - 1):
                vertices.append([0, 0, 1 if row == 0 else -1])
            elif column == columns - 1:
                vertices.append(vertices[len(vertices) - (columns - 1)])
            else:
                ring = np.sin(theta)
                radius = 1 + 5 * random.uniform()
                vertices.append(radius * np.array([ring * np.cos(phi), ring * np.sin(phi), np.cos(theta)]))
    triangles = []
    for column in range(columns - 1):
        first, last = columns + column, (rows - 2) * columns + column
        triangles += [[0, first, first + 1], [(rows - 1) * columns, last, last + 1]]
        for row in range(1, rows - 2):
            a = row * columns + column
            triangles += [[a, a + columns, a + columns + 1], [a, a + columns + 1, a + 1]]
    return mesh(vertices, triangles)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in scene `grid`: touching boxes on a lattice, and rays that a traversal without error bounds loses.

Every inner wall is present twice, so nearly every hit is a tie; all planes pass through lattice coordinates, and most
rays run along an axis, inside a wall, through an edge or through a corner.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32, F64, I32
from .rays import RaySet
from .workload import View, Workload

BOXES = 6
"""Boxes along each axis."""

RAYS = 1 << 20


def workload(boxes: int = BOXES, rays: int = RAYS, seed: int = 1) -> Workload:
    """The lattice of `boxes`³ unit boxes, with a view of it and its own ray set `walls`."""
    vertices, triangles = _boxes(boxes)
    # Start inside a box: from outside, no bounced ray would hit anything.
    eye = np.full(3, boxes // 2) + np.array([0.25, 0.125, 0.5])
    view = View(eye, eye + np.array([0.5, 0.75, 0.0]), np.array([0.0, 0.0, 1.0]), 70.0)
    return Workload("grid", vertices, triangles, view, extra=(walls(boxes, rays, seed),))


def walls(boxes: int, count: int, seed: int) -> RaySet:
    """About `count` rays, an eighth of each kind; directions are not of unit length.

    Kinds: along an axis anywhere; along an axis in a wall; along an edge; in a wall in any direction; to a corner; to a
    point on an edge; from a corner along a diagonal or an axis; random.
    """
    rng = np.random.default_rng(seed)
    each = -(-count // 8)
    axis = rng.integers(0, 3, each)
    row = np.arange(each)

    def anywhere() -> F64:
        return rng.uniform(-1.0, boxes + 1.0, (each, 3))

    def lattice() -> F64:
        return rng.integers(0, boxes + 1, (each, 3)).astype(np.float64)

    def along_axis() -> F64:
        # Multiply by a sign, so that the zeros have both signs too.
        direction = np.zeros((each, 3))
        direction[row, axis] = 1.0
        return direction * rng.choice([-1.0, 1.0], each)[:, None]

    def with_lattice(points: F64, which: np.ndarray) -> F64:
        points[row, which] = lattice()[row, which]
        return points

    def towards(origins: F64, targets: F64) -> tuple[F64, F64]:
        # Round to values exact in float32, so that the ray passes exactly through its target.
        origins = np.round(origins * 256.0) / 256.0
        return origins, targets - origins

    # Combine the kinds from lattice and random coordinates.
    in_wall = rng.normal(size=(each, 3))
    in_wall[row, axis] = 0.0
    edge_points = with_lattice(with_lattice(anywhere(), axis), (axis + 1) % 3)
    diagonal = rng.integers(-1, 2, (each, 3)).astype(np.float64)
    diagonal[~diagonal.any(axis=1)] = 1.0
    kinds = [
        (anywhere(), along_axis()),
        (with_lattice(anywhere(), (axis + 1) % 3), along_axis()),
        (with_lattice(with_lattice(anywhere(), (axis + 1) % 3), (axis + 2) % 3), along_axis()),
        (with_lattice(anywhere(), axis), in_wall),
        towards(anywhere(), lattice()),
        towards(anywhere(), np.round(edge_points * 256.0) / 256.0),
        (lattice(), diagonal),
        (anywhere(), rng.normal(size=(each, 3))),
    ]
    origins: F32 = np.concatenate([kind[0] for kind in kinds]).astype(np.float32)
    directions: F32 = np.concatenate([kind[1] for kind in kinds]).astype(np.float32)
    # A target may equal the origin; give such a ray a direction.
    directions[~directions.any(axis=1)] = 1.0
    return RaySet("walls", origins, directions, np.full(len(origins), np.inf, np.float32))


def _boxes(boxes: int) -> tuple[F32, I32]:
    """Vertices and triangles of the lattice; each box has its own 8 vertices and 12 triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    places = np.stack(np.meshgrid(*[np.arange(boxes)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    vertices = (places[:, None, :] + corners).reshape(-1, 3).astype(np.float32)
    triangles = (halves + len(corners) * np.arange(len(places))[:, None, None]).reshape(-1, 3)
    return vertices, np.ascontiguousarray(triangles, np.int32)

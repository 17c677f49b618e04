# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of directions around a viewer that polygons of a structure cover, and polygons that would be fog."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..tree.regions import box_faces

STEP = 64
"""Steps to which places of the viewer are rounded, per diagonal of the structure, or per distance to it if it is far:
what is drawn changes only from step to step.
"""

FAR = 1000.0
"""Distance of a viewer with parallel lines of sight, in diagonals of the structure."""

NEAR = np.pi / 2
"""Solid angle in steradians, an eighth of all directions, from which a polygon is drawn without its surface."""


def rounded(eye: F64, box: F64) -> tuple[float, ...]:
    """A place (3,) in steps of the structure with this box, (2, 3) lower and upper corner."""
    diagonal = float(np.linalg.norm(box[1] - box[0]))
    if not diagonal:
        return tuple(eye.tolist())
    middle = box.mean(axis=0)
    away = max(float(np.linalg.norm(eye - middle)) / diagonal, 1.0)
    step = diagonal * 2.0 ** np.floor(np.log2(away)) / STEP
    return tuple((middle + step * np.round((eye - middle) / step)).tolist())


def parallel(direction: F64, box: F64) -> F64:
    """The place of a viewer who looks at a structure along this direction (3,), of length one, from very far away."""
    diagonal: float = float(np.linalg.norm(box[1] - box[0]))
    away: F64 = box.mean(axis=0) - FAR * diagonal * direction
    return away


def solid_angles(vertices: NDArray[Any], offsets: NDArray[Any], eye: F64) -> F64:
    """(p,), steradians that each polygon covers as seen from a place (3,) (Van Oosterom and Strackee 1983).

    vertices: (v, 3) of flat convex polygons. offsets: (p + 1,), first vertex of each.
    """
    sizes = np.diff(offsets).astype(np.int64)
    if not len(sizes):
        return np.zeros(0)
    # Form the triangles of a fan around each polygon's first vertex.
    fans = np.maximum(sizes - 2, 0)
    owner = np.repeat(np.arange(len(sizes)), fans)
    first = np.asarray(offsets, np.int64)[owner]
    within = np.arange(len(owner)) - np.repeat(np.cumsum(fans) - fans, fans)
    towards = vertices.astype(np.float64) - eye
    lengths = np.linalg.norm(towards, axis=1)
    a, b, c = (towards[rows] for rows in (first, first + within + 1, first + within + 2))
    la, lb, lc = (lengths[rows] for rows in (first, first + within + 1, first + within + 2))
    # The signs of a fan's triangles agree, since the polygon is convex.
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    rest = la * lb * lc + lc * (a * b).sum(axis=1) + lb * (a * c).sum(axis=1) + la * (b * c).sum(axis=1)
    angles: F64 = np.abs(np.bincount(owner, 2.0 * np.arctan2(volume, rest), len(sizes)))
    return angles


def whole(box: F64, eye: F64) -> float:
    """Steradians that a box, (2, 3) lower and upper corner, covers; all around from inside."""
    if ((eye >= box[0]) & (eye <= box[1])).all():
        return 4.0 * np.pi
    # Each line of sight through the box meets two of its faces.
    corners = np.concatenate(box_faces(box.reshape(6)))
    return max(float(solid_angles(corners, np.arange(0, 25, 4), eye).sum()) / 2, 1e-12)


def around(vertices: NDArray[Any], offsets: NDArray[Any], boxes: NDArray[np.bool_], eye: F64) -> NDArray[np.bool_]:
    """(p,), whether each polygon is a face of a box around the viewer. boxes: (p,), faces of boxes, six after another.

    Of a box that the end of the list cuts off, all faces are False.
    """
    found = np.zeros(len(boxes), bool)
    faces = np.flatnonzero(boxes)
    rows = faces[: len(faces) - len(faces) % 6].reshape(-1, 6)
    if not len(rows):
        return found
    # The first two faces of a box hold all of its corners.
    first = np.asarray(offsets, np.int64)[rows[:, :2]]
    corners = vertices[(first[:, :, None] + np.arange(4)).reshape(len(rows), 8)].astype(np.float64)
    inside = ((eye >= corners.min(axis=1)) & (eye <= corners.max(axis=1))).all(axis=1)
    found[rows[inside]] = True
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of directions around a viewer that polygons of a structure cover, and polygons that would be fog."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64
from ..tree.regions import box_faces

STEP = 64
"""Steps to which places of the viewer are rounded, per diagonal of the structure, or per distance to it if it is far:
what is drawn changes only from step to step.
"""

FAR = 1000.0
"""Distance of a viewer with parallel lines of sight, in diagonals of the structure."""

NEAR = np.pi / 2
"""Solid angle in steradians, an eighth of all directions, from which a polygon is drawn without its surface."""


SLANTED, EDGE_ON = 0.35, 0.12
"""Sine of the angle between a polygon and the line of sight below which it is fainter, and the smallest such factor."""

LEAST_SHARE = 0.5
"""Factor on the opacity of polygons that hardly any ray meets."""

AWAY, AROUND, LEAST_FACE = 0.12, 0.25, 0.4
"""Factors on the opacity of faces of boxes that are turned away from the viewer, and of boxes around the viewer; the
smallest of other faces.
"""


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


def weights(vertices: NDArray[Any], offsets: NDArray[Any], eye: F64) -> F32:
    """(p,), factors on the opacity of polygons for a viewer at `eye` (3,), in sixteenths.

    A polygon is fainter if few random rays meet it (the root of its share of the largest area), if it is seen from the
    side (its edges would add up to a glaring line), and the farther away it is.
    """
    centre, normal = _poses(vertices, offsets)
    area = np.linalg.norm(normal, axis=1)
    towards = centre - eye
    distance = np.maximum(np.linalg.norm(towards, axis=1), np.finfo(np.float64).tiny)
    slant = np.abs((normal * towards).sum(axis=1)) / np.maximum(area * distance, np.finfo(np.float64).tiny)
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64)
    reach = 0.5 * float(np.linalg.norm(box[1] - box[0])) or 1.0
    share = np.sqrt(area / max(float(area.max(initial=0.0)), np.finfo(np.float64).tiny))
    near = (float(distance.min(initial=np.inf)) + reach) / (distance + reach) if len(distance) else distance
    found = np.maximum(share, LEAST_SHARE) * np.clip(slant / SLANTED, EDGE_ON, 1.0) * near
    rounded_up: F32 = (np.ceil(16 * found) / 16).astype(np.float32)
    return rounded_up


def turned_away(
    vertices: NDArray[Any], offsets: NDArray[Any], body: NDArray[Any], eye: F64
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Two (p,): whether each polygon is a face of a convex body around the viewer; whether it is a face of another body
    and turned away from the viewer. body: (p,), the body of each polygon, or -1.
    """
    of_body = body >= 0
    centre, normal = _poses(vertices, offsets)
    index = np.where(of_body, body, 0)
    counts = np.maximum(np.bincount(index, of_body), 1.0)
    middle = np.stack([np.bincount(index, np.where(of_body, centre[:, axis], 0.0)) for axis in range(3)], axis=1)
    outwards = np.sign((normal * (centre - (middle / counts[:, None])[index])).sum(axis=1))
    behind = of_body & (outwards * (normal * (eye - centre)).sum(axis=1) < 0)
    around = np.bincount(index, behind) == counts
    inside: NDArray[np.bool_] = of_body & around[index]
    return inside, behind & ~inside


def _poses(vertices: NDArray[Any], offsets: NDArray[Any]) -> tuple[F64, F64]:
    """(p, 3) middle of the vertices of each polygon, and its normal, as long as twice its area."""
    points, starts = vertices.astype(np.float64), np.asarray(offsets, np.int64)
    sizes = np.diff(starts)
    if not len(sizes):
        return np.zeros((0, 3)), np.zeros((0, 3))
    centre: F64 = np.add.reduceat(points, starts[:-1], axis=0) / sizes[:, None]
    following = np.arange(1, len(points) + 1)
    following[starts[1:] - 1] = starts[:-1]
    spokes = points - np.repeat(centre, sizes, axis=0)
    normal: F64 = np.add.reduceat(np.cross(spokes, spokes[following]), starts[:-1], axis=0)
    return centre, normal

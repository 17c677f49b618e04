# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact answers in integers of Python, independent of the native module and its oracle.

A float32 is an integer multiple of 2**-149, so all products are exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Vector = tuple[int, int, int]


@dataclass(frozen=True)
class Exact:
    """The nearest hit of a ray: distance in units of its direction, rounded once, and the smallest triangle there."""

    t: np.float32
    triangle: int


def integers(points: NDArray[np.float32]) -> list[Vector]:
    """Points (n, 3) in units of 2**-149."""
    rows = np.asarray(points, np.float64).tolist()
    # In f64 the product is exact, and an integer.
    return [(int(math.ldexp(x, 149)), int(math.ldexp(y, 149)), int(math.ldexp(z, 149))) for x, y, z in rows]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Vector, b: Vector) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def distance(corners: Sequence[Vector], origin: Vector, direction: Vector) -> Fraction | None:
    """The distance to a triangle with its edges, None for a miss; a ray in its plane misses it."""
    a, b, c = (_minus(corner, origin) for corner in corners)
    # The ray passes on the same side of all three edges.
    sides = (
        _dot(direction, _cross(b, a)),
        _dot(direction, _cross(c, b)),
        _dot(direction, _cross(a, c)),
    )
    if min(sides) < 0 < max(sides):
        return None
    normal = _cross(_minus(b, a), _minus(c, a))
    slope = _dot(normal, direction)
    return None if slope == 0 else Fraction(_dot(normal, a), slope)


def nearest(
    vertices: NDArray[np.float32],
    triangles: NDArray[np.int32],
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
) -> list[Exact | None]:
    """The nearest hit of each ray from its origin on, None for a miss."""
    points = integers(vertices)
    corners = [tuple(points[i] for i in triangle) for triangle in triangles.tolist()]
    answers = []
    for origin, direction in zip(integers(origins), integers(directions), strict=True):
        best: Exact | None = None
        for number, triangle in enumerate(corners):
            t = distance(triangle, origin, direction)
            if t is not None and t >= 0 and (best is None or rounded(t) < best.t):
                best = Exact(rounded(t), number)
        answers.append(best)
    return answers


def rounded(exact: Fraction) -> np.float32:
    """The nearest float32, of two the even one; within the range of normal numbers."""
    # Two roundings in a row are at most one step away.
    near = np.float32(float(exact))
    three = [np.nextafter(near, np.float32(-np.inf)), near, np.nextafter(near, np.float32(np.inf))]
    return min(three, key=lambda x: (abs(Fraction(float(x)) - exact), int(x.view(np.uint32)) & 1))

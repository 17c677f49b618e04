# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles that no ray can hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, I32


def faulty(vertices: F32, triangles: I32) -> NDArray[np.bool_]:
    """(m,) bool: triangles without area or with a non-finite vertex."""
    finite = np.isfinite(vertices).all(axis=1)
    found = np.zeros(len(triangles), bool) if finite.all() else ~finite[triangles].all(axis=1)
    # Nearly all others have an area that is certain in f32 in one coordinate plane. Compute only the rest in f64.
    doubtful = np.flatnonzero(~found)
    columns = [np.ascontiguousarray(column) for column in vertices.T]
    for x, y in ((0, 1), (1, 2), (2, 0)):
        doubtful = doubtful[~_plainly_sound(columns[x], columns[y], triangles[doubtful])]
    edges = vertices[triangles[doubtful]].astype(np.float64)
    normals = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    found[doubtful] = ~normals.any(axis=1)
    return found


CLEAR = np.float32(2.0**-20)
"""Derived: differences, products and their difference are rounded four times, each by at most 2^-24 of the products'
sum.
"""

TINY = np.float32(1e-30)
"""Derived: far above what underflow can remove from a product."""


def _plainly_sound(x: F32, y: F32, triangles: I32) -> NDArray[np.bool_]:
    """(m,) bool: triangles that certainly have an area in the plane of these finite coordinates, each (n,)."""
    a, b, c = triangles.T
    x0, y0 = x[a], y[a]
    with np.errstate(invalid="ignore", over="ignore"):
        left, right = (x[b] - x0) * (y[c] - y0), (y[b] - y0) * (x[c] - x0)
        size = np.abs(left) + np.abs(right)
        sound: NDArray[np.bool_] = (np.abs(left - right) > CLEAR * size + TINY) & np.isfinite(size)
    return sound

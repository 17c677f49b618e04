# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons as triangles, of any outline that does not cross itself.

A polygon is seen along the axis in which its normal is longest, so that no coordinate changes. A convex one becomes a
fan around its first corner. Others are cut by clipping ears (Meisters 1975), whose tests are exact: float64 where its
error bound (Shewchuk 1997) decides, rational numbers elsewhere.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ROUNDING = (3 + 16 * 2.0**-53) * 2.0**-53
"""Bound on the error of a float64 determinant of two differences, relative to the sum of its products."""

CLEAR = 1e-9
"""Sine of the angle to the normal from which the sign of a fan's triangle is certain, far above all roundings."""


def triangles(vertices: F64, corners: I64, counts: I64) -> I64:
    """Polygons as triangles, (m, 3) indices of vertices, those of one polygon after another.

    vertices: (n, 3), as they are traced. corners: of all polygons, end to end, within the vertices. counts: number of
    corners of each polygon; those with fewer than 3 are dropped.
    """
    starts = np.cumsum(counts) - counts
    parts = np.maximum(counts - 2, 0)
    owners = np.repeat(np.arange(len(counts)), parts)
    firsts = np.cumsum(parts) - parts
    step = np.arange(parts.sum()) - firsts[owners]
    first = starts[owners]
    fans: I64 = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    # Cut those polygons otherwise whose fan turns back somewhere, or has a part without area.
    for polygon in np.unique(owners[_doubtful(vertices, fans, parts)]):
        own = slice(firsts[polygon], firsts[polygon] + parts[polygon])
        ring = corners[starts[polygon] : starts[polygon] + counts[polygon]]
        fans[own] = ring[_cut(vertices[ring])]
    return fans


def _doubtful(vertices: F64, fans: I64, parts: I64) -> NDArray[np.bool_]:
    """Which triangles of fans are not certainly turned as their polygon, (m,); none of triangles alone."""
    several = np.repeat(parts > 1, parts)
    found = np.zeros(len(fans), np.bool_)
    if not several.any():
        return found
    a, b, c = vertices[fans[several]].transpose(1, 0, 2)
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.cross(b - a, c - a)
        sizes = parts[parts > 1]
        whole = np.repeat(np.add.reduceat(normals, np.cumsum(sizes) - sizes), sizes, axis=0)
        length = np.linalg.norm(normals, axis=1) * np.linalg.norm(whole, axis=1)
        found[several] = ~((normals * whole).sum(axis=1) > CLEAR * length)
    return found


def _cut(points: F64) -> list[list[int]]:
    """The triangles of one polygon, as numbers of its corners, (n, 3). A fan where there is no area or no number."""
    count = len(points)
    fan = [[0, i, i + 1] for i in range(1, count - 1)]
    if not np.isfinite(points).all():
        return fan
    scale = np.abs(points - points[0]).max()
    if scale == 0:
        return fan
    sides = (points[1:] - points[0]) / scale
    normal = np.cross(sides[:-1], sides[1:]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    if normal[axis] == 0:
        return fan
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]]
    ears = _Ears(flat if normal[axis] > 0 else flat[:, ::-1])
    return ears.clip()


class _Ears:
    """A polygon in the plane, counterclockwise, whose ears are clipped one after another. flat: (n, 2)."""

    def __init__(self, flat: F64) -> None:
        self.flat = flat
        self.rest = np.arange(len(flat))

    def clip(self) -> list[list[int]]:
        """All triangles. Without an ear, as where the outline crosses itself, a corner without area is clipped, then
        any.
        """
        found: list[list[int]] = []
        at = misses = 0
        while len(self.rest) > 3:
            at %= len(self.rest)
            if misses < len(self.rest) and not self._is_ear(self._around(at)):
                at, misses = at + 1, misses + 1
                continue
            if misses == len(self.rest):
                flat = (i for i in range(len(self.rest)) if self._bend(self._around(i)) == 0)
                at = next(flat, at)
            found.append(self._around(at))
            # Leave the next corner to the next round: triangles around one corner become thin.
            self.rest, misses = np.delete(self.rest, at), 0
        return [*found, [int(one) for one in self.rest]]

    def _around(self, at: int) -> list[int]:
        """The corner `rest[at]` between its neighbours."""
        return [int(self.rest[i % len(self.rest)]) for i in (at - 1, at, at + 1)]

    def _bend(self, ear: list[int]) -> int:
        """To which side the outline turns at a corner."""
        before, tip, after = self.flat[ear]
        return int(self._turn(before, tip, after[None])[0])

    def _is_ear(self, ear: list[int]) -> bool:
        """Whether the triangle of a corner between its neighbours lies in what is left of the polygon."""
        if self._bend(ear) <= 0:
            return False
        before, tip, after = self.flat[ear]
        # Only few corners lie in the box around the triangle.
        box = self.flat[ear]
        low, high, (x, y) = box.min(axis=0), box.max(axis=0), self.flat[self.rest].T
        others = self.rest[(x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])]
        others = others[~np.isin(others, ear)]
        places = self.flat[others]
        inside = np.ones(len(others), np.bool_)
        for p, q in ((before, tip), (tip, after), (after, before)):
            inside &= self._turn(p, q, places) >= 0
        same = (places[:, None] == box).all(axis=2)
        if (inside & ~same.any(axis=1)).any():
            return False
        # An outline that touches itself at the tip may go on into the triangle.
        for corner in others[same[:, 1]]:
            place = int(np.flatnonzero(self.rest == corner)[0])
            neighbours = self.flat[[self.rest[place - 1], self.rest[(place + 1) % len(self.rest)]]]
            sides = np.minimum(self._turn(before, tip, neighbours), self._turn(tip, after, neighbours))
            if (sides > 0).any() or (sides == 0).all():
                return False
        return True

    def _turn(self, p: F64, q: F64, points: F64) -> NDArray[np.int64]:
        """On which side of the line from p to q points lie: 1 left, -1 right, 0 on it, exactly. points: (n, 2)."""
        left = (q[0] - p[0]) * (points[:, 1] - p[1])
        right = (q[1] - p[1]) * (points[:, 0] - p[0])
        difference = left - right
        found: I64 = np.sign(difference).astype(np.int64)
        for i in np.flatnonzero(~(np.abs(difference) > ROUNDING * (np.abs(left) + np.abs(right)))):
            a, b, c = ([Fraction(float(x)) for x in one] for one in (p, q, points[i]))
            exact = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            found[i] = (exact > 0) - (exact < 0)
        return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves with a radius at each point as tubes of triangles.

A curve is a Catmull-Rom spline through its points, which passes position and radius alike, or a chain of straight
lines. It is divided into pieces, and a regular polygon around each division point is joined to the next one. All
curves are computed together: no Python code runs per curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import F32, F64, I32

if TYPE_CHECKING:
    from numpy.typing import NDArray

FEWEST_SIDES, MOST_SIDES = 3, 23
"""Sides of a tube, an odd number: seen from all around, the breadth of a polygon with three sides varies as little as
that of one with six. The normals are those of round hair with any number.
"""

COARSER = (5, 3)
"""Sides of tubes if there would be too many triangles otherwise."""

MOST_PIECES = 8
"""Pieces of a curve between two of its points."""

DEVIATION = 0.125
"""Largest distance in pixels between a tube and its curve, while the limits above allow it."""


THIN = 1e-5
"""Radius relative to the coordinates below which corners of a polygon may be equal in f32."""

GOLDEN = (math.sqrt(5) - 1) / 2
"""The share of a turn, up to whole sides, between the polygons of one curve and the next."""


@dataclass(frozen=True, eq=False)
class Strands:
    """Curves in their own space.

    points: (n, 3) float32. radii: (n,) float32. first: (k + 1,) int64, the first point of each curve and n. numbers:
    (k,) int64, the number of each curve in Blender's data. rows: (n,) int64, that of each point. straight: whether
    curves are chains of straight lines.
    """

    points: F32
    radii: F32
    first: NDArray[np.int64]
    numbers: NDArray[np.int64]
    rows: NDArray[np.int64]
    straight: bool = False

    @property
    def counts(self) -> NDArray[np.int64]:
        """Points of each curve, (k,)."""
        return np.diff(self.first)

    @property
    def segments(self) -> int:
        """Number of pairs of adjacent points."""
        return len(self.points) - len(self.counts)

    def curve_of_point(self) -> NDArray[np.int64]:
        """The curve of each point, (n,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def chosen(self, keep: NDArray[np.bool_]) -> Strands:
        """Those curves whose flag in `keep`, (k,), is set."""
        if keep.all():
            return self
        points = np.repeat(keep, self.counts)
        first = np.concatenate([[0], np.cumsum(self.counts[keep])]).astype(np.int64)
        return Strands(
            self.points[points], self.radii[points], first, self.numbers[keep], self.rows[points], self.straight
        )


def strands(points: F32, radii: F32, first: NDArray[np.int64], *, straight: bool = False) -> Strands:
    """All curves of these arrays, see `Strands`."""
    numbers, rows = np.arange(len(first) - 1, dtype=np.int64), np.arange(len(points), dtype=np.int64)
    return Strands(points, radii, first.astype(np.int64), numbers, rows, straight)


def usable(found: Strands, bound: float) -> tuple[Strands, int, int]:
    """The curves that have a length and a radius, with negative radii as 0.

    Returns also the number of curves with a coordinate or radius that is not finite or not below `bound`, which are
    left out, and of curves with a negative radius.
    """
    if not len(found.counts):
        return found, 0, 0
    # Judge points first, and then curves by all their points.
    curve = found.curve_of_point()
    with np.errstate(invalid="ignore"):
        wrong = ~((np.abs(found.points) < bound).all(axis=1) & (np.abs(found.radii) < bound))
    broken = _any(wrong, curve, len(found.counts))
    negative = _any(found.radii < 0, curve, len(found.counts)) & ~broken
    thick = _any(found.radii > 0, curve, len(found.counts))
    apart = np.zeros(len(found.points), bool)
    apart[1:] = (found.points[1:] != found.points[:-1]).any(axis=1) & (curve[1:] == curve[:-1])
    long = _any(apart, curve, len(found.counts))
    kept = found.chosen(~broken & thick & long)
    radii = np.maximum(kept.radii, 0).astype(np.float32)
    sound = Strands(kept.points, radii, kept.first, kept.numbers, kept.rows, kept.straight)
    return sound, int(broken.sum()), int(negative.sum())


def _any(flags: NDArray[np.bool_], curve: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Whether any point of each curve has its flag set."""
    return np.bincount(curve[flags], minlength=count) > 0


def sides_of(radii: F64, pixels: F64) -> NDArray[np.int64]:
    """The number of sides of tubes of these radii, where a pixel has these sizes in the same unit."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # A third of the distance from a side's middle to its corner's circle is outside of the hair.
        share = np.clip(1.5 * DEVIATION * pixels / radii, 0, 1)
        sides = np.ceil(math.pi / np.arccos(1 - share))
    # Round up to odd numbers, which makes few different tubes.
    limited = np.clip(np.nan_to_num(sides, nan=MOST_SIDES, posinf=MOST_SIDES), FEWEST_SIDES, MOST_SIDES)
    return limited.astype(np.int64) | 1


def deviations(found: Strands) -> F64:
    """The distance of each spline between two points from their chord, (s,), in the unit of the curves."""
    if found.straight or not found.segments:
        return np.zeros(found.segments)
    points, at = _as_float64(found.points), _segments(found)
    before, begin, end, after = (points[part] for part in at)
    # The middle of a Catmull-Rom spline is farther from that of the chord than the outer points by a sixteenth.
    offset = (begin + end - before - after) / 16
    # Along the chord a spline may be ahead of its middle without any deviation.
    along = _directions(points, at[2], at[1])
    offset -= along * _dot(offset, along)
    distance: F64 = _length(offset)[:, 0]
    return distance


def pieces_of(found: Strands, deviation: F64, pixels: F64) -> NDArray[np.int64]:
    """The number of pieces between two points of each curve, (k,), with these `deviations`, where a pixel has these
    sizes, (k,).

    A spline's distance from its chord falls with the square of the number of pieces.
    """
    if found.straight or not found.segments:
        return np.ones(len(found.counts), np.int64)
    # Every curve has a segment. The largest deviation of its segments decides.
    largest = np.maximum.reduceat(deviation, found.first[:-1] - np.arange(len(found.counts)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pieces = np.nan_to_num(np.sqrt(largest / (DEVIATION * pixels)), nan=1.0, posinf=MOST_PIECES)
    return np.clip(np.ceil(pieces), 1, MOST_PIECES).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Tubes:
    """Triangles around curves.

    positions, normals: (n, 3) float32, polygon by polygon. triangles: (m, 3) int32. sides: (p,) int64, the vertices of
    each polygon. before, after: (p,) int64, the points of the curves on both sides of each polygon, and share: (p,)
    float32, that of the second one. numbers: (p,) int64, the curve of each, by its number in Blender's data. along:
    (p, 3) float32, the direction of the curve, or (0, 3) if that is not wanted.
    """

    positions: F32
    normals: F32
    triangles: I32
    sides: NDArray[np.int64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    share: F32
    numbers: NDArray[np.int64]
    along: F32

    def polygon_of_corner(self) -> NDArray[np.int64]:
        """The polygon of each corner of the triangles, (m, 3)."""
        each: NDArray[np.int64] = np.repeat(np.arange(len(self.sides)), self.sides).take(self.triangles)
        return each


def tubes(found: Strands, pieces: int, sides: int, *, directions: bool = False) -> Tubes:
    """Tubes of this number of sides around curves, each divided into `pieces` between two points.

    The polygons are wider than the circle that they replace by the factor that gives a tube the circle's mean
    breadth over all directions (Cauchy: the perimeter over pi). directions: whether those of the curves are wanted.
    """
    # Divide the curves.
    at = _segments(found)
    u = np.arange(pieces) / pieces
    spread = tuple(np.repeat(part, pieces) for part in at)
    share = np.tile(u, len(at[1]))
    both = np.concatenate([_as_float64(found.points), _as_float64(found.radii[:, None])], axis=1)
    if pieces == 1:
        inner = both[at[1]]
    else:
        inner = _line(both, spread, share) if found.straight else _spline(both, spread, share)
    # Put the last point of each curve after its pieces.
    counts = (found.counts - 1) * pieces + 1
    first = np.concatenate([[0], np.cumsum(counts)])
    last = first[1:] - 1
    is_last = np.zeros(first[-1], bool)
    is_last[last] = True
    ends = found.first[1:] - 1
    rows = np.empty((first[-1], 4))
    rows[~is_last], rows[last] = inner, both[ends]
    before, after, shares = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), np.zeros(len(rows))
    before[~is_last], before[last] = spread[1], ends
    after[~is_last], after[last] = spread[2], ends
    shares[~is_last] = share
    # Put a polygon around each point. Start at a different angle for each curve, so that breadths average for any view.
    centre, radius = rows[:, :3], np.maximum(rows[:, 3], 0)
    right, up = (part.astype(np.float32) for part in frames(centre, first))
    begin = np.repeat((found.numbers * GOLDEN) % 1.0, counts)
    angle = ((np.arange(sides) + begin[:, None]) * (2 * math.pi / sides)).astype(np.float32)[:, :, None]
    outward = np.cos(angle) * right[:, None]
    outward += np.sin(angle) * up[:, None]
    wider = (math.pi / sides) / math.sin(math.pi / sides)
    positions = (wider * radius).astype(np.float32)[:, None, None] * outward
    positions += centre.astype(np.float32)[:, None]
    # Join each polygon to the next one.
    corners = positions.reshape(-1, 3)
    triangles = _sides(np.flatnonzero(~is_last), sides)
    size = np.abs(centre).max(initial=0.0)
    repeated = (centre[1:] == centre[:-1]).all(axis=1)
    if radius.min(initial=np.inf) <= THIN * size or repeated.any():
        triangles = triangles[_apart(corners, triangles)]
    along = np.cross(right, up) if directions else np.empty((0, 3), np.float32)
    return Tubes(
        corners,
        outward.reshape(-1, 3),
        triangles,
        np.full(len(rows), sides, np.int64),
        found.rows[before],
        found.rows[after],
        shares.astype(np.float32),
        np.repeat(found.numbers, counts),
        along,
    )


def joined(parts: list[Tubes]) -> Tubes:
    """Several groups of tubes as one."""
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    columns = zip(
        *((p.positions, p.normals, p.sides, p.before, p.after, p.share, p.numbers, p.along) for p in parts), strict=True
    )
    positions, normals, *rest = (np.concatenate(column) for column in columns)
    triangles = np.concatenate([p.triangles + np.int32(start) for p, start in zip(parts, starts, strict=False)])
    return Tubes(positions, normals, triangles, *rest)


def _as_float64(values: F32) -> F64:
    return values.astype(np.float64)


def _segments(found: Strands) -> tuple[NDArray[np.int64], ...]:
    """For each pair of adjacent points of a curve the point before, both points, and the point after, each (s,).

    At the ends the pair's own points replace the missing neighbours.
    """
    curve = found.curve_of_point()
    begin = np.flatnonzero(curve[1:] == curve[:-1])
    low, high = found.first[curve[begin]], found.first[curve[begin] + 1] - 1
    return np.maximum(begin - 1, low), begin, begin + 1, np.minimum(begin + 2, high)


def _spline(values: F64, at: tuple[NDArray[np.int64], ...], u: F64) -> F64:
    """Catmull-Rom splines through rows of `values`, at `u` of each segment (Catmull and Rom 1974)."""
    before, begin, end, after = (values[part] for part in at)
    t = u[:, None]
    slope_begin, slope_end = (end - before) / 2, (after - begin) / 2
    rise = begin - end
    cubic = 2 * rise + slope_begin + slope_end
    square = -3 * rise - 2 * slope_begin - slope_end
    result: F64 = begin + t * (slope_begin + t * (square + t * cubic))
    return result


def tangents(before: F32, after: F32, u: F32) -> F32:
    """Unit vectors along Catmull-Rom splines, (n, 3), at `u`, (n,), between two points.

    before, after: positions and slopes there, (n, 6) each.
    """
    t = u[:, None]
    weights = (6 * t * (t - 1), (3 * t - 1) * (t - 1), 6 * t * (1 - t), t * (3 * t - 2))
    with np.errstate(over="ignore", invalid="ignore"):
        parts = (before[:, :3], before[:, 3:], after[:, :3], after[:, 3:])
        along = sum(weight * part for weight, part in zip(weights, parts, strict=True))
        length = np.linalg.norm(along, axis=1, keepdims=True)
        unit: F32 = (along / np.where(length > 0, length, 1)).astype(np.float32)
    return unit


def _line(values: F64, at: tuple[NDArray[np.int64], ...], u: F64) -> F64:
    begin, end = values[at[1]], values[at[2]]
    result: F64 = begin + u[:, None] * (end - begin)
    return result


def frames(points: F64, first: NDArray[np.int64]) -> tuple[F64, F64]:
    """Two unit vectors perpendicular to the curves at each of their points, (n, 3) each, that do not twist.

    first: (k + 1,), the first point of each curve and n. Each frame is the last one without its part along the curve
    (parallel transport); all curves advance together by one point at a time.
    """
    # Tangents are the directions from the point before to the one after.
    curve = np.repeat(np.arange(len(first) - 1), np.diff(first))
    ahead = np.minimum(np.arange(len(points)) + 1, first[curve + 1] - 1)
    behind = np.maximum(np.arange(len(points)) - 1, first[curve])
    tangent = _directions(points, ahead, behind)
    right = np.empty_like(points)
    counts = np.diff(first)
    order = np.argsort(-counts, kind="stable")
    begin = first[:-1][order]
    # At each step, the curves that still have points are a prefix of the sorted ones.
    active = np.searchsorted(-counts[order], -np.arange(counts.max(initial=0)), side="left")
    last = _perpendicular(tangent[begin])
    for step, number in enumerate(active.tolist()):
        rows = begin[:number] + step
        along = tangent[rows]
        turned = last[:number] - along * _dot(along, last[:number])
        length = _length(turned)
        lost = length[:, 0] < 1e-6
        turned /= np.where(length > 0, length, 1)
        if lost.any():
            turned[lost] = _perpendicular(along[lost])
        right[rows] = last = turned
    return right, np.cross(tangent, right)


def _directions(points: F64, ahead: NDArray[np.int64], behind: NDArray[np.int64]) -> F64:
    """Unit vectors between points; along z where both are equal."""
    along = points[ahead] - points[behind]
    length = _length(along)
    along /= np.where(length > 0, length, 1)
    along[length[:, 0] == 0] = (0, 0, 1)
    return along


def _perpendicular(vectors: F64) -> F64:
    """A unit vector perpendicular to each of these unit vectors."""
    least = np.abs(vectors).argmin(axis=1)
    other = np.cross(vectors, np.eye(3)[least])
    result: F64 = other / _length(other)
    return result


def _dot(a: F64, b: F64) -> F64:
    """The products of the rows of two (n, 3) arrays, (n, 1); `sum` takes several times as long for rows of three."""
    x, y, z = (a * b).T
    result: F64 = (x + y + z)[:, None]
    return result


def _length(vectors: F64) -> F64:
    """The lengths of (n, 3) vectors, (n, 1)."""
    result: F64 = np.sqrt(_dot(vectors, vectors))
    return result


def _apart(positions: F32, triangles: I32) -> NDArray[np.bool_]:
    """Triangles whose corners differ: at tips without radius one of each two has no area."""
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    result: NDArray[np.bool_] = (a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1)
    return result


def _sides(rings: NDArray[np.int64], sides: int) -> I32:
    """Two triangles for each side between each of these polygons and the next one, facing outward."""
    corner = np.arange(sides, dtype=np.int32)
    after = (corner + 1) % sides
    pattern = np.stack([corner, after, after + sides, corner, after + sides, corner + sides], axis=1)
    quads: I32 = (rings * sides).astype(np.int32)[:, None] + pattern.reshape(-1)
    return quads.reshape(-1, 3)

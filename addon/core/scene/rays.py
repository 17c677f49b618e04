# SPDX-License-Identifier: GPL-3.0-or-later
"""The ray sets of a benchmark, generated from one view and one seed.

*primary*: one ray per pixel centre of a pinhole view, in 8×8-pixel tiles; *shadow*: any-hit rays from the primary hits
to one point light; *diffuse*: one cosine-weighted bounce per primary hit, in scanline order; *shuffled*: the same in
random order. Origins of the last three are moved off the surface.

Further sets, after the categories of LumiBench (Liu, Saed, Chou et al. 2023): *ambient*: short any-hit rays, cosine-
weighted, from the primary hits; *second* and *fourth*: the second and the fourth diffuse bounce; *behind*: primary rays
that go on behind their hits, as through a cut-out; *long*: chords of the bounding box; *coplanar*: rays in the planes
of triangles.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64

if TYPE_CHECKING:
    from ..base.interface import Order, RayOptions, Tracer
    from .workload import View, Workload


NAMES = ("primary", "shadow", "diffuse", "shuffled")
"""The sets that are measured by default, in the order of the report."""

ALL = (*NAMES, "ambient", "second", "fourth", "behind", "long", "coplanar")
"""All sets in the order of the report."""

MOST_SEED = 1 << 31
"""Exclusive limit on ray seeds of a command line: pictures use the seeds after it, up to 32 bits."""

TILE = 8
"""Side of a tile in pixels."""

OFFSET = 2e-5
"""Distance of origins from the surface, as a share of the scene's diagonal."""

SHORT_OF_LIGHT = 1e-4
"""Share of their length by which shadow rays end before the light, so that no surface at the light blocks them."""

AMBIENT = 0.05
"""Length of ambient rays, as a share of the scene's diagonal."""

BEFORE = 0.25
"""Length of a coplanar ray before it meets its triangle, as a share of the scene's diagonal."""

PIXEL_BYTES, HIT_BYTES = 112, 400
"""Peak bytes per pixel of making the primary rays, and of the sets that start at hits in addition."""


@dataclass(frozen=True, eq=False)
class RaySet:
    """Rays that are traced together.

    origins, directions: (n, 3) float32, directions of unit length unless the set states otherwise. t_max: (n,) float32,
    inf for unbounded rays. any_hit: traced with `occluded`. order: the argument `order` of `closest`.
    """

    name: str
    origins: F32
    directions: F32
    t_max: F32
    any_hit: bool = False
    order: Order = "none"

    def __len__(self) -> int:
        return len(self.origins)

    def options(self, threads: int) -> RayOptions:
        """The keyword arguments of `closest` and `occluded` for these rays. threads: 0 = one per core."""
        return {"t_max": self.t_max, "order": self.order, "threads": threads}

    def take(self, indices: NDArray[np.int64] | slice) -> RaySet:
        """The rays with these indices; for tiles the indices must keep every 64 rays together."""
        return RaySet(
            self.name,
            self.origins[indices],
            self.directions[indices],
            self.t_max[indices],
            self.any_hit,
            self.order,
        )


def make(
    workload: Workload,
    tracer: Tracer,
    *,
    size: tuple[int, int],
    seed: int,
    names: Sequence[str],
    offset: float = OFFSET,
    rows: NDArray[np.int64] | None = None,
) -> list[RaySet]:
    """The named sets, in the order of ALL, then the scene's own.

    tracer: a native structure over the workload's triangles; it finds the primary hits. size: width and height in
    pixels, multiples of 8. offset: distance of origins from the surface, as a share of the diagonal. Sets that need
    hits are empty if no primary ray hits. rows: rows of tiles whose pixels have rays, from the top; None for all.
    Raises ValueError for a wrong size.
    """
    width, height = size
    if width % TILE or height % TILE or width <= 0 or height <= 0:
        raise ValueError(f"size: expected multiples of {TILE}, got {width}x{height}")
    view = workload.view
    directions = pinhole(view, size, width / height)
    if rows is not None:
        directions = directions.reshape(height // TILE, -1, 3)[rows].reshape(-1, 3)
        height = TILE * len(rows)
    primary = _finish("primary", np.broadcast_to(view.eye, directions.shape), directions)
    tiles = tile_order(width, height)
    sets = {"primary": _ordered(primary, tiles)}
    if set(names) - {"primary", "long", "coplanar"}:
        sets |= _secondary(workload, tracer, primary, tiles, seed, offset, names)
    if "long" in names:
        sets["long"] = _chords(workload, len(primary), seed)
    if "coplanar" in names:
        sets["coplanar"] = _coplanar(workload, len(primary), seed)
    return [sets[name] for name in ALL if name in names] + list(workload.extra)


def fingerprint(sets: Iterable[RaySet]) -> str:
    """A hash of all rays of these sets; "" without any."""
    digest = hashlib.sha256()
    found = list(sets)
    for one in found:
        digest.update(f"{one.name}|{one.any_hit}|{one.order}|".encode("utf-8", "surrogateescape"))
        for array in (one.origins, one.directions, one.t_max):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest() if found else ""


def bytes_needed(size: tuple[int, int], names: Sequence[str]) -> int:
    """Approximate bytes that `make` needs for these sets. size: width and height in pixels."""
    width, height = size
    return width * height * (PIXEL_BYTES + HIT_BYTES * bool(set(names) - {"primary"}))


def tile_order(width: int, height: int) -> NDArray[np.int64]:
    """Scanline indices of all pixels, tile by tile from the top left, and row by row inside a tile."""
    y, x = np.mgrid[0:height, 0:width]
    keys = (x.ravel() % TILE, y.ravel() % TILE, x.ravel() // TILE, y.ravel() // TILE)
    return np.lexsort(keys)


def blocks(count: int, wanted: int, seed: int) -> NDArray[np.int64]:
    """Ascending indices of about `wanted` of `count` rays, chosen at random in whole blocks of 64 neighbours."""
    side = TILE * TILE
    if wanted >= count:
        return np.arange(count, dtype=np.int64)
    whole = max(count // side, 1)
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(whole, size=min(max(-(-wanted // side), 1), whole), replace=False))
    indices = (chosen[:, None] * side + np.arange(side)).ravel()
    return indices[indices < count].astype(np.int64)


def frames(normals: F64) -> tuple[F64, F64]:
    """Two unit vectors orthogonal to each unit normal (Duff et al. 2017, "Building an Orthonormal
    Basis, Revisited").
    """
    sign = np.copysign(1.0, normals[:, 2])
    a = -1.0 / (sign + normals[:, 2])
    b = normals[:, 0] * normals[:, 1] * a
    first = np.stack([1 + sign * normals[:, 0] ** 2 * a, sign * b, -sign * normals[:, 0]], axis=1)
    second = np.stack([b, sign + normals[:, 1] ** 2 * a, -normals[:, 1]], axis=1)
    return first, second


def pinhole(view: View, size: tuple[int, int], aspect: float) -> F64:
    """Unit directions through all pixel centres, in scanline order from the top left: (pixels, 3) float64.

    size: width and height in pixels. aspect: width by height of the picture, independent of the shape of its pixels.
    """
    width, height = size
    right, up, forward = view.axes()
    x0, x1, y0, y1 = view.window(aspect)
    x = x0 + (np.arange(width) + 0.5) / width * (x1 - x0)
    y = y1 + (np.arange(height) + 0.5) / height * (y0 - y1)
    directions = forward + x[None, :, None] * right + y[:, None, None] * up
    return _unit(directions.reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class _Hits:
    """Where rays hit: a mask of the rays, and the points and the unit normals that face the ray, (hits, 3) float64."""

    mask: NDArray[np.bool_]
    points: F64
    normals: F64


def _hits(workload: Workload, tracer: Tracer, some: RaySet) -> _Hits:
    """The nearest hits of rays, from barycentric coordinates in float64. Triangles without area count as missed."""
    found = tracer.closest(some.origins, some.directions)
    mask = found.triangle >= 0
    corners = workload.vertices.astype(np.float64)[workload.triangles[found.triangle[mask]]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    flat = lengths == 0
    mask[np.flatnonzero(mask)[flat]] = False
    corners, normals = corners[~flat], normals[~flat] / lengths[~flat, None]
    normals *= np.where((normals * some.directions[mask]).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    u, v = found.u[mask].astype(np.float64)[:, None], found.v[mask].astype(np.float64)[:, None]
    return _Hits(mask, corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v, normals)


def _secondary(
    workload: Workload,
    tracer: Tracer,
    primary: RaySet,
    tiles: NDArray[np.int64],
    seed: int,
    offset: float,
    names: Sequence[str],
) -> dict[str, RaySet]:
    """The rays that leave the primary hits, and those of later bounces where `names` has them."""
    seen = _hits(workload, tracer, primary)
    diagonal = workload.diagonal()
    lift = offset * diagonal
    points = seen.points + lift * seen.normals

    # Aim a shadow ray from each hit, in tile order, at the light.
    light = _light(workload.view, tracer, diagonal)
    place = np.cumsum(seen.mask) - 1
    in_tiles = place[tiles[seen.mask[tiles]]]
    origins = points[in_tiles].astype(np.float32)
    towards = light - origins.astype(np.float64)
    distance = np.linalg.norm(towards, axis=1)
    shadow = RaySet(
        "shadow",
        origins,
        (towards / np.maximum(distance, np.finfo(np.float64).tiny)[:, None]).astype(np.float32),
        (distance * (1 - SHORT_OF_LIGHT)).astype(np.float32),
        any_hit=True,
    )

    # Draw one pair per pixel, hit or not, so that a pixel's bounce does not depend on its neighbours.
    rng = np.random.default_rng(seed)
    diffuse = _finish("diffuse", points, _cosine(seen.normals, rng.random((len(seen.mask), 2))[seen.mask]))
    shuffled = _ordered(diffuse, rng.permutation(len(diffuse)), name="shuffled", order="none")
    sets = {"shadow": shadow, "diffuse": diffuse, "shuffled": shuffled}
    if "ambient" in names:
        above = _finish("ambient", points, _cosine(seen.normals, _pairs(seed, "ambient", len(points))))
        sets["ambient"] = replace(above, t_max=np.full(len(points), AMBIENT * diagonal, np.float32), any_hit=True)
    if "behind" in names:
        behind = _finish("behind", seen.points - lift * seen.normals, primary.directions[seen.mask])
        sets["behind"] = _ordered(behind, in_tiles, name="behind", order="none")
    # Let diffuse rays bounce on, as far as a set needs it.
    last = max((bounce for name, bounce in _BOUNCES.items() if name in names), default=1)
    bounced = diffuse
    for bounce in range(2, last + 1):
        met = _hits(workload, tracer, bounced)
        onward = _cosine(met.normals, _pairs(seed, f"bounce {bounce}", len(met.points)))
        bounced = _finish("", met.points + lift * met.normals, onward)
        sets |= {name: replace(bounced, name=name) for name, wanted in _BOUNCES.items() if wanted == bounce}
    return sets


_BOUNCES = {"second": 2, "fourth": 4}
"""Number of the diffuse bounce by set."""


def _pairs(seed: int, stream: str, count: int) -> F64:
    """Uniform (count, 2) numbers of a stream of their own, so that one set does not depend on which others are made."""
    return np.random.default_rng([seed, *stream.encode()]).random((count, 2))


def _cosine(normals: F64, pairs: F64) -> F64:
    """Unit directions about unit normals with a cosine-weighted density, from uniform (n, 2) numbers."""
    radius, angle = np.sqrt(pairs[:, 0]), 2 * np.pi * pairs[:, 1]
    first, second = frames(normals)
    return _unit(
        first * (radius * np.cos(angle))[:, None]
        + second * (radius * np.sin(angle))[:, None]
        + normals * np.sqrt(1 - pairs[:, 0])[:, None]
    )


def _chords(workload: Workload, count: int, seed: int) -> RaySet:
    """Rays that enter the bounding box at a uniform point of its surface and pass a uniform point inside."""
    low, high = workload.bounds()
    extent = high - low
    rng = np.random.default_rng([seed, *b"long"])
    # Choose one of six faces by its area.
    areas = np.array([extent[1] * extent[2], extent[0] * extent[2], extent[0] * extent[1]])
    shares = areas / areas.sum() if areas.any() else np.full(3, 1 / 3)
    axis = rng.choice(3, size=count, p=shares)
    start = rng.random((count, 3))
    start[np.arange(count), axis] = rng.integers(0, 2, count)
    way = (rng.random((count, 3)) - start) * extent
    moving = way.any(axis=1)
    return _finish("long", (low + start * extent)[moving], _unit(way[moving]))


def _coplanar(workload: Workload, count: int, seed: int) -> RaySet:
    """Rays along the chord of two uniform points of a triangle chosen by area, from a point before it in its plane."""
    corners = workload.vertices.astype(np.float64)[workload.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    areas[~np.isfinite(areas)] = 0.0
    if not areas.any():
        return _finish("coplanar", np.zeros((0, 3)), np.zeros((0, 3)))
    rng = np.random.default_rng([seed, *b"coplanar"])
    chosen = corners[rng.choice(len(corners), size=count, p=areas / areas.sum())]

    def inside() -> F64:
        # Fold the unit square onto the triangle.
        pairs = rng.random((count, 2))
        pairs = np.where(pairs.sum(axis=1, keepdims=True) > 1, 1 - pairs, pairs)
        edges = chosen[:, 1:] - chosen[:, :1]
        points: F64 = chosen[:, 0] + (pairs[:, :, None] * edges).sum(axis=1)
        return points

    first, second = inside(), inside()
    moving = (first != second).any(axis=1)
    directions = _unit((second - first)[moving])
    return _finish("coplanar", first[moving] - BEFORE * workload.diagonal() * directions, directions)


def _light(view: View, tracer: Tracer, diagonal: float) -> F64:
    """A point in open space: half way along the free part of the view axis, then up by most of the free distance."""

    def free(origin: F64, direction: F64) -> float:
        found = tracer.closest(origin.astype(np.float32)[None], direction.astype(np.float32)[None])
        return float(found.t[0])

    forward = view.axes()[2]
    reach = free(view.eye, forward)
    if not np.isfinite(reach):
        reach = float(np.linalg.norm(view.target - view.eye))
    middle = view.eye + 0.5 * reach * forward
    up = _unit(view.up)
    place: F64 = middle + min(0.9 * free(middle, up), 0.5 * diagonal) * up
    return place


def _finish(name: str, origins: F64, directions: F32 | F64) -> RaySet:
    endless = np.full(len(origins), np.inf, np.float32)
    return RaySet(
        name, np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32), endless
    )


def _ordered(rays: RaySet, indices: NDArray[np.int64], *, name: str = "primary", order: Order = "tile8") -> RaySet:
    return RaySet(name, rays.origins[indices], rays.directions[indices], rays.t_max[indices], order=order)


def _unit(vectors: F64) -> F64:
    unit: F64 = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit

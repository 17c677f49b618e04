# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed surfaces and rays from inside them: a ray that hits nothing has found a leak."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import F32, I32
from ...core.scene import workload
from . import stability

if TYPE_CHECKING:
    from ...core.base.interface import Native


OFFSETS = (0.0, 1e3, 1e5, 1e7)
"""Distances of the spheres from the origin, per axis. At the farthest, floats are one unit apart."""


def icosphere(levels: int) -> tuple[NDArray[np.float64], I32]:
    """A closed unit sphere of 20 * 4**levels triangles: vertices (n, 3) and indices (m, 3), shared by neighbours."""
    g = (1 + 5**0.5) / 2
    points = [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g]]
    points += [[0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]]
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6]]
    faces += [[7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10]]
    faces += [[8, 6, 7], [9, 8, 1]]
    vertices, triangles = _unit(np.array(points, np.float64)), np.array(faces, np.int64)
    # Split each triangle into four at the midpoints of its edges, which neighbours share.
    for _ in range(levels):
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        unique, place = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = (len(vertices) + place.reshape(3, -1)).astype(np.int64)
        vertices = np.concatenate([vertices, _unit(vertices[unique].sum(axis=1))])
        a, b, c = triangles.T
        parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return vertices, triangles.astype(np.int32)


def _unit(points: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(points, axis=1, keepdims=True)
    return np.asarray(points / lengths, np.float64)


BLOCK = 1 << 16
"""Number of rays traced at once."""

Surface = tuple[str, F32, I32, NDArray[np.float64], float]
"""Name, vertices, triangles, a point inside, and the radius of a ball around it that lies inside."""


def surfaces(levels: int) -> Iterator[Surface]:
    """Closed surfaces of 20 * 4**levels triangles."""
    sphere, triangles = icosphere(levels)
    for offset in OFFSETS:
        centre = offset * np.array([1.0, -1.0, 0.5])
        radius = 100.0 if offset else 1.0
        yield f"sphere at {offset:g}", (centre + radius * sphere).astype(np.float32), triangles, centre, 0.3 * radius
    x, y, z = sphere.T
    bumpy = sphere * (1 + 0.2 * np.sin(7 * x) * np.cos(5 * y + 3 * z))[:, None]
    yield "bumpy sphere", bumpy.astype(np.float32), triangles, np.zeros(3), 0.3


def from_file(path: Path, centre: Sequence[float], radius: float) -> Surface:
    """A surface from a scene file, with its holes closed by fans. Raises workload.WorkloadError."""
    scene = workload.load_npz(path)
    return path.stem, *closed(scene.vertices, scene.triangles), np.array(centre), radius


def closed(vertices: F32, triangles: I32) -> tuple[F32, I32]:
    """The surface with a triangle fan over each boundary loop; equal vertices are merged."""
    # Merge equal vertices, then find edges that only one triangle has.
    points, place = np.unique(vertices, axis=0, return_inverse=True)
    corners = place.reshape(-1)[triangles]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    present = set(map(tuple, edges.tolist()))
    # Reverse the boundary edges, so that the fans face as the surface does.
    following = {a: b for b, a in present if (a, b) not in present}
    fans: list[list[int]] = []
    tips: list[Any] = []
    # Follow each loop, and connect its edges to the loop's mean.
    while following:
        start, at = following.popitem()
        rim = [start]
        while at != start:
            rim.append(at)
            at = following.pop(at)
        tip = len(points) + len(tips)
        tips.append(points[rim].mean(axis=0))
        fans += [[a, b, tip] for a, b in zip(rim, [*rim[1:], start], strict=True)]
    if not fans:
        return points, corners.astype(np.int32)
    return np.concatenate([points, np.array(tips, np.float32)]), np.concatenate([corners, fans]).astype(np.int32)


def rays_from_inside(
    vertices: F32, triangles: I32, centre: NDArray[np.float64], radius: float, count: int, rng: np.random.Generator
) -> tuple[F32, F32]:
    """Origins and directions, (n, 3) each: a quarter to vertices, a quarter to edge midpoints, half random.

    Every third ray starts at the centre, from where the spheres' vertices are hit exactly.
    """
    origins = (centre + rng.uniform(-radius, radius, (count, 3)) / 3**0.5).astype(np.float32)
    origins[::3] = centre
    corners = vertices[triangles[rng.integers(0, len(triangles), count)]]
    half = np.float32(0.5)
    middles = half * corners[:, 0] + half * corners[:, 1]
    kind = (np.arange(count) % 4)[:, None]
    anywhere = rng.normal(size=(count, 3)).astype(np.float32)
    directions = np.where(kind == 0, corners[:, 0] - origins, np.where(kind == 1, middles - origins, anywhere))
    return origins, directions.astype(np.float32)


def count_leaks(
    native: Native, specs: Sequence[str], chosen: Sequence[Surface], rays: int, seed: int = 1, *, threads: int = 0
) -> dict[str, Counter[str]]:
    """Number of `rays` rays that leave each closed surface, by configuration and surface; zeros are omitted.

    Half of each block of rays is traced for the nearest hit, half for any hit.
    """
    found: dict[str, Counter[str]] = {spec: Counter() for spec in specs}
    for name, vertices, triangles, centre, radius in chosen:
        structures = {spec: native.build(vertices, triangles, spec, threads=threads) for spec in specs}
        for block, first in enumerate(range(0, rays, BLOCK)):
            rng = np.random.default_rng([seed, block])
            count = min(BLOCK, rays - first)
            origins, directions = rays_from_inside(vertices, triangles, centre, radius, count, rng)
            for spec, structure in structures.items():
                half = count // 2
                met = stability.nearest(structure, (origins[:half], directions[:half]), threads=threads).hit
                blocked = structure.occluded(origins[half:], directions[half:], threads=threads)
                if not (met.all() and blocked.all()):
                    found[spec][name] += int((~met).sum() + (~blocked).sum())
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and rays of the papers' workloads, generated from fixed seeds.

The octree paper shows many randomly scattered objects, and a few concentrated in the middle of a large scene; it states
the numbers of objects and of octree nodes. Objects here are triangles, scaled so that the numbers of nodes match the
published ones.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.base.arrays import F32, F64
from ...core.scene import tubes
from ...core.scene.rays import RaySet, pinhole, tile_order
from ...core.scene.workload import View, Workload

RESOLUTIONS = ((320, 200), (640, 400), (800, 600), (1024, 768), (1280, 1024))
"""Width and height in pixels, from the paper's smallest picture to its largest."""

WINDOW = 4.0 / 3.0
"""Aspect ratio of the picture at every resolution: that of the screens of the time."""


def scattered() -> Workload:
    """400 objects at random places in a cube."""
    rng = np.random.default_rng(1)
    return _objects("400 scattered objects", rng.uniform(-1.0, 1.0, (400, 3)), 0.03, rng)


def concentrated() -> Workload:
    """60 small objects: 56 in the middle of the scene, 4 in its corners."""
    rng = np.random.default_rng(2)
    middle = rng.normal(0.0, 0.1, (56, 3))
    corners = 0.95 * np.array([[-1, -1, -1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]], np.float64)
    return _objects("60 concentrated objects", np.concatenate([middle, corners]), 0.0245, rng)


def many(count: int) -> Workload:
    """Objects at random places in a cube; their areas together do not depend on their number."""
    rng = np.random.default_rng(3)
    return _objects(f"{count} objects", rng.uniform(-1.0, 1.0, (count, 3)), 0.03 * (400 / count) ** 0.5, rng)


def layered(depth: float) -> Workload:
    """8,000 objects at random places in a cube, so large that a ray through it meets about `depth` of them."""
    rng = np.random.default_rng(5)
    count = 8000
    # A triangle of three normally distributed corners has a mean area of the square root of 3; a ray that crosses a
    # cube of volume 8 and length 2 meets its objects' whole area / 8.
    size = float(np.sqrt(8 * depth / (np.sqrt(3) * count)))
    return _objects(f"{count:,} objects, depth {depth:g}", rng.uniform(-1.0, 1.0, (count, 3)), size, rng)


def needles(way: str = "along a diagonal") -> Workload:
    """2,000 long and thin objects: nearly along one diagonal of a cube, along its axes, or in all directions.

    way: a key of WAYS.
    """
    rng = np.random.default_rng(4)
    made = _objects(f"2000 needles {way}", rng.uniform(-1.0, 1.0, (2000, 3)), 0.004, rng)
    corners = made.vertices.reshape(-1, 3, 3)
    corners[:, 2] += (WAYS[way](rng) + rng.normal(0.0, 0.01, (2000, 3))).astype(np.float32)
    return made


LENGTH = 0.52
"""Length of a needle: that of those along the diagonal."""


def _along_axes(rng: np.random.Generator) -> F64:
    return LENGTH * np.eye(3)[rng.integers(3, size=2000)]


def _all_ways(rng: np.random.Generator) -> F64:
    ways = rng.normal(size=(2000, 3))
    return LENGTH * ways / np.linalg.norm(ways, axis=1, keepdims=True)


WAYS: dict[str, Callable[[np.random.Generator], F64]] = {
    "along a diagonal": lambda _: np.array([[0.3, 0.25, 0.35]]),
    "in all directions": _all_ways,
    "along the axes": _along_axes,
}
"""Where needles point, by name."""


def hair() -> Workload:
    """400 strands that rise from a square and bend to one side, as thin tubes of three sides."""
    rng = np.random.default_rng(6)
    count, points = 400, 8
    at = np.linspace(0.0, 1.0, points)[None, :, None]
    roots = np.concatenate([rng.uniform(-0.8, 0.8, (count, 2)), np.full((count, 1), -0.7)], axis=1)[:, None]
    tips = np.array([0.5, 0.2, 1.2]) + rng.normal(0.0, 0.15, (count, 1, 3))
    bent = np.array([0.4, 0.3, -0.3]) * at**2
    centres = (roots + at * tips + bent).reshape(-1, 3).astype(np.float32)
    radii = np.full(len(centres), 0.004, np.float32)
    made = tubes.tubes(tubes.strands(centres, radii, np.arange(count + 1) * points, straight=True), 1, 3)
    return Workload(f"{count} hairs", made.positions, made.triangles.astype(np.int32), _view())


def camera_rays(workload: Workload, size: tuple[int, int]) -> RaySet:
    """Rays through all pixel centres in tiles of 8×8; the window is the same at every resolution."""
    view = workload.view
    directions = pinhole(view, size, WINDOW)[tile_order(*size)].astype(np.float32)
    origins: F32 = np.ascontiguousarray(np.broadcast_to(view.eye.astype(np.float32), directions.shape))
    endless = np.full(len(directions), np.inf, np.float32)
    return RaySet(f"{size[0]}x{size[1]}", origins, directions, endless, order="tile8")


def _objects(name: str, centres: F64, size: float, rng: np.random.Generator) -> Workload:
    corners = centres[:, None] + size * rng.normal(size=(len(centres), 3, 3))
    vertices = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return Workload(name, vertices, triangles, _view())


def _view() -> View:
    return View(np.array([0.9, -3.4, 1.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]), 40.0)

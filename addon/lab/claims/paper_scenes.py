# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and rays of the papers' workloads, generated from fixed seeds.

The octree paper shows many randomly scattered objects, and a few concentrated in the middle of a large scene; it states
the numbers of objects and of octree nodes. Objects here are triangles, scaled so that the numbers of nodes match the
published ones.
"""

from __future__ import annotations

import numpy as np

from ...core.base.arrays import F32, F64
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


def needles() -> Workload:
    """2,000 long and thin objects, all nearly along one diagonal of a cube."""
    rng = np.random.default_rng(4)
    made = _objects("2000 needles along a diagonal", rng.uniform(-1.0, 1.0, (2000, 3)), 0.004, rng)
    corners = made.vertices.reshape(-1, 3, 3)
    corners[:, 2] += rng.normal(np.array([0.3, 0.25, 0.35]), 0.01, (2000, 3)).astype(np.float32)
    return made


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
    view = View(np.array([0.9, -3.4, 1.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]), 40.0)
    return Workload(name, vertices, triangles, view)

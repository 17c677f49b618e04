# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene whose structures are inspected: tilted triangles over a floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from addon.core.base import native
from addon.core.scene.workload import Workload, framing_view
from addon.core.tree import table

SIZE = (48, 32)


def soup(count: int, seed: int, *, box: Any = 1.0, size: float = 0.1) -> tuple[Any, Any]:
    """Vertices and triangles of any direction, around points of a box that begins at the origin."""
    rng = np.random.default_rng(seed)
    corners = rng.random((count, 1, 3)) * box + size * rng.standard_normal((count, 3, 3))
    return corners.astype(np.float32).reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def scene() -> Workload:
    corners, _ = soup(300, 11, box=[6, 6, 3], size=0.4)
    floor = np.array([[-2, -2, -1], [8, -2, -1], [8, 8, -1], [-2, -2, -1], [8, 8, -1], [-2, 8, -1]], np.float32)
    vertices = np.concatenate([corners, floor])
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return Workload("triangles", vertices, triangles, framing_view(vertices, triangles))


WORKLOAD = scene()


def built(spec: str) -> tuple[Any, table.Table]:
    """A structure over the scene, and its table."""
    structure = native.load().build(WORKLOAD.vertices, WORKLOAD.triangles, spec)
    return structure, table.read(structure, WORKLOAD.vertices, WORKLOAD.triangles)

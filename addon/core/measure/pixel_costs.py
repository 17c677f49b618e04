# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of camera rays beyond their steps and tests: overlap and leaf depth where they end, and their shadow rays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..scene import rays
from ..scene.workload import Workload
from ..tree import location, table
from . import counting

if TYPE_CHECKING:
    from ..base.interface import Structure


def shared(structure: Structure, primary: rays.RaySet, *names: str) -> F64:
    """(n,), the sum of counters; the rays of a tile that is traced as a whole share its number evenly.

    Such a tile counts its tests for one of its rays. primary: in tiles.
    """
    # Count once in tiles and once as single rays; different counts mean that tiles are traced as a whole.
    counted, alone = (
        np.sum([found[name].astype(np.float64) for name in names], axis=0)
        for found in (counting.counters(structure, one, 0) for one in (primary, replace(primary, order="none")))
    )
    if np.array_equal(counted, alone):
        return counted
    side = rays.TILE**2
    return np.repeat(counted.reshape(-1, side).mean(axis=1), side)


def overlap(structure: Structure, workload: Workload, primary: rays.RaySet) -> F64:
    """(n,), cost of nodes around the hit that do not hold the triangle hit, in axis steps; 0 for a miss.

    Raises table.TreeError.
    """
    made = np.zeros(len(primary))
    hit, points, triangles = ends(structure, primary)
    nodes = table.read(structure, workload.vertices, workload.triangles)
    made[hit] = location.overlap(nodes, points, triangles).sum(axis=0)
    return made


def leaf_depths(structure: Structure, workload: Workload, primary: rays.RaySet) -> F64:
    """(n,), depth of the leaf that holds the hit; 0 for a miss. Raises table.TreeError."""
    made = np.zeros(len(primary))
    hit, points, triangles = ends(structure, primary)
    nodes = table.read(structure, workload.vertices, workload.triangles)
    made[hit] = np.maximum(location.leaf_depths(nodes, points, triangles), 0)
    return made


def any_hit(structure: Structure, workload: Workload, size: tuple[int, int]) -> F64:
    """(n,), nodes visited and triangles tested by the shadow ray of each camera ray; 0 for a miss.

    Camera rays are those of `size` pixels, in tile order.
    """
    primary, shadow = rays.make(workload, structure, size=size, seed=0, names=("primary", "shadow"))[:2]
    hit = np.flatnonzero(structure.closest(primary.origins, primary.directions, order=primary.order).triangle >= 0)
    if len(hit) != len(shadow):
        raise ValueError(f"shadow rays: expected one for each of {len(hit)} hits, got {len(shadow)}")
    counters = counting.counters(structure, shadow, 0)
    made = np.zeros(len(primary))
    made[hit] = counters["visits"].astype(np.float64) + counters["tests"]
    return made


def ends(structure: Structure, primary: rays.RaySet) -> tuple[NDArray[np.int64], F64, NDArray[np.int32]]:
    """Indices of the rays that hit, the points where they do, (h, 3), and their triangles, (h,)."""
    found = structure.closest(primary.origins, primary.directions, order=primary.order)
    hit = np.flatnonzero(found.triangle >= 0)
    directions = primary.directions[hit].astype(np.float64)
    points = primary.origins[hit] + found.t[hit, None].astype(np.float64) * directions
    return hit, points, found.triangle[hit]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Any-hit rays of every coherence: answers of single rays, by the kernel that suits the batch."""

from __future__ import annotations

import halfspace_native
import numpy as np
import pytest
from halfspace_native import Structure

from addon.core.base.arrays import F32

SPECS = ("bvh-sah:", "kd:", "bsp-wn:nodes=boxes,", "bih:", "octree-param:")
"""Structures that choose by coherence, up to their traversal."""


def cloud(count: int, size: float, seed: int) -> tuple[F32, np.ndarray]:
    """Small triangles in the cube from -1 to 1."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-size, size, (count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def sheet(count: int) -> F32:
    """Points below the cloud, row by row."""
    i = np.arange(count)
    return np.stack([i % 64 * 0.02 - 0.6, i // 64 * 0.02 - 0.6, np.full(count, -1.0)], axis=1).astype(np.float32)


def counted(structure: Structure, origins: F32, directions: F32, t_max: float) -> tuple[np.ndarray, np.ndarray]:
    """Whether each ray is blocked, and its counters."""
    blocked, counters = structure.occluded(origins, directions, t_max=t_max, threads=1, counters=True)
    assert (blocked == structure.occluded(origins, directions, t_max=t_max, threads=1)).all()
    return blocked, np.stack([counters[name] for name in ("steps", "leaves", "tests", "visits")])


@pytest.mark.parametrize("spec", SPECS)
def test_rays_to_a_light_go_in_tiles_and_bounces_in_streams(spec: str) -> None:
    triangles = cloud(2000, 0.05, 1)
    brute = halfspace_native.build(*triangles, "brute")
    auto, tile, stream = (
        halfspace_native.build(*triangles, f"{spec}traversal={way}") for way in ("auto", "tile", "stream")
    )
    origins = sheet(2048)
    light = (np.array([0.3, 0.2, 7.0], np.float32) - origins).astype(np.float32)
    bounces = np.random.default_rng(2).normal(size=origins.shape).astype(np.float32)
    for directions, t_max, own, other in ((light, 0.999, tile, stream), (bounces, np.inf, stream, tile)):
        blocked, counters = counted(auto, origins, directions, t_max)
        assert (blocked == brute.occluded(origins, directions, t_max=t_max)).all()
        assert 0 < blocked.sum() < len(blocked)
        assert (counters == counted(own, origins, directions, t_max)[1]).all()
        assert (counters != counted(other, origins, directions, t_max)[1]).any()


@pytest.mark.parametrize("spec", ["bvh-sah", "kd"])
def test_rays_in_random_order_get_their_own_answers(spec: str) -> None:
    """The tree exceeds the caches, and each ray starts far from the one before: they are sorted, then traced."""
    triangles = cloud(130_000, 0.01, 3)
    rng = np.random.default_rng(4)
    origins, directions = (rng.uniform(-1, 1, (20_000, 3)).astype(np.float32) for _ in range(2))
    alone = halfspace_native.build(*triangles, "bvh-sah:traversal=ordered")
    expected = alone.occluded(origins, directions, t_max=0.7)
    assert 1000 < expected.sum() < 19_000
    structure = halfspace_native.build(*triangles, spec)
    for threads in (1, 2):
        assert (structure.occluded(origins, directions, t_max=0.7, threads=threads) == expected).all()
        hits = structure.closest(origins, directions, t_max=0.7, threads=threads)
        assert ((hits.triangle >= 0) == expected).all()

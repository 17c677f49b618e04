# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of every coherence: answers of single rays, by the kernel that suits the batch."""

from __future__ import annotations

import halfspace_native
import numpy as np
import pytest

from addon.core.base.arrays import F32


def cloud(count: int, size: float, seed: int) -> tuple[F32, np.ndarray]:
    """Small triangles in the cube from -1 to 1."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-size, size, (count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


COUNT = 8192
"""Rays of a batch, of which two packets are the sample."""


def sheet(step: float) -> F32:
    """Points below the cloud around its middle, in tiles of 8 x 8 at this distance from each other."""
    i = np.arange(COUNT)
    x, y = i // 64 % 16 * 8 + i % 8, i // 1024 * 8 + i // 8 % 8
    return np.stack([(x - 64) * step, (y - 32) * step, np.full(COUNT, -1.0)], axis=1).astype(np.float32)


def same_counters(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    """Whether all counters of all rays are equal."""
    return all((one[name] == other[name]).all() for name in ("steps", "leaves", "tests", "visits"))


@pytest.mark.parametrize("spec", ["bvh-sah:", "kd:", "bsp-wn:nodes=boxes,", "bih:", "octree-param:"])
def test_any_hits_go_in_the_way_that_suits_the_batch(spec: str) -> None:
    triangles = cloud(2000, 0.05, 1)
    names = "tile", "packet", "stream"
    ways = {way: halfspace_native.build(*triangles, f"{spec}traversal={way}") for way in names}
    brute = halfspace_native.build(*triangles, "brute")
    auto = halfspace_native.build(*triangles, f"{spec}traversal=auto")
    rng = np.random.default_rng(2)
    # Dense and sparse rays to a point, rays to a large light, and bounces.
    for step, light, bounce, own in (
        (0.0005, 0.0, 0.0, "tile"),
        (0.024, 0.0, 0.0, "packet"),
        (0.016, 1.0, 0.0, "stream"),
        (0.016, 0.0, 20.0, "stream"),
    ):
        origins = sheet(step)
        aim = np.array([0.3, 0.2, 7.0]) + rng.normal(size=origins.shape) * max(light, bounce)
        rays = (origins, (aim - origins).astype(np.float32))
        blocked, counters = auto.occluded(*rays, t_max=0.999, threads=1, counters=True)
        assert (blocked == brute.occluded(*rays, t_max=0.999)).all()
        assert (blocked == auto.occluded(*rays, t_max=0.999)).all()
        assert 0 < blocked.sum() < len(blocked)
        found = [
            way
            for way, structure in ways.items()
            if same_counters(structure.occluded(*rays, t_max=0.999, threads=1, counters=True)[1], counters)
        ]
        assert found == [own], (step, light, bounce)
        assert same_counters(auto.occluded(*rays, t_max=0.999, threads=2, counters=True)[1], counters)

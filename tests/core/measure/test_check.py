# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel's "Measure a Sample": a right structure is right, and any wrong answer of a sample is seen."""

from __future__ import annotations

import halfspace_native
import pytest
from lying_native import LIES, Lying

from addon.core.measure import check
from addon.core.scene import grid


def last(lie: str) -> check.Check:
    """The complete check of a kd-tree that lies so, or of an honest one."""
    scene = grid.workload(boxes=2, rays=64)
    structure = Lying(halfspace_native.build(scene.vertices, scene.triangles, "kd"), lie)
    *_, found = check.steps(halfspace_native, structure, scene, threads=1)
    return found


def test_an_honest_structure_is_right_and_every_set_is_measured() -> None:
    found = last("")
    assert found.right
    assert found.errors.rays >= 64 * 4
    for means in (found.mrays_s, found.steps, found.tests):
        assert tuple(means) == (*check.SETS, "walls")
        assert all(mean > 0 for mean in means.values())


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_seen(lie: str) -> None:
    found = last(lie)
    assert not found.right
    # Closest hits and any hits are both compared, and counted apart.
    assert (found.errors.wrong_any_hit > 0) == (lie == "wrong_any_hit")

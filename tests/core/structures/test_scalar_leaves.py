# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves whose triangles are tested one at a time: with mailboxes, and by traversals as published."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.rooms_of_triangles import soup

native = pytest.importorskip("halfspace_native")

SOUP = soup(2000, 9, size=0.15)
"""Large triangles, each in many leaves, and enough of them that no tree is replaced by brute force."""


def rays(seed: int, count: int = 3000) -> tuple[Any, Any]:
    """Origins and directions of rays from around the triangles to points among them."""
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-1.5, 2.5, (count, 3)).astype(np.float32)
    return origins, (rng.random((count, 3)) - origins).astype(np.float32)


@cache
def nearest() -> Any:
    return native.build(*SOUP, "brute").closest(*rays(4)).triangle


@pytest.mark.parametrize("robust", ["widen", "none"])
@pytest.mark.parametrize("tree", ["kd", "kd-sah", "kd-median"])
@pytest.mark.parametrize("traversal", ["auto", "dir", "ta-b"])
def test_answers_are_those_without_mailboxes_and_tests_are_saved(tree: str, traversal: str, robust: str) -> None:
    spec = f"{tree}:traversal={traversal},leaves=scalar,robust={robust}"
    origins, directions = rays(4)
    plain, kept = (native.build(*SOUP, one) for one in (spec, f"{spec},mailbox=hashed"))
    # Compare hits and any hits, bit for bit, traced at full speed and counted.
    for counted in (False, True):
        a, b = (one.closest(origins, directions, counters=counted) for one in (plain, kept))
        for name in ("t", "triangle", "u", "v"):
            assert np.array_equal(getattr(a, name), getattr(b, name)), (name, counted)
        assert np.array_equal(plain.occluded(origins, directions), kept.occluded(origins, directions))
    assert (a.triangle >= 0).mean() > 0.3
    # The same nodes are visited; each test is done or saved, and the counter of these stands behind the others.
    without, found = ({name: int(values.sum()) for name, values in one.counters.items()} for one in (a, b))
    assert (found["steps"], found["leaves"]) == (without["steps"], without["leaves"]) != (0, 0)
    assert found["tests"] + found["tests_saved"] == without["tests"]
    assert found["tests_saved"] > 0.1 * without["tests"]
    assert "tests_saved" not in without
    assert ("case_n1" in found) == (traversal == "ta-b")
    # All hits of a ray, and its replay, are the same.
    few = rays(5, 300)
    for one, other in zip(plain.all_hits(*few), kept.all_hits(*few), strict=True):
        assert np.array_equal(getattr(one, "t", one), getattr(other, "t", other))
    assert (kept.record(origins, directions).replay() > 0).all()


@pytest.mark.parametrize(
    "spec", ["kd:mailbox=hashed", "kd:leaves=scalar,traversal=sung,mailbox=hashed", "bvh-sah:mailbox=hashed"]
)
def test_others_have_no_mailboxes(spec: str) -> None:
    with pytest.raises(native.SpecError, match="mailbox"):
        native.build(*SOUP, spec)


@pytest.mark.parametrize("leaves", ["blocks", "scalar"])
@pytest.mark.parametrize("traversal", ["dir", "ta-b", "ta-a", "sung", "arvo", "seq", "rope"])
@pytest.mark.parametrize("tree", ["kd", "kd-sah"])
def test_a_hit_behind_a_cell_does_not_end_a_published_traversal(tree: str, traversal: str, leaves: str) -> None:
    found = native.build(*SOUP, f"{tree}:traversal={traversal},leaves={leaves},robust=none").closest(*rays(4))
    # Rounding may cost a hit; triangles that reach behind a leaf would, at a sixth of the rays.
    assert (found.triangle != nearest()).sum() <= 3


def test_projected_rays_as_published_end_inside_a_cell() -> None:
    spec = "rbsp:k=13,traversal=projected,leaves=scalar,robust=none"
    found = native.build(*SOUP, spec).closest(*rays(4))
    assert (found.triangle != nearest()).sum() <= 3

# SPDX-License-Identifier: GPL-3.0-or-later
"""All hits, their number, and rays with masks, as Python sees them."""

from __future__ import annotations

from typing import Any

import halfspace_native as native
import numpy as np
import pytest


def pile(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles above each other at heights 0, 1, 2, ...; the one at height h has index count - 1 - h."""
    heights = np.arange(count)[::-1]
    corners = np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]], np.float32)
    vertices = corners[None] + heights[:, None, None] * np.array([0, 0, 1], np.float32)
    return vertices.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


UP = np.array([[0.1, 0.2, -1.0], [5.0, 5.0, -1.0], [0.1, 0.2, 2.5]], np.float32), np.array([[0, 0, 1]] * 3, np.float32)
"""Rays below, next to and in the middle of a pile."""


def test_all_hits_come_nearest_first_and_within_their_intervals() -> None:
    structure = native.build(*pile(6))
    offsets, hits = structure.all_hits(*UP)
    assert offsets.dtype == np.int64
    assert offsets.tolist() == [0, 6, 6, 9]
    assert hits.triangle.tolist() == [5, 4, 3, 2, 1, 0, 2, 1, 0]
    assert hits.t.tolist() == [1, 2, 3, 4, 5, 6, 0.5, 1.5, 2.5]
    assert structure.count_hits(*UP).tolist() == [6, 0, 3]
    offsets, hits = structure.all_hits(*UP, max_hits=2)
    assert offsets.tolist() == [0, 2, 2, 4]
    assert hits.triangle.tolist() == [5, 4, 2, 1]
    assert structure.count_hits(*UP, 2.0, np.array([4, 9, 2.5], np.float32)).tolist() == [3, 0, 1]


def test_rays_meet_only_the_triangles_that_share_a_bit() -> None:
    structure = native.build(*pile(4))
    # From below: index 3, 2, 1, 0.
    masks = np.array([0b01, 0b10, 0b01, 0b00], np.uint32)
    nearest = structure.closest(*UP, triangle_mask=masks, ray_mask=np.array([0b01, 0b11, 0b10], np.uint32))
    assert nearest.triangle.tolist() == [2, -1, -1]
    assert structure.closest(*UP, triangle_mask=masks, ray_mask=0b10).triangle.tolist() == [1, -1, -1]
    assert structure.occluded(*UP, triangle_mask=masks, ray_mask=0b100).tolist() == [False] * 3
    assert structure.occluded(*UP, triangle_mask=masks).tolist() == [True, False, True]


def test_instances_answer_like_their_copies() -> None:
    mesh = native.build(*pile(2))
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[:, 2, 3] = [0, 10, 20]
    scene = native.build_instances([mesh], np.zeros(3, np.int32), matrices)
    flat = native.build(*scene.flattened())
    for found, right in zip(scene.all_hits(*UP), flat.all_hits(*UP), strict=True):
        if isinstance(right, np.ndarray):
            assert found.tolist() == right.tolist()
        else:
            assert (found.t.tolist(), found.triangle.tolist()) == (right.t.tolist(), right.triangle.tolist())
    assert scene.count_hits(*UP).tolist() == [6, 0, 4]
    masks = np.array([0, 0, 0, 0, 1, 0], np.uint32)
    assert scene.closest(*UP, triangle_mask=masks).triangle.tolist() == [4, -1, 4]
    assert scene.occluded(*UP, triangle_mask=masks).tolist() == [True, False, True]


WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"triangle_mask": np.zeros(3, np.uint32)}, native.ShapeError, "triangle_mask: .* one per triangle, 4, got 3"),
    ({"triangle_mask": np.zeros(4, np.int32)}, native.ShapeError, "triangle_mask: expected an .m,. uint32 array"),
    ({"triangle_mask": np.zeros(8, np.uint32)[::2]}, native.ShapeError, "triangle_mask: expected a contiguous array"),
    ({"ray_mask": 1}, native.SpecError, "ray_mask: needs triangle_mask"),
    (
        {"triangle_mask": np.zeros(4, np.uint32), "ray_mask": np.zeros(2, np.uint32)},
        native.ShapeError,
        "ray_mask: expected one per ray, 3, got 2",
    ),
    ({"triangle_mask": np.zeros(4, np.uint32), "ray_mask": -1}, native.ShapeError, "ray_mask: expected one number"),
    ({"triangle_mask": np.zeros(4, np.uint32), "counters": True}, native.SpecError, "counters: not with triangle_mask"),
]


@pytest.mark.parametrize(("arguments", "error", "message"), WRONG)
def test_bad_masks_are_refused_by_name(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    structure = native.build(*pile(4))
    for trace in (structure.closest, structure.occluded):
        with pytest.raises(error, match=message):
            trace(*UP, **arguments)


def test_an_impossible_number_of_hits_and_a_ray_that_is_not_finite_are_refused() -> None:
    structure = native.build(*pile(1))
    for most in (-1, 1 << 70):
        with pytest.raises(native.SpecError, match="max_hits: expected a whole number"):
            structure.all_hits(*UP, max_hits=most)
    bad = np.full((1, 3), np.nan, np.float32)
    for trace in (structure.all_hits, structure.count_hits):
        with pytest.raises(native.NonFiniteError, match="origins"):
            trace(bad, UP[1][:1])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that follow moved vertices: their answers, their statistics, and what they refuse."""

from __future__ import annotations

import re
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

FITTED = ("bvh-sah", "bih", "bih-sah", "bih5", "bih1", "bih-n", "bih-bvh")


def sheet(count: int = 24, phase: float = 0.0) -> tuple[Any, Any]:
    """A waving sheet of 2 count² triangles."""
    x, y = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    z = 2 * np.sin(0.5 * x + phase) + np.cos(0.3 * y - phase)
    vertices = np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1)
    quads = corner[:, None] + np.array([0, 1, count + 1, count + 2])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [3, 2, 1]]]).astype(np.int32)
    return vertices, triangles


def rays(vertices: Any, seed: int = 3) -> tuple[Any, Any]:
    """Rays between random vertices, moved a little off them."""
    random = np.random.default_rng(seed)
    finite = vertices[np.isfinite(vertices).all(1)]
    ends = finite[random.integers(0, len(finite), (2, 512))] + random.normal(0, 1.0, (2, 512, 3))
    return ends[0].astype(np.float32), (ends[1] - ends[0]).astype(np.float32)


def assert_right(structure: Any, vertices: Any, triangles: Any) -> None:
    asked = rays(vertices)
    brute = native.build(vertices, triangles, "brute")
    for order in ("none", "tile8"):
        found, expected = structure.closest(*asked, order=order), brute.closest(*asked)
        for name in ("t", "triangle", "u", "v"):
            assert np.array_equal(getattr(found, name), getattr(expected, name)), (structure.spec, name)
    assert np.array_equal(structure.occluded(*asked), brute.occluded(*asked))
    assert structure.validate() == []


@pytest.mark.parametrize("spec", FITTED)
def test_answers_are_those_of_the_moved_triangles(spec: str) -> None:
    vertices, triangles = sheet()
    built = native.build(vertices, triangles, spec)
    moved = sheet(phase=1.0)[0]
    for place in (moved, 1e5 * moved, 1e-5 * moved, moved + 1e6, np.roll(moved, 77, axis=0), vertices):
        now = np.ascontiguousarray(place, np.float32)
        fitted = built.refit(now, triangles)
        assert_right(fitted, now, triangles)
        assert fitted.spec == built.spec
        assert fitted.statistics["refits"] == 1
    # The structure that was fitted is the same as before.
    assert_right(built, vertices, triangles)
    assert built.statistics["refits"] == 0


def test_statistics_have_both_costs() -> None:
    vertices, triangles = sheet()
    built = native.build(vertices, triangles, "bvh-sah")
    before = built.statistics
    assert (before["sah_cost"], before["refit_seconds"]) == (before["sah_cost_built"], 0.0)
    scattered = built.refit(np.roll(vertices, 77, axis=0).copy()).statistics
    assert scattered["sah_cost_built"] == before["sah_cost"]
    assert scattered["sah_cost"] > 1.2 * before["sah_cost"]
    assert built.refit(vertices).statistics["sah_cost"] == before["sah_cost"]
    assert scattered["build_seconds"] == before["build_seconds"]


@pytest.mark.parametrize("spec", FITTED)
def test_vertices_that_are_not_finite_hide_their_triangles(spec: str) -> None:
    vertices, triangles = sheet()
    built = native.build(vertices, triangles, spec)
    broken = vertices.copy()
    broken[::3] = np.nan
    broken[1] = np.inf
    fitted = built.refit(broken)
    assert fitted.statistics["dropped_triangles"] > 0
    assert_right(fitted, broken, triangles)
    assert_right(fitted.refit(vertices), vertices, triangles)


def test_other_structures_say_that_they_must_be_built_again() -> None:
    vertices, triangles = sheet(4)
    for row in native.structures():
        structure = native.build(vertices, triangles, row["id"])
        reason = ""
        try:
            assert structure.refit(vertices).statistics["refits"] == 1
        except native.RefitError as error:
            reason = str(error)
        assert re.match(f"({row['id']} cannot be fitted to moved triangles: .*again.*)?$", reason)
        assert not (reason and row["id"] in FITTED)
    with pytest.raises(native.RefitError, match=r"^kd cannot"):
        native.build(vertices, triangles, "kd:lazy=1").refit(vertices)
    with pytest.raises(native.RefitError, match=r"^kd cannot"):
        native.build(vertices, triangles, "kd:nodes=boxes").refit(vertices)


def test_bad_input_is_refused() -> None:
    vertices, triangles = sheet(4)
    built = native.build(vertices, triangles, "bih")
    with pytest.raises(native.ShapeError, match="vertices: expected 25 as before the motion, got 24"):
        built.refit(vertices[:-1])
    with pytest.raises(native.ShapeError, match="vertices"):
        built.refit(vertices[:, :2])
    for other in (triangles[::-1].copy(), triangles[:-1].copy()):
        with pytest.raises(native.ShapeError, match="triangles: other than those of build"):
            built.refit(vertices, other)
    with pytest.raises(native.ShapeError, match="triangles"):
        built.refit(vertices, triangles + 100)
    # A triangle that had no area when the tree was built lies in no leaf.
    flat = vertices.copy()
    flat[triangles[5, 0]] = flat[triangles[5, 1]]
    with pytest.raises(native.RefitError, match="can be hit now: the structure must be built again"):
        native.build(flat, triangles, "bvh-sah").refit(vertices)


def test_no_triangles_can_be_moved() -> None:
    nothing = np.empty((0, 3), np.float32), np.empty((0, 3), np.int32)
    for spec in FITTED:
        fitted = native.build(*nothing, spec).refit(nothing[0])
        assert fitted.statistics["references"] == 0
        assert not fitted.occluded(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)).any()


def test_instances_hold_fitted_structures() -> None:
    vertices, triangles = sheet(6)
    moved = sheet(6, 1.0)[0]
    fitted = native.build(vertices, triangles, "bvh-sah").refit(moved)
    turned = np.array([[[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 2]], [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]], float)
    both = native.build_instances([fitted], np.zeros(2, np.int32), turned)
    flat = both.flattened()
    asked = rays(moved)
    found, expected = both.closest(*asked), native.build(*flat, "brute").closest(*asked)
    assert np.array_equal(found.t, expected.t)
    assert np.array_equal(found.triangle, expected.triangle)


def test_a_fit_is_cancelled_through_its_monitor() -> None:
    vertices, triangles = sheet(20)
    for spec in FITTED:
        built, monitor = native.build(vertices, triangles, spec), native.Monitor()
        assert built.refit(vertices, monitor=monitor).statistics["refits"] == 1
        monitor.cancel()
        with pytest.raises(native.Cancelled):
            built.refit(vertices, monitor=monitor)

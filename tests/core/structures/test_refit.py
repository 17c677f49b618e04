# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that follow moved vertices, as Python sees them; `native/tests/refit` has the answers of all of them."""

from __future__ import annotations

from typing import Any

import halfspace_native as native
import numpy as np
import pytest


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
    ends = vertices[random.integers(0, len(vertices), (2, 512))] + random.normal(0, 1.0, (2, 512, 3))
    return ends[0].astype(np.float32), (ends[1] - ends[0]).astype(np.float32)


@pytest.mark.parametrize("spec", ["bvh-sah", "bih"])
def test_answers_are_those_of_the_moved_triangles(spec: str) -> None:
    vertices, triangles = sheet()
    moved = sheet(phase=1.0)[0]
    built, monitor = native.build(vertices, triangles, spec), native.Monitor()
    fitted = built.refit(moved, triangles, threads=2, monitor=monitor)
    brute = native.build(moved, triangles, "brute")
    found, expected = fitted.closest(*rays(moved)), brute.closest(*rays(moved))
    for name in ("t", "triangle", "u", "v"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert fitted.validate() == []
    assert (fitted.spec, fitted.statistics["refits"], built.statistics["refits"]) == (spec, 1, 0)
    nothing = np.empty((0, 3), np.float32), np.empty((0, 3), np.int32)
    assert native.build(*nothing, spec).refit(nothing[0]).statistics["references"] == 0
    broken = vertices.copy()
    broken[::3] = np.nan
    assert built.refit(broken).statistics["dropped_triangles"] > 0
    monitor.cancel()
    with pytest.raises(native.Cancelled):
        built.refit(moved, monitor=monitor)


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
    for spec in ("kd:lazy=1", "kd:nodes=boxes", "kd"):
        name = spec.partition(":")[0]
        with pytest.raises(native.RefitError, match=f"^{name} cannot be fitted to moved triangles: .*again"):
            native.build(vertices, triangles, spec).refit(vertices)


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that follow moved triangles from one picture to the next: what is fitted, and what is built again."""

from __future__ import annotations

import gc
import itertools
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.scene.scene import Geometry
from addon.core.session import refits
from addon.core.session.refits import Followed
from addon.core.session.session import Session
from addon.core.session.stock import Stock
from addon.core.structures.trees import Trees
from addon.lab.motion import animations


def geometry(frame: int, scatter: float = 0.0, name: str = "wave") -> Geometry:
    """The triangles of an animation's frame."""
    mesh = animations.built_in(name).frame(frame)
    vertices = mesh.vertices + scatter * np.random.default_rng(1).normal(size=mesh.vertices.shape)
    count = len(mesh.triangles)
    return Geometry(vertices.astype(np.float32), mesh.triangles, np.zeros(count, np.int32), origin=np.zeros(3))


def built(frame: Any, spec: str, followed: Followed | None) -> Session:
    session = Session(native, frame, spec, trees=Trees(), followed=followed)
    assert session.structure.spec == spec
    return session


@pytest.mark.parametrize("spec", ["bvh-sah", "bih", "bih-n"])
def test_moved_vertices_are_fitted(spec: str) -> None:
    followed = Followed()
    first = built(geometry(0), spec, followed)
    assert first.done == ""
    later = built(geometry(1), spec, followed)
    assert later.done == refits.REFITTED
    structure = later.structure
    assert structure.spec == first.structure.spec
    assert structure.statistics["refits"] == 1
    assert refits.duration(structure.statistics).startswith("Refitted")
    assert refits.duration(first.structure.statistics).startswith("Build")
    # The answers are those of the moved triangles.
    now = geometry(1)
    down = np.tile(np.array([[0.0, 0.0, -1.0]], np.float32), (500, 1))
    origins = np.random.default_rng(2).uniform((-3, -3, 3), (3, 3, 3), (500, 3)).astype(np.float32)
    expected = native.build(now.vertices, now.triangles, "brute").closest(origins, down)
    assert np.array_equal(structure.closest(origins, down).t, expected.t)
    assert np.isfinite(expected.t).all()


def test_a_tree_that_no_longer_fits_is_built_again() -> None:
    followed = Followed()
    first = built(geometry(0), "bvh-sah", followed)
    scattered = built(geometry(0, scatter=2.0), "bvh-sah", followed)
    assert scattered.done == refits.TOO_DEAR
    assert scattered.structure.statistics["refits"] == 0
    assert first.structure.statistics["refits"] == 0


def test_small_steps_are_compared_with_the_cost_of_the_build() -> None:
    followed = Followed()
    kept = [built(geometry(0), "bvh-sah", followed)]
    before = kept[0].structure.statistics["sah_cost"]
    costs = [before]
    # Scatter the vertices a little more each time, until the tree is built again.
    for step in range(1, 60):
        kept.append(built(geometry(0, scatter=0.004 * step), "bvh-sah", followed))
        if kept[-1].done != refits.REFITTED:
            break
        costs.append(kept[-1].structure.statistics["sah_cost"])
    assert kept[-1].done == refits.TOO_DEAR
    # No step alone makes rays dear.
    assert 1.2 * before < costs[-1] <= refits.DRIFT * before
    assert all(later < 1.2 * earlier for earlier, later in itertools.pairwise(costs))


def test_only_equal_triangles_in_use_of_equal_spec_are_followed() -> None:
    followed = Followed()
    first = built(geometry(0), "bvh-sah", followed)
    assert built(geometry(1), "bih", followed).done == ""
    assert built(geometry(0, name="armature"), "bvh-sah", followed).done == ""
    assert built(geometry(1), "bvh-sah", None).done == ""
    # The cache drops structures without users.
    del first
    gc.collect()
    assert built(geometry(1), "bvh-sah", followed).done == ""


def test_planes_are_built_again_and_say_so() -> None:
    followed = Followed()
    first, second = (built(geometry(frame), "kd", followed) for frame in (0, 1))
    assert (first.done, second.done.startswith(refits.REFUSED + "kd cannot be fitted")) == ("", True)
    assert [refits.can_fit(native, spec) for spec in ("kd", "bvh-sah")] == [False, True]


def test_a_stock_fits_the_structures_that_it_holds() -> None:
    stock = Stock()
    first = stock.take(native, geometry(0), "bih-sah")
    first.wait()
    second = stock.take(native, geometry(1), "bih-sah")
    second.wait()
    assert second.done == refits.REFITTED
    assert stock.take(native, geometry(1), "bih-sah") is second


def test_a_fit_is_cancelled_with_its_building() -> None:
    first = built(geometry(0), "bvh-sah", Followed())

    class Stopped(Followed):
        """Finds a structure whose fit is cancelled while it begins."""

        def find(self, shape: bytes, spec: str) -> Any:
            return self

        def refit(self, vertices: Any, *, threads: int, monitor: Any) -> Any:
            monitor.cancel()
            return first.structure.refit(vertices, threads=threads, monitor=monitor)

    with pytest.raises(native.Cancelled):
        built(geometry(1), "bvh-sah", Stopped())


def test_topologies_differ_by_triangles_and_by_the_number_of_vertices() -> None:
    one, moved = geometry(0), geometry(1)
    assert refits.topology(one) == refits.topology(moved)
    turned = Geometry(one.vertices, one.triangles[::-1].copy(), one.material_index, origin=one.origin)
    more = Geometry(
        np.concatenate([one.vertices, one.vertices[:1]]), one.triangles, one.material_index, origin=one.origin
    )
    assert len({refits.topology(each) for each in (one, turned, more)}) == 3

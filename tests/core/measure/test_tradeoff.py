# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors against the time of a ray: what is compared, and that errors are found where there are some."""

from __future__ import annotations

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import yardstick
from addon.core.measure.accuracy import Answers
from addon.core.measure.analysis import tradeoff
from addon.core.measure.analysis.tradeoff import Limits, Tradeoff
from addon.core.measure.timing import Candidate
from addon.core.scene import grid, rays
from addon.core.scene.workload import Workload

BOXES = grid.workload(2, 512)
SCENE = Workload("boxes", BOXES.vertices, BOXES.triangles, BOXES.view)


@pytest.fixture(scope="module")
def scenes() -> Tradeoff:
    brute = halfspace_native.build(SCENE.vertices, SCENE.triangles, "brute")
    made = rays.make(SCENE, brute, size=(16, 16), seed=1, names=("primary", "shadow"))
    right = {one.name: (one, Answers.of(brute.closest(one.origins, one.directions, t_max=one.t_max))) for one in made}
    return Tradeoff(halfspace_native, SCENE, right, seed=1, limits=Limits(threads=1))


def points(scenes: Tradeoff, spec: str, seconds: float = 0.0) -> list[tradeoff.Point]:
    structure = halfspace_native.build(SCENE.vertices, SCENE.triangles, spec)
    return [point for part in scenes.points(Candidate(spec, structure, [seconds])) for point in part]


def test_each_scene_and_set_is_measured_with_and_without_bounds(scenes: Tradeoff) -> None:
    found = points(scenes, "kd:traversal=dir")
    where = [(point["place"], point["set"], point["bounds"]) for point in found]
    sets = [("here", "primary"), ("here", "shadow"), ("far", "primary"), ("far", "shadow"), ("grid", "walls")]
    assert where == [(*one, bounds) for one in sets for bounds in (True, False)]
    for point in found:
        assert point["ns"] is not None
        assert 0 < point["ns"]["min"] <= point["ns"]["med"] <= point["ns"]["max"]
        assert (point["ulp_max"] is None) == (point["set"] == "shadow" or point["rays"] == 0)
    # Bounds leave no error, and without them there are some.
    kept, dropped = ([point for point in found if point["bounds"] is bounds] for bounds in (True, False))
    assert [(point["wrong"], point["ulp_max"] or 0) for point in kept] == [(0, 0)] * len(kept)
    assert sum(point["wrong"] for point in dropped if point["place"] == "grid") > 0


def test_a_configuration_without_the_choice_has_one_variant() -> None:
    known = halfspace_native.structures()
    assert tradeoff.variants_of("octree-param", known) == {True: "octree-param"}
    assert tradeoff.variants_of("kd:robust=none", known) == {False: "kd:robust=none"}
    assert tradeoff.variants_of("kd", known) == {True: "kd", False: "kd:robust=none"}
    assert tradeoff.variants_of("embree", known) == {True: "embree", False: "embree:robust=none"}


def test_a_slow_build_is_repeated_on_the_grid_only(scenes: Tradeoff) -> None:
    found = [(point["place"], point["set"], point["bounds"]) for point in points(scenes, "kd:traversal=dir", 100.0)]
    kept = [("here", name, True) for name in ("primary", "shadow")]
    assert found == [*kept, ("grid", "walls", True), ("grid", "walls", False)]


def test_a_wrong_answer_is_counted(scenes: Tradeoff) -> None:
    """The structure of the row answers for other triangles: all of its hits are on wrong ones."""
    shifted = halfspace_native.build(SCENE.vertices * np.float32(1.25), SCENE.triangles, "kd")
    (here, *_) = scenes.points(Candidate("brute", shifted, [0.0]))
    assert here[0]["wrong"] > here[0]["rays"] / 2
    assert here[0]["ulp_max"] is not None
    assert here[0]["ulp_max"] > 1000


@pytest.mark.skipif(yardstick.problem() is not None, reason=str(yardstick.problem()))
def test_embree_is_measured_in_both_modes(scenes: Tradeoff) -> None:
    structure = yardstick.EmbreeStructure(SCENE.vertices, SCENE.triangles)
    found = [point for part in scenes.points(Candidate("embree", structure, [0.0])) for point in part]
    walls = {point["bounds"]: point["wrong"] for point in found if point["place"] == "grid"}
    assert walls[False] > walls[True]


def test_a_tracer_that_crashes_on_the_grid_is_left_out_there(scenes: Tradeoff, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, structure = "peer-frail", halfspace_native.build(SCENE.vertices, SCENE.triangles, "kd")
    monkeypatch.setitem(yardstick.MAKERS, spec, lambda v, t: halfspace_native.build(v, t, "kd"))
    monkeypatch.setitem(yardstick.UNSAFE, spec, "it ends the program")
    steps = scenes.points(Candidate(spec, structure, [0.0]))
    assert [next(steps)[0]["place"] for _ in range(2)] == ["here", "far"]
    with pytest.raises(ValueError, match="the grid of touching boxes: it ends the program"):
        next(steps)

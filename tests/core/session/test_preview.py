# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's picture against a fake native module: what is begun when, what is kept, and that nothing waits."""

from __future__ import annotations

import gc
import math
from dataclasses import replace

import numpy as np
import pytest

from addon.core.session import preview as previews
from addon.core.session.stock import Stock
from tests.fake_native import SETTINGS, FakeNative, preview, scene_of, until, view_from


def test_pixels_become_smaller_and_samples_more() -> None:
    seen = preview(FakeNative())
    scales = [picture.scale for picture in until(seen)]
    assert (scales[0], scales[-1]) == (previews.FIRST_SCALE, 1)
    assert scales == sorted(scales, reverse=True)
    assert seen.samples == (4, 4)
    assert not seen.advance()


def test_unchanged_input_begins_nothing() -> None:
    native = FakeNative()
    seen = preview(native)
    until(seen)
    jobs, built = len(native.jobs), native.monitor
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    assert not until(seen)
    assert (len(native.jobs), native.monitor) == (jobs, built)


@pytest.mark.parametrize("what", ["material", "samples", "view"])
def test_only_new_triangles_are_built_again(what: str) -> None:
    native = FakeNative()
    seen = preview(native)
    until(seen)
    built = native.monitor
    if what == "material":
        seen.edit(scene_of(grey=0.1), "kd", None, SETTINGS)
    elif what == "samples":
        seen.edit(scene_of(), "kd", None, replace(SETTINGS, samples=9))
    else:
        seen.look(view_from(6))
    assert until(seen)
    assert native.monitor is built
    seen.edit(scene_of(1.0), "kd", None, SETTINGS)
    assert until(seen)
    assert native.monitor is not built


def test_a_scene_of_another_origin_is_seen_from_the_same_place() -> None:
    native = FakeNative()
    seen = preview(native)
    until(seen)
    scene = scene_of(1.0)
    seen.edit(replace(scene, geometry=replace(scene.geometry, origin=np.array([0.0, 0.0, 3.0]))), "kd", None, SETTINGS)
    jobs = len(native.jobs)
    until(seen)
    heights = [job.camera["to_world"][2, 3] for job in native.jobs]
    assert jobs < len(heights)
    assert heights == [5.0] * jobs + [2.0] * (len(heights) - jobs)


def test_a_large_scene_is_shown_before_the_chosen_structure_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(previews, "QUICK", ((1, "bih"),))
    specs = []

    class Slow(FakeNative):
        def build(self, vertices, triangles, spec, **rest):  # type: ignore[no-untyped-def]
            specs.append(spec)
            self.build_seconds = 0.0 if spec == "bih" else math.inf
            return super().build(vertices, triangles, spec, **rest)

    native = Slow()
    seen = [preview(native)]
    until(seen[0], lambda: seen[0].samples == (4, 4) and seen[0].picture is not None)
    assert specs == ["bih", "kd"]
    assert seen[0].preparing is not None
    assert seen[0].preparing[0] == "kd"
    monitor = native.monitor
    assert monitor is not None
    seen.clear()
    gc.collect()
    assert monitor.cancelled, "a structure that nobody waits for goes on being built"


@pytest.mark.parametrize("begun", [False, True], ids=["first build", "samples"])
def test_another_structure_is_built_while_the_samples_go_on(*, begun: bool) -> None:
    native = FakeNative(build_seconds=0.0 if begun else 0.2)
    seen = preview(native)
    if begun:
        until(seen, lambda: bool(native.jobs) and native.jobs[-1].settings["samples"] == 4)
        native.jobs[-1]._end = math.inf
    else:
        until(seen, lambda: native.builds == 1)
    jobs, done = len(native.jobs), seen.samples
    seen.edit(scene_of(), "bih", None, SETTINGS)
    if begun:
        until(seen, lambda: native.builds == 2 and seen.preparing is None)
        assert (len(native.jobs), seen.samples) == (jobs, done)
        native.jobs[-1]._end = 0.0
    until(seen)
    assert not any(job.cancelled for job in native.jobs)
    assert (native.builds, seen.samples) == (2, (4, 4))
    if begun:
        assert len(native.jobs) == jobs, "the picture is not rendered again"
    # The next picture uses it.
    seen.look(view_from(6))
    until(seen)
    assert seen._ready is not None
    assert seen._ready.session.spec == "bih"


def test_a_moved_view_stops_the_fine_picture_and_starts_coarse() -> None:
    native = FakeNative()
    seen = preview(native)
    until(seen, lambda: bool(native.jobs) and native.jobs[-1].settings["samples"] == 4)
    native.jobs[-1]._end = math.inf
    seen.look(view_from(6))
    seen.advance()
    assert native.jobs[-2].cancelled
    assert not native.jobs[-1].cancelled


def test_a_coarse_picture_is_shown_though_the_view_moves_on() -> None:
    native = FakeNative()
    seen = preview(native)
    native.render_seconds = math.inf
    until(seen, lambda: bool(native.jobs))
    seen.look(view_from(6))
    assert not seen.advance()
    first = native.jobs[0]
    assert not first.cancelled
    first._end = 0.0
    assert seen.advance()
    assert len(native.jobs) == 2, "the view of now is begun at once"


def test_views_of_the_same_triangles_share_a_structure() -> None:
    native, stock = FakeNative(), Stock()
    first, second = (preview(native, stock=stock) for _ in range(2))
    until(first)
    until(second)
    assert stock.find(scene_of().geometry, "kd") is not None
    assert native.builds == 1
    del first, second
    gc.collect()
    assert stock.find(scene_of().geometry, "kd") is None


def test_a_failure_is_shown_and_the_next_edit_tries_again() -> None:
    native = FakeNative(error=ValueError("too\nlarge"))
    seen = preview(native)
    until(seen)
    assert seen.problem == "too large"
    native.error = None
    seen.edit(scene_of(1.0), "kd", None, SETTINGS)
    assert until(seen)
    assert seen.problem == ""


def test_a_border_outside_of_coarse_pixels_keeps_one() -> None:
    native = FakeNative()
    seen = preview(native)
    seen.look(replace(view_from(5), border=(63, 47, 64, 48)))
    until(seen)
    for job in native.jobs:
        x0, y0, x1, y1 = job.settings["border"]
        assert 0 <= x0 < x1 <= job.settings["width"]
        assert 0 <= y0 < y1 <= job.settings["height"]

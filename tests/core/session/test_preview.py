# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's picture against a fake native module: what is begun when, what is kept, and that nothing waits."""

from __future__ import annotations

import gc
import math
import time
from dataclasses import replace

import pytest
from fake_native import LONG, SETTINGS, FakeNative, scene_of, view_from

from addon.core.session import preview
from addon.core.session.preview import Preview
from addon.core.session.stock import Stock


def until_idle(seen: Preview) -> list[tuple[int, int]]:
    """Advance until nothing is left to do. Returns scale and samples of each new picture."""
    shown = []
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        if seen.advance() and seen.picture is not None:
            shown.append((seen.picture.scale, seen.picture.samples))
        if not seen.busy:
            return shown
        time.sleep(0.001)
    raise AssertionError("the preview never ends")


def test_pixels_become_smaller_and_samples_more() -> None:
    seen = Preview(FakeNative(), Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    shown = until_idle(seen)
    assert shown[0][0] == preview.FIRST_SCALE
    assert shown[-1][0] == 1
    assert [scale for scale, _ in shown] == sorted((scale for scale, _ in shown), reverse=True)
    assert seen.samples == (4, 4)
    assert not seen.advance()


def test_what_stays_the_same_begins_nothing() -> None:
    native = FakeNative()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    until_idle(seen)
    jobs, built = len(native.jobs), native.monitor
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    assert not until_idle(seen)
    assert (len(native.jobs), native.monitor) == (jobs, built)


@pytest.mark.parametrize("what", ["material", "samples", "view"])
def test_only_new_triangles_are_built_again(what: str) -> None:
    native = FakeNative()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    until_idle(seen)
    built = native.monitor
    if what == "material":
        seen.edit(scene_of(grey=0.1), "kd", None, SETTINGS)
    elif what == "samples":
        seen.edit(scene_of(), "kd", None, replace(SETTINGS, samples=9))
    else:
        seen.look(view_from(6))
    assert until_idle(seen)
    assert native.monitor is built
    seen.edit(scene_of(1.0), "kd", None, SETTINGS)
    assert until_idle(seen)
    assert native.monitor is not built


def test_a_large_scene_is_shown_before_the_chosen_structure_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preview, "QUICK", ((1, "bih"),))
    specs = []

    class Slow(FakeNative):
        def build(self, vertices, triangles, spec, **rest):  # type: ignore[no-untyped-def]
            specs.append(spec)
            self.build_seconds = 0.0 if spec == "bih" else math.inf
            return super().build(vertices, triangles, spec, **rest)

    native = Slow()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    end = time.monotonic() + LONG
    while seen.samples != (4, 4) or seen.picture is None:
        assert time.monotonic() < end
        seen.advance()
        time.sleep(0.001)
    assert specs == ["bih", "kd"]
    assert seen.preparing is not None
    assert seen.preparing[0] == "kd"
    monitor = native.monitor
    assert monitor is not None
    del seen
    gc.collect()
    assert monitor.cancelled, "a structure that nobody waits for goes on being built"


def test_a_moved_view_stops_the_fine_picture_and_starts_coarse() -> None:
    native = FakeNative()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    end = time.monotonic() + LONG
    while not (native.jobs and native.jobs[-1].settings["samples"] == 4):
        assert time.monotonic() < end
        native.render_seconds = 0.0 if len(native.jobs) < 1 else native.render_seconds
        seen.advance()
        time.sleep(0.001)
    native.jobs[-1]._end = math.inf
    seen.look(view_from(6))
    seen.advance()
    assert native.jobs[-2].cancelled
    assert not native.jobs[-1].cancelled


def test_a_coarse_picture_is_shown_though_the_view_moves_on() -> None:
    native = FakeNative()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    end = time.monotonic() + LONG
    native.render_seconds = math.inf
    while not native.jobs:
        assert time.monotonic() < end
        seen.advance()
        time.sleep(0.001)
    seen.look(view_from(6))
    assert not seen.advance()
    first = native.jobs[0]
    assert not first.cancelled
    first._end = 0.0
    assert seen.advance()
    assert len(native.jobs) == 2, "the view of now is begun at once"


def test_views_of_the_same_triangles_share_a_structure() -> None:
    native, stock = FakeNative(), Stock()
    first, second = Preview(native, stock), Preview(native, stock)
    for seen in (first, second):
        seen.edit(scene_of(), "kd", None, SETTINGS)
        seen.look(view_from(5))
    until_idle(first)
    until_idle(second)
    assert stock.find(scene_of().geometry, "kd") is not None
    assert native.builds == 1
    del first, second, seen
    gc.collect()
    assert stock.find(scene_of().geometry, "kd") is None


def test_what_fails_is_said_and_the_next_edit_tries_again() -> None:
    native = FakeNative(error=ValueError("too\nlarge"))
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(view_from(5))
    until_idle(seen)
    assert seen.problem == "too large"
    native.error = None
    seen.edit(scene_of(1.0), "kd", None, SETTINGS)
    assert until_idle(seen)
    assert seen.problem == ""


def test_a_border_outside_of_coarse_pixels_keeps_one() -> None:
    native = FakeNative()
    seen = Preview(native, Stock())
    seen.edit(scene_of(), "kd", None, SETTINGS)
    seen.look(replace(view_from(5), border=(63, 47, 64, 48)))
    until_idle(seen)
    for job in native.jobs:
        x0, y0, x1, y1 = job.settings["border"]
        assert 0 <= x0 < x1 <= job.settings["width"]
        assert 0 <= y0 < y1 <= job.settings["height"]

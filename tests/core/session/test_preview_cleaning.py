# SPDX-License-Identifier: GPL-3.0-or-later
"""Denoising of the viewport's pictures with a fake denoiser: order, what is dropped, failures, and the last picture."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from addon.core.base.denoise import DenoiseError
from addon.core.session.cleaning import Cleaning
from addon.core.session.preview import Preview
from tests.fake_native import LONG, SETTINGS, FakeNative, preview, scene_of, until, view_from


class Denoiser:
    """Returns the colours plus one, once `open` is set. error: what it raises instead."""

    def __init__(self, *, closed: bool = False, error: Exception | None = None) -> None:
        self.open = threading.Event()
        if not closed:
            self.open.set()
        self.error = error
        self.calls: list[tuple[tuple[int, ...], bool, int]] = []
        self.dropped = 0
        self.running = self.most = 0

    def __call__(self, color: Any, albedo: Any, normal: Any, *, threads: int, going: Callable[[], bool]) -> Any:
        self.calls.append((color.shape, albedo is not None and normal is not None, threads))
        self.running += 1
        self.most = max(self.most, self.running)
        while going() and not self.open.is_set():
            time.sleep(0.001)
        self.running -= 1
        self.dropped += not going()
        if self.error is not None:
            raise self.error
        return color + 1


def begun(denoiser: Denoiser, native: FakeNative, clean_from: int = 1) -> Preview:
    """A preview of a view that loses its noise."""
    return preview(native, cleaning=Cleaning(denoiser), clean_from=clean_from)


def slow_from_the_full_picture_on(seen: Preview, native: FakeNative) -> None:
    """Advance until the picture at full resolution is in work, which does not end by itself."""
    until(seen, lambda: bool(native.jobs) and native.jobs[-1].settings["samples"] == SETTINGS.samples)
    native.jobs[-1]._end = math.inf


def test_the_last_picture_is_clean_and_guided() -> None:
    denoiser, native = Denoiser(), FakeNative()
    seen = begun(denoiser, native)
    shown = until(seen)
    assert not shown[0].clean, "the coarse picture is shown at once"
    assert shown[-1].clean
    assert (shown[-1].samples, shown[-1].scale) == (4, 1)
    assert np.array_equal(shown[-1].pixels.reshape(-1, 4), np.tile([1.5, 1.5, 1.5, 0.5], (64 * 48, 1)))
    assert all(call == ((48, 64, 3), True, 0) for call in denoiser.calls)
    assert seen.noise == ""
    assert not seen.advance()


def test_the_view_stays_busy_until_the_last_picture_is_clean() -> None:
    denoiser, native = Denoiser(closed=True), FakeNative()
    seen = begun(denoiser, native)
    until(seen, lambda: bool(denoiser.calls) and seen._job is None and not seen._leaving)
    for _ in range(20):
        seen.advance()
        assert seen.busy
        assert seen.cleaning
    assert seen.picture is not None
    assert not seen.picture.clean
    denoiser.open.set()
    assert until(seen)[-1].clean


def test_without_the_setting_nothing_is_rendered_for_it() -> None:
    denoiser, native = Denoiser(), FakeNative()
    seen = begun(denoiser, native, clean_from=0)
    shown = until(seen)
    assert not denoiser.calls
    assert not any(picture.clean for picture in shown)
    assert {tuple(job.settings["passes"]) for job in native.jobs} == {("Combined",)}


def test_only_pictures_at_full_resolution_have_features() -> None:
    native = FakeNative()
    seen = begun(Denoiser(), native)
    until(seen)
    wanted = {1: ["Combined"], 4: ["Combined", "Denoising Albedo", "Normal"]}
    assert all(job.settings["passes"] == wanted[job.settings["samples"]] for job in native.jobs)
    seen.edit(scene_of(), "kd", None, replace(SETTINGS, integrator="ao"), 1)
    until(seen)
    assert native.jobs[-1].settings["passes"] == ["Combined"]
    assert seen.picture is not None
    assert seen.picture.clean


def test_no_noise_returns_once_a_view_is_clean() -> None:
    denoiser, native = Denoiser(), FakeNative()
    seen = begun(denoiser, native)
    slow_from_the_full_picture_on(seen, native)
    until(seen, lambda: seen.picture is not None and seen.picture.clean)
    assert seen.picture is not None
    assert seen.picture.samples == 1
    denoiser.open.clear()
    native.jobs[-1]._end = 0.0
    assert not until(seen, lambda: len(denoiser.calls) == 2), "the last samples wait for the denoiser"
    denoiser.open.set()
    assert [(p.samples, p.clean) for p in until(seen)] == [(4, True)]


def test_the_last_picture_replaces_one_in_work() -> None:
    denoiser, native = Denoiser(closed=True), FakeNative()
    seen = begun(denoiser, native)
    slow_from_the_full_picture_on(seen, native)
    until(seen, lambda: len(denoiser.calls) == 1)
    native.jobs[-1]._end = 0.0
    until(seen, lambda: len(denoiser.calls) == 2)
    assert (denoiser.dropped, denoiser.most) == (1, 1), "one picture at a time"
    denoiser.open.set()
    assert [p.samples for p in until(seen) if p.clean] == [4]


@pytest.mark.parametrize("what", ["move", "edit", "stop", "end"])
def test_outdated_work_is_dropped_without_waiting(what: str) -> None:
    denoiser, native = Denoiser(closed=True), FakeNative()
    seen = begun(denoiser, native)
    until(seen, lambda: len(denoiser.calls) == 1)
    work = seen._cleaning._work if seen._cleaning is not None else None
    assert work is not None
    if what == "move":
        seen.look(view_from(6))
        seen.advance()
    elif what == "edit":
        seen.edit(scene_of(grey=0.1), "kd", None, SETTINGS, 1)
    elif what == "stop":
        seen.stop()
    else:
        del seen
        gc.collect()
    assert work.stopped
    work.join(LONG)
    assert denoiser.dropped == 1
    if what in ("move", "edit"):
        old = seen.picture
        denoiser.open.set()
        assert all(p is old or p.what != (1, 1) for p in until(seen))
        assert seen.picture is not None
        assert seen.picture.clean


def test_the_first_samples_stay_noisy_up_to_the_start() -> None:
    denoiser, native = Denoiser(), FakeNative()
    seen = begun(denoiser, native, clean_from=2)
    slow_from_the_full_picture_on(seen, native)
    until(seen, lambda: seen.picture is not None and seen.picture.scale == 1)
    for _ in range(20):
        seen.advance()
    assert not denoiser.calls
    native.jobs[-1]._end = 0.0
    until(seen)
    assert len(denoiser.calls) == 1
    # A start beyond the last sample cleans the last one.
    seen = begun(denoiser, FakeNative(), clean_from=1000)
    until(seen)
    assert len(denoiser.calls) == 2


def test_a_failure_is_noted_and_the_noise_stays_until_the_next_edit() -> None:
    denoiser, native = Denoiser(error=DenoiseError("no\nlibrary")), FakeNative()
    seen = begun(denoiser, native)
    slow_from_the_full_picture_on(seen, native)
    until(seen, lambda: bool(seen.noise))
    native.jobs[-1]._end = 0.0
    until(seen)
    assert seen.noise == "no library"
    assert seen.problem == ""
    assert seen.picture is not None
    assert (seen.picture.samples, seen.picture.clean) == (4, False)
    assert len(denoiser.calls) == 1
    denoiser.error = None
    seen.edit(scene_of(grey=0.1), "kd", None, SETTINGS, 1)
    until(seen)
    assert seen.noise == ""
    assert seen.picture.clean


def test_a_part_keeps_its_place() -> None:
    denoiser = Denoiser()
    seen = begun(denoiser, FakeNative())
    seen.look(replace(view_from(5), border=(8, 4, 40, 20)))
    until(seen)
    assert seen.picture is not None
    assert seen.picture.part == (8, 4, 40, 20)
    assert seen.picture.pixels.size == 32 * 16 * 4
    assert denoiser.calls[-1][0] == (16, 32, 3)


@pytest.mark.parametrize(("catcher", "film", "calls"), [(False, True, 1), (True, False, 1), (True, True, 2)])
def test_alpha_loses_its_noise_where_catchers_have_it(catcher: bool, film: bool, calls: int) -> None:
    plain, denoiser = scene_of(), Denoiser()
    scene = replace(plain, materials=(replace(plain.materials[0], catcher=catcher),))
    seen = begun(denoiser, FakeNative(), clean_from=4)
    seen.edit(scene, "kd", None, replace(SETTINGS, film_transparent=film), 4)
    until(seen)
    assert seen.picture is not None
    assert seen.picture.clean
    assert len(denoiser.calls) == calls
    assert seen.picture.pixels[3] == (1.0 if calls == 2 else 0.5)

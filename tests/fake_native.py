# SPDX-License-Identifier: GPL-3.0-or-later
"""A stand-in for the compiled module: the same names, no geometry. For the logic of sessions and of the engine."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from addon.core.scene.scene import Camera, Geometry, Material, Scene, World
from addon.core.session.cleaning import Cleaning
from addon.core.session.preview import Picture, Preview, View
from addon.core.session.stock import Stock
from addon.core.structures.settings import RenderSettings

CHANNELS = {
    "Combined": 4,
    "Denoising Albedo": 3,
    "Depth": 1,
    "Normal": 3,
    "Position": 3,
    "Traversal Steps": 1,
    "Triangle Tests": 1,
}


class Monitor:
    def __init__(self) -> None:
        self.progress = 0.0
        self.cancelled = False

    def cancel(self) -> None:
        self.cancelled = True


class Structure:
    def __init__(self, triangles: int) -> None:
        self.statistics = {
            "build_seconds": 0.0,
            "bytes": 64,
            "dropped_triangles": 0,
            "left_out": [],
            "triangles": triangles,
        }

    def refit(self, vertices: Any, *, threads: int = 0, monitor: Monitor | None = None) -> Structure:
        """Refuses, as trees of planes do."""
        raise RefitError("built again")


class RefitError(ValueError):
    """As in the native module."""


class Cancelled(RuntimeError):
    pass


class FakeNative:
    """build_seconds and render_seconds: how long the work lasts unless it is cancelled. error: what a build raises,
    job_error: what a render reports."""

    RefitError = RefitError

    Monitor = Monitor

    def __init__(
        self,
        *,
        build_seconds: float = 0.0,
        render_seconds: float = 0.0,
        error: Exception | None = None,
        job_error: str | None = None,
    ) -> None:
        self.build_seconds = build_seconds
        self.render_seconds = render_seconds
        self.error = error
        self.job_error = job_error
        self.monitor: Monitor | None = None
        self.memory_limit: int | None = None
        self.jobs: list[Job] = []
        self.builds = 0

    def build(
        self, vertices: Any, triangles: Any, spec: str, *, threads: int, monitor: Monitor, memory_limit: int | None
    ) -> Structure:
        self.monitor = monitor
        self.memory_limit = memory_limit
        self.builds += 1
        if self.error is not None:
            raise self.error
        end = time.monotonic() + self.build_seconds
        while time.monotonic() < end:
            if monitor.cancelled:
                raise Cancelled("cancelled")
            monitor.progress = 0.5
            time.sleep(0.005)
        return Structure(len(triangles))

    def RenderScene(self, structure: Structure, **parts: Any) -> Any:
        return type("RenderScene", (), {"left_out": ["shadow rays: no lights"], "parts": parts})()

    def render(
        self, scene: Any, camera: dict[str, Any], settings: dict[str, Any], *, threads: int, points: Any = None
    ) -> Job:
        job = Job(settings, self.render_seconds, self.job_error)
        job.camera = camera
        self.jobs.append(job)
        return job


class Job:
    def __init__(self, settings: dict[str, Any], seconds: float, error: str | None) -> None:
        x0, y0, x1, y1 = settings["border"] or (0, 0, settings["width"], settings["height"])
        self._pixels = (x1 - x0) * (y1 - y0)
        self._start = time.monotonic()
        self._end = self._start + seconds
        self.passes = {name: CHANNELS[name] for name in settings["passes"]}
        self.cancelled = False
        self.error = error
        self.settings = settings
        self.camera: dict[str, Any] = {}
        self.statistics = {"mrays_s": 1.0, "seconds": seconds}

    @property
    def samples_done(self) -> int:
        return int(self.settings["samples"]) if self.finished else 1

    @property
    def finished(self) -> bool:
        return self.cancelled or time.monotonic() >= self._end

    @property
    def progress(self) -> float:
        return 1.0 if self.finished else 0.5

    def wait(self, milliseconds: int) -> bool:
        if not self.finished:
            time.sleep(min(milliseconds / 1000, max(self._end - time.monotonic(), 0.0)))
        return self.finished

    def cancel(self) -> None:
        self.cancelled = True

    def copy_into(self, name: str, out: np.ndarray[Any, Any], *, keep: bool = False) -> None:
        assert out.dtype == np.float32
        assert out.shape == (self._pixels * self.passes[name],)
        out[:] = 0.5


SETTINGS = RenderSettings(1, 1, samples=4)
LONG = 300.0
"""Seconds in which everything here must have happened."""


def scene_of(height: float = 0.0, *, grey: float = 0.5) -> Scene:
    """A triangle at some height, in some grey."""
    vertices = np.array([[0, 0, height], [1, 0, height], [0, 1, height]], np.float32)
    geometry = Geometry(vertices, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    return Scene(geometry, (Material("grey", (grey, grey, grey)),), (), World())


def view_from(height: float) -> View:
    """64 × 48 pixels seen from some height."""
    to_world = np.eye(4)
    to_world[2, 3] = height
    return View(Camera("perspective", to_world, (-1.0, 1.0, -1.0, 1.0), 0.1, 100.0), 64, 48)


def preview(
    native: FakeNative,
    *,
    stock: Stock | None = None,
    cleaning: Cleaning | None = None,
    clean_from: int = 0,
    scene: Scene | None = None,
) -> Preview:
    """A preview of a triangle, seen from above."""
    seen = Preview(native, stock or Stock(), cleaning)
    seen.edit(scene or scene_of(), "kd", None, SETTINGS, clean_from)
    seen.look(view_from(5))
    return seen


def until(seen: Preview, done: Callable[[], bool] | None = None) -> list[Picture]:
    """Advance until `done`, or until nothing is left to do. Returns the new pictures."""
    shown: list[Picture] = []
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        if seen.advance() and seen.picture is not None:
            shown.append(seen.picture)
        if done() if done is not None else not seen.busy:
            return shown
        time.sleep(0.001)
    raise AssertionError("it never happens")

# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a 3D view: coarse at once, refined while nothing changes. It waits for nothing; no window freezes.

Two kinds of work go on at a time, each on threads of its own. *Preparing*: a structure that is built quickly shows the
scene until the chosen one is there; which one it is cannot be seen, since all give one image. *Tracing*: one sample in
large pixels, then in smaller ones, then all samples in the view's own pixels.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.background import Background
from ..base.equality import same
from ..structures.settings import RenderSettings
from ..structures.specs import structure_of
from .session import Building, Session

if TYPE_CHECKING:
    from ..base.arrays import F32
    from ..base.interface import Native, RenderJob
    from ..scene.scene import Camera, Scene
    from .stock import Stock

QUICK = ((20_000, "bvh-sah"), (300_000, "bih"))
"""From how many triangles on which structure shows a scene first; below, the chosen one is there as soon.

On Sponza the first picture comes after 0.15 s with `bvh-sah`, 0.27 s with `bih`, which is built three times as quickly
and traced four times as slowly, and 0.5 s with `kd`.
"""

COARSEST = 16
"""Largest pixels, in pixels of the view."""

FIRST_SCALE = 8
"""Before it is known how fast the scene is."""

MOVING_SECONDS = 0.05
"""What a picture may take while the view moves."""

PATIENCE = 0.25
"""A coarse picture of a view that has changed meanwhile is finished and shown, unless it takes longer than this; the
next size is at most so much work."""

SHOW_SECONDS = 0.1
"""A refined picture is shown at most so often, and less often where showing is dear:"""

DRAWING_SHARE = 10
"""one part of the time goes into showing, so many into tracing."""

BEGUN = 0.1
"""A picture that is less than so far is begun again with a better structure."""


@dataclass(frozen=True)
class View:
    """What a region of the window shows. border: x0, y0, x1, y1 in its pixels, half open; None for all. pixel: the
    smallest size of a pixel, in pixels of the region.
    """

    camera: Camera
    width: int
    height: int
    border: tuple[int, int, int, int] | None = None
    pixel: int = 1


@dataclass(frozen=True, eq=False)
class Picture:
    """pixels: flat float32 RGBA, rows from the bottom, of the part x0, y0, x1, y1 of a view of width × height.

    what: of which edit and which move. scale: how large its pixels are in pixels of the region.
    """

    pixels: F32
    width: int
    height: int
    part: tuple[int, int, int, int]
    samples: int
    what: tuple[int, int]
    scale: int


@dataclass(frozen=True, eq=False)
class _Ready:
    """A scene that can be traced. building: kept so that its structure lives, and others may share it."""

    edit: int
    session: Session
    building: Building


class _Preparing:
    """Building one structure after the other over one scene, each for the renderer as soon as it is there."""

    def __init__(
        self, native: Native, stock: Stock, scene: Scene, specs: list[str], limit: int | None, edit: int
    ) -> None:
        self.ended = False
        self.shown = False
        """Whether the first structure is there."""
        self._native, self._stock, self._scene, self._limit, self._edit = native, stock, scene, limit, edit
        self._specs = specs
        self._joining: Background | None = None
        self._sessions: list[Session] = []
        self._building = self._begin()

    def _begin(self) -> Building:
        return self._stock.take(self._native, self._scene.geometry, self._specs[0], memory_limit=self._limit)

    @property
    def progress(self) -> tuple[str, float]:
        """The spec of the structure that is being built, and how far it is."""
        return self._specs[0], self._building.progress

    def advance(self) -> _Ready | None:
        """What has become ready since the last call. Raises what the native module raises."""
        if self._joining is None:
            if not self._building.wait(0):
                return None
            structure, sessions = self._building.result(), self._sessions
            native, scene = self._native, self._scene
            self._joining = Background((Session.over(native, scene, structure) for _ in range(1)), sessions.append)
        if not self._joining.wait(0):
            return None
        ready = _Ready(self._edit, self._sessions.pop(), self._building)
        self._joining = None
        self._specs = self._specs[1:]
        self.shown, self.ended = True, not self._specs
        if self._specs:
            self._building = self._begin()
        return ready


@dataclass(frozen=True, eq=False)
class _Job:
    """A native render of one view. what: of which edit and which move. first: nothing of these was shown before."""

    native: RenderJob
    view: View
    settings: RenderSettings
    scale: int
    what: tuple[int, int]
    first: bool
    started: float

    @property
    def age(self) -> float:
        return time.monotonic() - self.started

    @property
    def pixels(self) -> int:
        """Pixel samples in all."""
        width, height = self.settings.size
        return width * height * self.settings.samples


class Preview:
    """One view of a scene, moved on by `advance`, which must be called often while `busy`."""

    def __init__(self, native: Native, stock: Stock) -> None:
        self.picture: Picture | None = None
        self.problem = ""
        """Why there is no picture, or nothing."""
        self.showing_seconds = 0.0
        """What it takes to bring a picture into the window; told by whoever does."""
        self._native, self._stock = native, stock
        self._scene: Scene | None = None
        self._settings = RenderSettings(1, 1)
        self._spec = ""
        self._memory_limit: int | None = None
        self._edits = 0
        self._preparing: _Preparing | None = None
        self._ready: _Ready | None = None
        self._view: View | None = None
        self._moves = 0
        self._job: _Job | None = None
        self._leaving: list[_Job] = []
        self._finished: tuple[tuple[int, int], int] | None = None
        self._rate = 0.0
        self._shown = 0.0

    def __del__(self) -> None:
        if hasattr(self, "_leaving"):
            self.stop()

    def stop(self) -> None:
        """Ask all work to end, and do not wait for it."""
        self._preparing = None
        self._drop()

    def edit(self, scene: Scene, spec: str, memory_limit: int | None, settings: RenderSettings) -> None:
        """Take over the scene and how to render it; size, border and passes of the settings do not count.

        What has not changed costs nothing.
        """
        before = (self._spec, self._memory_limit, self._settings)
        if before == (spec, memory_limit, settings) and same(self._scene, scene):
            return
        self._scene, self._spec, self._memory_limit, self._settings = scene, spec, memory_limit, settings
        self._edits += 1
        self.problem = ""
        # A quick structure is finished and shown first, else a thing that is dragged would never be seen.
        if self._preparing is None or self._preparing.shown:
            self._prepare()

    def look(self, view: View) -> None:
        """Take over what is seen."""
        if not same(self._view, view):
            self._view = view
            self._moves += 1

    @property
    def busy(self) -> bool:
        """Whether `advance` has anything to do."""
        return self._preparing is not None or self._job is not None or bool(self._leaving)

    @property
    def samples(self) -> tuple[int, int]:
        """Samples of each of the view's own pixels so far, and wanted."""
        job = self._job
        done = self._settings.samples
        if job is not None:
            done = job.native.samples_done if job.scale == job.view.pixel else 0
        elif self._finished is None:
            done = 0
        return done, self._settings.samples

    @property
    def preparing(self) -> tuple[str, float] | None:
        """The spec of the structure that is being built, and how far it is, 0 to 1."""
        return None if self._preparing is None else self._preparing.progress

    def advance(self) -> bool:
        """Begin what can begin, take what has come. Returns whether there is something new to show."""
        self._leaving = [job for job in self._leaving if not job.native.finished]
        try:
            self._take_structure()
            return self._trace()
        except Exception as error:
            # Whatever the native module refuses is shown to the user; the next edit tries again.
            self.problem = " ".join(str(error).split()) or type(error).__name__
            self.stop()
            self._ready = None
            return True

    def _prepare(self) -> None:
        """Begin to prepare the newest scene."""
        assert self._scene is not None
        self._preparing = None  # which frees or stops what nobody else uses
        specs = [self._spec]
        geometry = self._scene.geometry
        quick = [spec for triangles, spec in QUICK if triangles <= geometry.size]
        chosen = structure_of(self._spec)
        if quick and chosen not in quick and self._stock.find(geometry, self._spec, self._memory_limit) is None:
            specs.insert(0, quick[-1])
        self._preparing = _Preparing(self._native, self._stock, self._scene, specs, self._memory_limit, self._edits)

    def _take_structure(self) -> None:
        if self._preparing is None or (ready := self._preparing.advance()) is None:
            return
        better = self._ready is not None and self._ready.edit == ready.edit
        self._ready = ready
        if self._preparing.ended:
            self._preparing = None
        if ready.edit != self._edits:
            self._prepare()
        elif better and self._job is not None and self._job.native.progress < BEGUN:
            self._drop()  # it is begun again with the better structure, which soon makes good for it

    def _trace(self) -> bool:
        if self._ready is None or self._view is None:
            return False
        wanted = (self._ready.edit, self._moves)
        job, new = self._job, False
        if job is not None:
            if job.native.finished:
                new = self._end(job)
            elif job.what == wanted:
                pause = max(SHOW_SECONDS, DRAWING_SHARE * self.showing_seconds)
                return time.monotonic() - self._shown >= pause and self._show(job)
            elif job.first and (job.age < PATIENCE or job.scale == COARSEST):
                return False  # a picture of a moment ago is better than none
            else:
                if job.first:
                    self._rate = min(self._rate, job.pixels / job.age) / 4
                self._drop()
        if self._finished is None or self._finished[0] != wanted:
            self._start(wanted, self._coarse(), first=True)
        elif self._finished[1] > self._view.pixel:
            self._start(wanted, self._finer(self._finished[1]), first=False)
        return new

    def _end(self, job: _Job) -> bool:
        """Take what a job that has ended leaves."""
        self._job = None
        if job.native.error is not None:
            raise RuntimeError(job.native.error)
        self._rate = job.pixels / max(job.native.statistics["seconds"], 1e-6)
        self._finished = (job.what, job.scale)
        return self._show(job)

    def _show(self, job: _Job) -> bool:
        """Copy what a job has so far; False when it has nothing new."""
        samples = job.native.samples_done
        old = self.picture
        if samples == 0 or (
            old is not None and (old.what, old.scale) == (job.what, job.scale) and old.samples >= samples
        ):
            return False
        settings = job.settings
        width, height = settings.size
        pixels = np.empty(width * height * 4, np.float32)
        job.native.copy_into("Combined", pixels)
        part = settings.border or (0, 0, settings.width, settings.height)
        self.picture = Picture(pixels, settings.width, settings.height, part, samples, job.what, job.scale)
        self._shown = time.monotonic()
        return True

    def _start(self, what: tuple[int, int], scale: int, *, first: bool) -> None:
        view, ready = self._view, self._ready
        assert view is not None
        assert ready is not None
        width, height = max(view.width // scale, 1), max(view.height // scale, 1)
        border = None
        if view.border is not None:
            # Every pixel that the border touches, at least one.
            x0, y0, x1, y1 = view.border
            x0, y0 = min(x0 // scale, width - 1), min(y0 // scale, height - 1)
            border = (x0, y0, min(max(-(-x1 // scale), x0 + 1), width), min(max(-(-y1 // scale), y0 + 1), height))
        settings = replace(
            self._settings,
            width=width,
            height=height,
            border=border,
            samples=1 if scale > view.pixel else self._settings.samples,
            passes=("Combined",),
        )
        native = ready.session.render(view.camera, settings)
        self._job = _Job(native, view, settings, scale, what, first, time.monotonic())

    def _drop(self) -> None:
        """Ask the running job to stop. It is kept until it has, because forgetting it waits for that."""
        if self._job is not None:
            self._job.native.cancel()
            self._leaving.append(self._job)
            self._job = None

    def _coarse(self) -> int:
        """The size of pixels in which the view can be shown while it moves."""
        assert self._view is not None
        scale = self._view.pixel
        while scale < COARSEST and (
            scale < FIRST_SCALE if self._rate == 0.0 else self._seconds(scale) > MOVING_SECONDS
        ):
            scale *= 2
        return scale

    def _finer(self, scale: int) -> int:
        """The size of pixels after `scale`: at most half, less where that takes no patience."""
        assert self._view is not None
        scale = max(scale // 2, self._view.pixel)
        while scale > self._view.pixel and self._seconds(max(scale // 2, self._view.pixel)) < PATIENCE:
            scale = max(scale // 2, self._view.pixel)
        return scale

    def _seconds(self, scale: int) -> float:
        """What one sample in pixels of this size may take."""
        view = self._view
        assert view is not None
        x0, y0, x1, y1 = view.border or (0, 0, view.width, view.height)
        return (x1 - x0) * (y1 - y0) / scale**2 / max(self._rate, 1.0)

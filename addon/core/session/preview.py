# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a 3D view: coarse at once, refined while nothing changes. No call blocks, so no window freezes.

Two kinds of work run concurrently, each on its own threads. *Preparing* builds a fast-building structure first and then
the chosen one; both give the same image. *Tracing* renders one sample in large pixels, then in smaller ones, then all
samples at the view's own resolution. On request a third kind removes the noise of the latter, see `cleaning`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..base import denoise
from ..base.equality import same
from ..base.native import reason
from ..structures.settings import RenderSettings
from ..structures.specs import structure_of
from . import refits
from .cleaning import Cleaning, Noisy
from .preparing import Preparing, Ready
from .session import render

if TYPE_CHECKING:
    from ..base.arrays import F32
    from ..base.interface import Native, RenderJob
    from ..scene.scene import Camera, Scene
    from .stock import Stock

QUICK = ((20_000, "bvh-hlbvh"), (1_000_000, "bih"))
"""Pairs of a number of triangles and the structure that shows scenes of at least that size first. Smaller scenes start
with the chosen structure, whose build takes no longer.

Builds by Morton order take half the time of `bvh-sah`, and rays a tenth to a half longer; beyond a million triangles
`bih`, which builds in half of that again, shows a first picture sooner (`bench --structures bvh-sah,bvh-hlbvh,bih`).
"""

COARSEST = 16
"""Largest pixel size, in pixels of the view."""

FIRST_SCALE = 8
"""Pixel size before the speed of the scene is known."""

MOVING_SECONDS = 0.05
"""Target seconds of a picture while the view moves."""

PATIENCE = 0.25
"""Age in seconds up to which a coarse picture of an outdated view is finished and shown; also the limit on the work of
the next refinement.
"""

SHOW_SECONDS = 0.1
"""Shortest interval in seconds between two refined pictures."""

DRAWING_SHARE = 10
"""Shortest such interval as a multiple of the time to draw a picture, so that drawing takes at most a tenth."""

BEGUN = 0.1
"""Progress below which a picture is restarted when a better structure is ready."""


@dataclass(frozen=True)
class View:
    """The visible part of a window region. camera: in the world. border: x0, y0, x1, y1 in its pixels, half open; None
    for all. pixel: the smallest pixel size, in pixels of the region.
    """

    camera: Camera
    width: int
    height: int
    border: tuple[int, int, int, int] | None = None
    pixel: int = 1


@dataclass(frozen=True, eq=False)
class Picture:
    """A rendered picture. pixels: flat float32 RGBA, rows from the bottom, of the part x0, y0, x1, y1 of a view of
    width × height.

    what: numbers of the edit (scene and settings) and of the move (view) that it shows. scale: its pixel size in pixels
    of the region. clean: whether its noise was removed.
    """

    pixels: F32
    width: int
    height: int
    part: tuple[int, int, int, int]
    samples: int
    what: tuple[int, int]
    scale: int
    clean: bool = False


@dataclass(frozen=True, eq=False)
class _Job:
    """A native render of one view. what: as in Picture. first: no picture with this `what` was shown yet."""

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
        """Pixel samples in total."""
        width, height = self.settings.size
        return width * height * self.settings.samples


class Preview:
    """The preview of one scene and view. Call `advance` often while `busy`."""

    def __init__(self, native: Native, stock: Stock, cleaning: Cleaning | None = None) -> None:
        """cleaning: of this view alone; without it pictures keep their noise."""
        self.picture: Picture | None = None
        self.problem = ""
        """The reason why there is no picture, or ""."""
        self.showing_seconds = 0.0
        """Seconds to draw a picture into the window; set by the caller."""
        # The scene and its settings, as of the last edit.
        self._native, self._stock = native, stock
        self._scene: Scene | None = None
        self._settings = RenderSettings(1, 1)
        self._spec = ""
        self._memory_limit: int | None = None
        self._cleaning, self._clean_from = cleaning, 0
        self._edits = 0
        self._preparing: Preparing | None = None
        self._ready: Ready | None = None
        # The view, the running render, and those being cancelled.
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
        """Request the end of all work without waiting for it."""
        self._preparing = None
        self._drop()
        if self._cleaning is not None:
            self._cleaning.drop()

    def edit(
        self, scene: Scene, spec: str, memory_limit: int | None, settings: RenderSettings, clean_from: int = 0
    ) -> None:
        """Set the scene and how to render it; size, border and passes of the settings are ignored.

        clean_from: number of samples from which pictures lose their noise, 0 for none; the last one does in any case.
        Unchanged arguments have no effect. Another structure is built while the samples of the picture go on, since the
        picture does not depend on it.
        """
        built, shown = (self._spec, self._memory_limit), (self._settings, self._clean_from)
        same_picture = shown == (settings, clean_from) and same(self._scene, scene)
        if same_picture and built == (spec, memory_limit):
            return
        self._scene, self._spec, self._memory_limit, self._settings = scene, spec, memory_limit, settings
        self._clean_from = clean_from
        if not same_picture:
            self._edits += 1
            if self._cleaning is not None:
                self._cleaning.drop()
        self.problem = ""
        # Let a fast-building structure finish and show first; otherwise an object that is dragged would never be seen.
        if self._preparing is None or self._preparing.shown:
            self._prepare()

    def look(self, view: View) -> None:
        """Set the visible view."""
        if not same(self._view, view):
            self._view = view
            self._moves += 1

    @property
    def busy(self) -> bool:
        """Whether `advance` has work to do."""
        return self._preparing is not None or self._job is not None or bool(self._leaving) or self.cleaning

    @property
    def cleaning(self) -> bool:
        """Whether the noise of a picture is being removed."""
        return self._cleaning is not None and self._cleaning.busy

    @property
    def noise(self) -> str:
        """The reason why pictures keep their noise against the settings, or ""."""
        return self._cleaning.problem if self._cleaning is not None and self._clean_from else ""

    @property
    def samples(self) -> tuple[int, int]:
        """Samples per pixel at full resolution so far, and in total."""
        job = self._job
        done = self._settings.samples
        if job is not None:
            done = job.native.samples_done if job.scale == job.view.pixel else 0
        elif self._finished is None:
            done = 0
        return done, self._settings.samples

    @property
    def preparing(self) -> tuple[str, float] | None:
        """The configuration that is being built and its progress, 0 to 1, or None."""
        return None if self._preparing is None else self._preparing.progress

    @property
    def followed(self) -> str:
        """The update of the structure when the scene last changed: "refitted", or "rebuilt" with the reason; "" if
        it is the first of its triangles, or if structures of its kind are built again after each change.
        """
        session = None if self._ready is None else self._ready.session
        if session is None or not session.done or not refits.can_fit(self._native, session.spec):
            return ""
        return session.done

    def advance(self) -> bool:
        """Start and finish work without blocking. Returns whether there is something new to show."""
        self._leaving = [job for job in self._leaving if not job.native.finished]
        try:
            self._take_structure()
            traced = self._trace()
            return self._take_clean() or traced
        except BaseException as error:
            # Show any exception of the native module to the user; the next edit tries again.
            self.problem = reason(error)
            self.stop()
            self._ready = None
            return True

    def _prepare(self) -> None:
        """Start to prepare the newest scene."""
        assert self._scene is not None
        self._preparing = None  # frees, or stops, what is not shared
        specs = [self._spec]
        geometry = self._scene.geometry
        is_shown = self._ready is not None and self._ready.edit == self._edits
        quick = [] if is_shown else [spec for triangles, spec in QUICK if triangles <= geometry.size]
        chosen = structure_of(self._spec)
        if quick and chosen not in quick and self._stock.find(geometry, self._spec, self._memory_limit) is None:
            specs.insert(0, quick[-1])
        self._preparing = Preparing(
            self._native, self._stock, self._scene, specs, self._memory_limit, self._edits, self._ready
        )

    def _take_structure(self) -> None:
        """Take a structure that became ready, and prepare the next one if scene or structure changed meanwhile."""
        preparing = self._preparing
        if preparing is None:
            return
        better = preparing.shown
        if (ready := preparing.advance()) is None:
            return
        self._ready = ready
        if preparing.ended:
            self._preparing = None
        if ready.edit != self._edits or preparing.wanted != (self._spec, self._memory_limit):
            self._prepare()
        elif better and self._job is not None and self._job.native.progress < BEGUN:
            self._drop()  # restarted with the better structure, which soon regains the lost time

    def _take_clean(self) -> bool:
        """Show a picture that lost its noise; False if there is none of this edit and move."""
        if self._cleaning is None:
            return False
        if self._ready is not None:
            self._cleaning.drop(keep=(self._ready.edit, self._moves))
        if (picture := self._cleaning.advance()) is None:
            return False
        self.picture, self._shown = picture, time.monotonic()
        return True

    def _trace(self) -> bool:
        """Finish, continue or replace the running render; returns whether there is something new to show."""
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
                return False  # an outdated picture is better than none
            else:
                if job.first:
                    # The view moved on before the coarse picture was done: render the next one coarser.
                    self._rate = min(self._rate, job.pixels / job.age) / 4
                self._drop()
        # Start the coarse picture of a new view, or the next refinement.
        if self._finished is None or self._finished[0] != wanted:
            self._start(wanted, self._coarse(), first=True)
        elif self._finished[1] > self._view.pixel:
            self._start(wanted, self._finer(self._finished[1]), first=False)
        return new

    def _end(self, job: _Job) -> bool:
        """Record the speed of a finished job, and show it. Raises RuntimeError with the job's error."""
        self._job = None
        if job.native.error is not None:
            raise RuntimeError(job.native.error)
        self._rate = job.pixels / max(job.native.statistics["seconds"], 1e-6)
        self._finished = (job.what, job.scale)
        return self._show(job)

    def _show(self, job: _Job) -> bool:
        """Show a job's current picture, and have its noise removed. Returns False if it has no new samples, or if one
        of its pictures without noise is shown.
        """
        samples, picture = job.native.samples_done, None
        if samples == 0:
            return False
        if self._cleaning is not None and self._to_clean(job, samples):
            picture = self._copy(job, samples)
            features = {name: self._pass(job, name, 3) for name in denoise.FEATURES if name in job.settings.passes}
            catchers = self._scene is not None and any(material.catcher for material in self._scene.materials)
            alpha = catchers and job.settings.film_transparent
            self._cleaning.take(Noisy(picture, features, job.settings.threads, alpha))
        old = self.picture
        if old is not None and (old.what, old.scale) == (job.what, job.scale) and (old.clean or old.samples >= samples):
            return False
        self.picture, self._shown = picture or self._copy(job, samples), time.monotonic()
        return True

    def _to_clean(self, job: _Job, samples: int) -> bool:
        """Whether the noise of a job's current picture is to be removed: at full resolution, of the newest edit."""
        if self._cleaning is None or not self._clean_from or job.scale > job.view.pixel or job.what[0] != self._edits:
            return False
        last = job is not self._job  # it has ended
        return (last or samples >= self._clean_from) and self._cleaning.wants(job.what, samples, last=last)

    def _copy(self, job: _Job, samples: int) -> Picture:
        """A job's current picture."""
        whole = job.settings
        part = whole.border or (0, 0, whole.width, whole.height)
        pixels = self._pass(job, "Combined", 4)
        return Picture(pixels, whole.width, whole.height, part, samples, job.what, job.scale)

    def _pass(self, job: _Job, name: str, channels: int) -> F32:
        """A copy of one of a job's passes, flat."""
        width, height = job.settings.size
        values = np.empty(width * height * channels, np.float32)
        job.native.copy_into(name, values)
        return values

    def _start(self, what: tuple[int, int], scale: int, *, first: bool) -> None:
        """Start a render of the current view with pixels of this size."""
        view, ready = self._view, self._ready
        assert view is not None
        assert ready is not None
        width, height = max(view.width // scale, 1), max(view.height // scale, 1)
        border = None
        if view.border is not None:
            # Include every pixel that the border touches, at least one.
            x0, y0, x1, y1 = view.border
            x0, y0 = min(x0 // scale, width - 1), min(y0 // scale, height - 1)
            border = (x0, y0, min(max(-(-x1 // scale), x0 + 1), width), min(max(-(-y1 // scale), y0 + 1), height))
        # Render what guides the denoiser only where it is used.
        coarse = scale > view.pixel
        passes: tuple[str, ...] = ("Combined",)
        if self._clean_from and not coarse:
            passes = denoise.with_features(passes, self._settings.integrator)
        settings = replace(
            self._settings,
            width=width,
            height=height,
            border=border,
            samples=1 if coarse else self._settings.samples,
            noise_threshold=0.0 if coarse else self._settings.noise_threshold,
            passes=passes,
        )
        to_world = view.camera.to_world.copy()
        to_world[:3, 3] -= ready.of.geometry.origin
        native = render(self._native, ready.scene, replace(view.camera, to_world=to_world), settings)
        self._job = _Job(native, view, settings, scale, what, first, time.monotonic())

    def _drop(self) -> None:
        """Cancel the running job. It is kept until it has ended, because deleting it would wait for that."""
        if self._job is not None:
            self._job.native.cancel()
            self._leaving.append(self._job)
            self._job = None

    def _coarse(self) -> int:
        """The pixel size at which the view can be rendered within MOVING_SECONDS."""
        assert self._view is not None
        scale = self._view.pixel
        while scale < COARSEST and (
            scale < FIRST_SCALE if self._rate == 0.0 else self._seconds(scale) > MOVING_SECONDS
        ):
            scale *= 2
        return scale

    def _finer(self, scale: int) -> int:
        """The pixel size after `scale`: at most half, smaller if that takes less than PATIENCE."""
        assert self._view is not None
        scale = max(scale // 2, self._view.pixel)
        while scale > self._view.pixel and self._seconds(max(scale // 2, self._view.pixel)) < PATIENCE:
            scale = max(scale // 2, self._view.pixel)
        return scale

    def _seconds(self, scale: int) -> float:
        """Expected seconds of one sample with pixels of this size."""
        view = self._view
        assert view is not None
        x0, y0, x1, y1 = view.border or (0, 0, view.width, view.height)
        return (x1 - x0) * (y1 - y0) / scale**2 / max(self._rate, 1.0)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: passes a 3D view's content to `core.preview`, and draws the pictures that come back."""

from __future__ import annotations

import logging
import time
import weakref
from typing import TYPE_CHECKING, Any

import bpy
import gpu
from gpu_extras.presets import draw_texture_2d

from ...core.base import native
from ...core.session.cleaning import Cleaning
from ...core.session.preview import Picture, Preview
from ...core.session.stock import STOCK
from ...core.structures import catalogue, specs
from ..read import views
from ..read.remembered import Remembered
from . import denoising
from .reading import Edit

if TYPE_CHECKING:
    from ...core.scene.scene import Scene

TICK_SECONDS = 0.01
"""Interval at which working views are polled, in seconds; Blender's own timer resolution is similar."""

FIRST_SECONDS = 0.04
"""Time to wait for the first picture, in seconds."""

SLICE_SECONDS, LONGEST_SECONDS = 0.03, 0.08
"""Time of each redraw in which the scene is read, in seconds. It doubles up to the longest with each edit during a
reading, which begins again: otherwise an object that is dragged would be seen only when it rests.
"""

PAUSE_SECONDS = 1.0
"""Smallest interval between two such waits, so that several views do not wait one after the other."""

READ = "read the scene for the viewport"
"""The work of reading, as its errors name it."""

log = logging.getLogger(__name__)

_waited = -PAUSE_SECONDS
"""Time of the last wait for a first picture."""

_working: weakref.WeakSet[Viewport] = weakref.WeakSet()
"""The views with unfinished work."""


class Viewport:
    """One 3D view in rendered mode.

    Holds no reference to the engine, so that it is deleted, and stops its work, when Blender frees the engine.
    """

    def __init__(self) -> None:
        self._preview: Preview | None = None
        self._engine: weakref.ref[Any] | None = None
        self._remembered = Remembered()
        self._newest: Edit | None = None
        """The newest edit while it is being read, or waits for the one before to be placed."""
        self._placing: Edit | None = None
        self._scene: Scene | None = None
        self._slice = SLICE_SECONDS
        self._problem = ""
        self._skipped: list[str] = []
        self._texture: Any = None
        self._drawn: Picture | None = None

    def update(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """Begin to read the scene after an edit. The view shows the last picture until there is a new one."""
        try:
            unread = self._newest is not None and self._newest.unread
            self._slice = min(2 * self._slice, LONGEST_SECONDS) if unread else SLICE_SECONDS
            self._begin(context, depsgraph)
            self._read()
        except BaseException as error:
            self._fail(error, READ)
        self._work(engine)

    def _begin(self, context: Any, depsgraph: Any) -> None:
        """Begin to read, in place of an edit that is being read."""
        if self._newest is not None:
            self._newest.close()
            self._newest = None
        if self._preview is None:
            self._preview = Preview(native.load(), STOCK, Cleaning(denoising.quick()))
        # The view's own visibility: local view, its collections, the kinds of objects that it hides.
        space = context.space_data if isinstance(context.space_data, bpy.types.SpaceView3D) else None
        self._newest = Edit(depsgraph, space, self._remembered)

    def _read(self) -> None:
        """Continue to read the newest edit, for a slice of time, and to place it. Raises as extraction does."""
        end = time.perf_counter() + self._slice
        read = self._newest is not None and self._newest.unread and self._newest.read(self._slice)
        self._take(0.0)
        # Small scenes are placed at once.
        if read:
            self._take(max(end - time.perf_counter(), 0.0))

    def _take(self, seconds: float) -> None:
        """Take the scene that was placed, waiting at most this time, and begin to place the next one. Raises as
        extraction does.
        """
        edit = self._placing
        if edit is not None and (scene := edit.placed(seconds)) is not None:
            assert self._preview is not None, "there is one while there is an edit"
            self._placing, self._scene = None, scene
            self._preview.edit(scene, edit.spec, edit.limit, edit.settings, edit.clean_from)
            self._problem, self._skipped = "", edit.notes.lines()
        if self._placing is None and self._newest is not None and not self._newest.unread:
            self._placing, self._newest = self._newest, None
            self._placing.place(self._scene)

    def draw(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """Continue to read, and draw the newest picture."""
        try:
            newest = self._newest
            if newest is not None and newest.unread and newest.outdated(depsgraph):
                # Nobody has listed what was changed.
                self._remembered = Remembered()
                self._begin(context, depsgraph)
            self._read()
        except BaseException as error:
            self._fail(error, READ)
        preview = self._preview
        try:
            if preview is not None:
                self._draw(preview, engine, context)
            else:
                self._show(engine, context)  # the last picture, below the reason in the status line
        except BaseException as error:
            self._fail(error, "draw the viewport")
        engine.update_stats("Halfspace", self.status())
        self._work(engine)

    def _draw(self, preview: Preview, engine: Any, context: Any) -> None:
        pixel = max(int(engine.get_preview_pixel_size(context.scene)), 1)
        preview.look(views.seen(context, pixel))
        preview.advance()
        if preview.picture is None:
            self._wait(preview)
        start = time.perf_counter()
        if preview.picture is not self._drawn:
            self._upload(preview.picture)
            preview.showing_seconds = time.perf_counter() - start
        self._show(engine, context)

    def _fail(self, error: BaseException, what: str) -> None:
        """Stop the work, and show the error in the status line until the next edit."""
        problem = native.reason(error)
        log.error("Halfspace could not %s", what, exc_info=error)
        self.stop()
        self._problem = problem

    def status(self) -> str:
        """The status line in the corner of the view."""
        preview = self._preview
        problem = self._problem or (preview.problem if preview is not None else "")
        if preview is None or problem:
            return problem
        done, wanted = preview.samples
        parts = [] if self._scene is None else [f"Sample {done} of {wanted}"]
        if self._incoming:
            parts.insert(0, "Reading the scene")
        if preview.preparing is not None:
            spec, progress = preview.preparing
            label = catalogue.load()[specs.structure_of(spec)].label
            parts.insert(0, f"{label}: {progress:.0%}")
        elif preview.followed:
            parts.append(f"Structure {preview.followed}")
        if preview.noise:
            parts.append(f"Not denoised: {preview.noise}")
        elif preview.cleaning:
            parts.append("Denoising")
        elif preview.picture is not None and preview.picture.clean:
            parts.append("Denoised")
        if self._skipped:
            more = f" (and {len(self._skipped) - 1} more)" if len(self._skipped) > 1 else ""
            parts.append(self._skipped[0] + more)
        return " | ".join(parts)

    def tick(self) -> bool:
        """Advance the work, and tag the view for redrawing if there is something new. Returns whether there is more to
        do.
        """
        engine = self._engine() if self._engine is not None else None
        if self._preview is None or engine is None:
            return False
        try:
            placed = self._placing is not None and self._placing.ended
            self._take(0.0)
        except BaseException as error:
            placed = True
            self._fail(error, READ)
        # Only while Blender draws the view its data may be read.
        unread = self._newest is not None and self._newest.unread
        shown = self._preview is not None and self._preview.advance()
        if shown or placed or unread or not self._busy:
            engine.tag_redraw()
        return self._busy

    def stop(self) -> None:
        """Request the end of the work for good."""
        for edit in (self._newest, self._placing):
            if edit is not None:
                edit.close()
        if self._preview is not None:
            self._preview.stop()
        # After a failure, what was read may lack an edit.
        self._preview, self._remembered, self._scene = None, Remembered(), None
        self._newest = self._placing = None

    @property
    def _incoming(self) -> bool:
        """Whether an edit is on its way."""
        return self._newest is not None or self._placing is not None

    @property
    def _busy(self) -> bool:
        """Whether there is work left."""
        return self._incoming or (self._preview is not None and self._preview.busy)

    def _wait(self, preview: Preview) -> None:
        """Wait a moment for the very first picture."""
        global _waited  # noqa: PLW0603 (one main thread, which must not be held up)
        if time.perf_counter() < _waited + PAUSE_SECONDS:
            return
        _waited = time.perf_counter()
        end = _waited + FIRST_SECONDS
        while preview.picture is None and preview.busy and time.perf_counter() < end:
            time.sleep(TICK_SECONDS / 4)
            preview.advance()

    def _work(self, engine: Any) -> None:
        """Start the timer that calls `tick` while there is work."""
        if not self._busy:
            return
        self._engine = weakref.ref(engine)
        _working.add(self)
        if not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick, first_interval=TICK_SECONDS)

    def _upload(self, picture: Picture | None) -> None:
        self._drawn = picture
        if picture is None:
            return
        # Upload the picture in half precision, enough for display.
        x0, y0, x1, y1 = picture.part
        self._texture = gpu.types.GPUTexture(
            (x1 - x0, y1 - y0), format="RGBA16F", data=gpu.types.Buffer("FLOAT", len(picture.pixels), picture.pixels)
        )

    def _show(self, engine: Any, context: Any) -> None:
        picture, region = self._drawn, context.region
        if picture is None:
            return
        # Scale the picture to the region, which its pixels may not divide evenly.
        across, up = region.width / picture.width, region.height / picture.height
        x0, y0, x1, y1 = picture.part
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(context.scene)
        draw_texture_2d(self._texture, (x0 * across, y0 * up), (x1 - x0) * across, (y1 - y0) * up)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")


def _tick() -> float | None:
    """The timer's callback: advances all working views; returns None when there are none."""
    for view in tuple(_working):
        try:
            more = view.tick()
        except ReferenceError:  # Blender has freed the engine
            more = False
        if not more:
            _working.discard(view)
    return TICK_SECONDS if _working else None


def stop() -> None:
    """End the work of all views, which Blender may keep for a while, and the timer."""
    for view in tuple(_working):
        view.stop()
    _working.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)

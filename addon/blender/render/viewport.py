# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: passes a 3D view's content to `core.preview`, and draws the pictures that come back."""

from __future__ import annotations

import logging
import time
import weakref
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from ...core.base import native
from ...core.base.notes import Notes
from ...core.session.cleaning import Cleaning
from ...core.session.preview import Picture, Preview
from ...core.session.stock import STOCK
from ...core.structures import catalogue, specs
from ...core.structures.settings import RenderSettings, memory_limit
from ..read import extract, views
from ..read.remembered import Remembered
from ..read.value_nodes.outputs import Wanted
from ..session.reports import KEPT
from ..settings import properties, quality
from . import denoising

TICK_SECONDS = 0.01
"""Interval at which working views are polled, in seconds; Blender's own timer resolution is similar."""

FIRST_SECONDS = 0.2
"""Time to wait for the first picture, in seconds; drawing the window without it would take as long again."""

PAUSE_SECONDS = 1.0
"""Smallest interval between two such waits, so that several views do not wait one after the other."""

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
        self._origin = np.zeros(3)
        self._problem = ""
        self._skipped: list[str] = []
        self._texture: Any = None
        self._drawn: Picture | None = None

    def update(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """Read the scene after an edit."""
        try:
            notes = Notes()
            group = depsgraph.scene.halfspace
            properties.remark_unknown(group, notes)  # first: the status line has room for one note
            quality.remark_unknown(group, notes)
            # The view's own visibility: local view, its collections, the kinds of objects that it hides.
            space = context.space_data if isinstance(context.space_data, bpy.types.SpaceView3D) else None
            found = extract.find(depsgraph, notes, space=space, wanted=Wanted(remembered=self._remembered))
            two_level = found.layout(
                quality.instancing(group), integrator=quality.integrator(group), interactive=True
            ).two_level
            scene = found.instanced(top=quality.top(group)) if two_level else found.flattened()
            KEPT.keep(depsgraph.scene, two_level)
            if self._preview is None:
                self._preview = Preview(native.load(), STOCK, Cleaning(denoising.quick()))
            spec, limit = properties.spec(group), memory_limit(group.memory_limit)
            self._origin = scene.geometry.origin
            self._preview.edit(scene, spec, limit, preview_settings(depsgraph.scene), clean_from(group))
            self._problem, self._skipped = "", notes.lines()
        except BaseException as error:
            self._fail(error, "read the scene for the viewport")
        self._work(engine)

    def draw(self, engine: Any, context: Any) -> None:
        """Draw the newest picture."""
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
        preview.look(views.seen(context, self._origin, pixel))
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
        parts = [f"Sample {done} of {wanted}"]
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
        preview = self._preview
        engine = self._engine() if self._engine is not None else None
        if preview is None or engine is None:
            return False
        if preview.advance() or not preview.busy:
            engine.tag_redraw()
        return preview.busy

    def stop(self) -> None:
        """Request the end of the work for good."""
        if self._preview is not None:
            self._preview.stop()
        # After a failure, what was read may lack an edit.
        self._preview, self._remembered = None, Remembered()

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
        if self._preview is None or not self._preview.busy:
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


def preview_settings(scene: Any) -> RenderSettings:
    """The render settings of the viewport for this scene; the size is set per view."""
    return RenderSettings(
        width=1,
        height=1,
        samples=scene.halfspace.preview_samples,
        **quality.adaptive(scene.halfspace, "preview_"),
        **quality.settings(scene),
    )


def clean_from(group: Any) -> int:
    """The number of samples from which the viewport's noise is removed by the settings in `group`, 0 for none."""
    return max(group.preview_denoising_start_sample, 1) if group.use_preview_denoising else 0

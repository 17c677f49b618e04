# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: a picture that starts coarse while the view moves and refines while it rests."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from ..core import native
from ..core.notes import Notes
from ..core.scene import Camera
from ..core.session import Session
from ..core.settings import RenderSettings, memory_limit
from . import extract, properties
from .camera import window

MOVING_SCALE = 4
"""Pixels per ray along each side of the picture, while the view moves."""

WAIT_MILLISECONDS = 15

log = logging.getLogger(__name__)


class Viewport:
    """The state of one 3D view: a session rebuilt on edits, a job restarted on movement.

    Holds no engine, so that it goes, and stops its work, as soon as Blender lets the engine go.
    """

    def __init__(self) -> None:
        self._session: Session | None = None
        self._origin = np.zeros(3)
        self._settings = RenderSettings(width=1, height=1)
        self._view: tuple[Any, ...] | None = None
        self._camera: Camera | None = None
        self._job: Any = None
        self._scale = 1
        self._texture: Any = None

    def __del__(self) -> None:
        self.stop()

    def stop(self) -> None:
        """End what runs, within the native module's time limit."""
        if self._job is not None:
            self._job.cancel()
            self._job.wait(1000)
            self._job = None

    def update(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """Take over the scene after an edit."""
        self.stop()
        self._view = None
        try:
            group = context.scene.halfspace
            scene = extract.extract(depsgraph, Notes())
            self._session = Session.start(
                native.load(),
                scene,
                properties.spec(group),
                memory_limit=memory_limit(group.memory_limit),
                keep_going=lambda _progress: True,
            )
            self._origin = scene.geometry.origin
            self._settings = RenderSettings(
                width=1,
                height=1,
                samples=group.preview_samples,
                max_bounces=group.max_bounces,
                clamp_indirect=group.clamp_indirect,
                seed=group.render_seed,
            )
        except Exception as error:
            log.exception("Halfspace could not read the scene for the viewport")
            self._session = None
            engine.update_stats("Halfspace", str(error))

    def draw(self, engine: Any, context: Any) -> None:
        """Show the newest picture; ask for another redraw while there is more to come."""
        if self._session is None:
            return
        region, view = context.region, context.region_data
        key = (region.width, region.height, tuple(tuple(row) for row in view.perspective_matrix))
        if key != self._view:
            self._view = key
            self._camera = view_camera(view, self._origin, context.space_data)
            self._start(region, MOVING_SCALE)
        job = self._job
        finished = job.wait(WAIT_MILLISECONDS)
        if job.error is not None:
            engine.update_stats("Halfspace", job.error)
            return
        if job.samples_done:
            self._upload(region)
        self._show(engine, context.scene, region)
        if finished and self._scale > 1:
            self._start(region, 1)
            finished = False
        engine.update_stats("Halfspace", f"Sample {job.samples_done} of {self._settings.samples}")
        if not finished:
            engine.tag_redraw()

    def _start(self, region: Any, scale: int) -> None:
        self.stop()
        self._scale = scale
        coarse = scale > 1
        self._settings = replace(
            self._settings, width=max(region.width // scale, 1), height=max(region.height // scale, 1)
        )
        settings = replace(self._settings, samples=1) if coarse else self._settings
        self._job = self._session.render(self._camera, settings)  # type: ignore[union-attr, arg-type]

    def _upload(self, region: Any) -> None:
        width, height = self._settings.size
        pixels = np.empty(width * height * 4, np.float32)
        self._job.copy_into("Combined", pixels)
        self._texture = gpu.types.GPUTexture(
            (width, height), format="RGBA16F", data=gpu.types.Buffer("FLOAT", len(pixels), pixels)
        )

    def _show(self, engine: Any, scene: Any, region: Any) -> None:
        if self._texture is None:
            return
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, (0, 0), region.width, region.height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")


def view_camera(view: Any, origin: np.ndarray[Any, Any], space: Any) -> Camera:
    """What a 3D view shows, as a camera: works alike for perspective, parallel and camera views."""
    to_world = np.linalg.inv(np.array(view.view_matrix, np.float64))
    to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    to_world[:3, 3] -= origin
    projection = np.array(view.window_matrix, np.float64)
    parallel = projection[3, 3] == 1.0
    return Camera(
        kind="orthographic" if parallel else "perspective",
        to_world=to_world,
        window=window(projection),
        clip_start=-space.clip_end if parallel else space.clip_start,
        clip_end=space.clip_end,
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Previews of materials, worlds and lights: small pictures of scenes of Blender's own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...core.base import native
from ...core.base.notes import Notes
from ...core.session.session import Session, watch
from ..read import extract
from ..settings import properties
from . import cameras, running
from .requested import render_settings
from .result import Result, copy

SAMPLES = 32
"""Samples of a preview: its noise is invisible at the size of an icon."""

POLL_MILLISECONDS = 50
"""Interval of the checks whether the preview is still wanted."""


class Preview:
    """One preview, with its open render result. It leaves no structure, report or notes behind."""

    def __init__(self, engine: Any, depsgraph: Any) -> None:
        self.engine = engine
        self.depsgraph = depsgraph
        self.result: Result | None = None

    def render(self) -> None:
        """Extract, build, render. Raises Cancelled, and the exceptions of extraction and of the native module."""
        settings = replace(
            render_settings(self.engine, self.depsgraph),
            samples=SAMPLES,
            passes=("Combined",),
            noise_threshold=0.0,
            time_limit=0.0,
        )
        # A Sky Texture takes seconds in another Blender, so the preview shows the last one, or the sky's plain colour.
        found = extract.find(self.depsgraph, Notes(), sky=extract.LATER, keep_going=self._wanted)
        scene = found.flattened()
        spec = properties.spec(self.depsgraph.scene_eval.halfspace)
        session = Session.start(native.load(), scene, spec, threads=settings.threads, keep_going=self._tracing)
        view = cameras.active(self.engine, self.depsgraph, scene.geometry.origin, Notes())
        self.result = Result(self.engine, self.depsgraph, settings.size)
        job = session.render(view, settings)
        width, height = settings.size
        buffers = {"Combined": np.empty(width * height * 4, np.float32)}
        watch(job, milliseconds=POLL_MILLISECONDS, keep_going=self._tracing, show=lambda: None)
        copy(job, buffers, scene.geometry.origin)
        self.result.fill(buffers, 0)
        self.result.end()
        self.result = None

    def discard(self) -> None:
        """Close an open result without keeping its pixels."""
        if self.result is not None:
            self.result.end(cancel=True)
            self.result = None

    def _wanted(self) -> bool:
        return not running.closing() and not self.engine.test_break()

    def _tracing(self, _progress: float) -> bool:
        return self._wanted()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Building the chosen structure over the open scene without a render: on demand, or whenever the scene changes.

Extraction has to run on Blender's main thread; the build runs on its own thread, polled by a timer.
"""

from __future__ import annotations

import logging
import time
from typing import Any

import bpy

from ...core.base import native
from ...core.base.notes import Notes
from ...core.session.session import POLL_SECONDS, Session
from ...core.structures.settings import memory_limit
from .. import state
from ..read import extract
from ..settings import properties, signals
from ..state import SceneState
from . import trees
from .modal import Modal

REST_SECONDS = 0.4
"""Time without changes before a scene is rebuilt automatically, in seconds."""

WORK = "build the structure"
"""The operator's work, as its errors name it."""

log = logging.getLogger(__name__)


class Job:
    """One build for one scene, from its triangles to the kept tree."""

    def __init__(self, scene: Any, depsgraph: Any) -> None:
        """Read the scene and start the build. Raises the exceptions of extraction, and native.NativeError."""
        group = scene.halfspace
        module = native.load()
        self.spec = properties.spec(group)
        self.label = properties.structure(group).label
        self.notes = Notes()
        properties.remark_unknown(group, self.notes)
        self._read = trees.moment(scene)
        geometry = extract.extract(depsgraph, self.notes, sky=extract.NO_WORLD).geometry
        self._state = state.of(scene)
        self.triangles = len(geometry.triangles)
        self._session = Session(module, geometry, self.spec, memory_limit=memory_limit(group.memory_limit))

    @property
    def progress(self) -> float:
        """0 to 1."""
        return self._session.progress

    def step(self, seconds: float = 0.0) -> bool:
        """Wait at most `seconds`. Returns True once the build has ended and its tree is kept. Raises the build's
        exceptions.
        """
        if not self._session.wait(seconds):
            return False
        structure = self._session.structure
        scene = self._state.scene
        if scene is not None:  # None if the scene was deleted meanwhile
            trees.keep(scene, structure, self._session.geometry, spec=self.spec, label=self.label, read=self._read)
        return True

    def cancel(self) -> None:
        """Stop the build and drop its result."""
        self._session.cancel()


def build_now(scene: Any, depsgraph: Any) -> Job:
    """Build the chosen structure and wait for it. Raises the exceptions of extraction and build."""
    job = Job(scene, depsgraph)
    while not job.step(POLL_SECONDS):
        pass
    return job


class _Background:
    """The automatic build, at most one at a time, and the request for the next. wish: the state of its scene."""

    job: Job | None = None
    wish: SceneState | None = None
    wished_at = 0.0
    problem = ""


def request(scene: Any) -> None:
    """Schedule a rebuild of this scene's structure, if its overlay wants one, after REST_SECONDS; stops a running
    build.
    """
    overlay = scene.halfspace.overlay
    if overlay.show and overlay.auto_update:
        need(scene)


def need(scene: Any) -> None:
    """The same for what cannot do without a structure, whatever the overlay wants."""
    if native.problem() is not None or trees.usable(scene, properties.spec(scene.halfspace)) is not None:
        return
    _Background.problem = ""
    _Background.wish = state.of(scene)
    _Background.wished_at = time.monotonic()
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=REST_SECONDS)


def stop() -> None:
    """Stop the automatic build and its timer."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _Background.job is not None:
        _Background.job.cancel()
    _Background.job = _Background.wish = None
    _Background.problem = ""


def progress() -> float | None:
    """Progress of the automatic build, 0 to 1; None if none runs."""
    return None if _Background.job is None else _Background.job.progress


def problem() -> str:
    """The reason why the last automatic build failed, or ""."""
    return _Background.problem


def _tick() -> float | None:
    """The timer's callback. Returns the seconds until the next call, or None to end."""
    try:
        return _advance()
    except BaseException as error:
        # A timer cannot report to the user: the panel shows the message.
        _Background.problem = native.reason(error)
        log.error("Halfspace could not %s", WORK, exc_info=error)
        _Background.job = None
        trees.redraw()
        return None


def _advance() -> float | None:
    """Stop an outdated build, finish the running one, or start the requested one once the scene has rested."""
    job, wish = _Background.job, _Background.wish
    if job is not None and wish is not None:
        job.cancel()
        job = _Background.job = None
    if job is not None:
        if job.step():
            _Background.job = None
        trees.redraw()
    elif wish is not None:
        rest = _Background.wished_at + REST_SECONDS - time.monotonic()
        if rest > 0:
            return rest
        _Background.wish, _Background.problem = None, ""
        scene, view_layer = wish.scene, bpy.context.view_layer
        if scene is not None and scene == bpy.context.scene and view_layer is not None:
            _Background.job = Job(scene, bpy.context.evaluated_depsgraph_get())
    return POLL_SECONDS if _Background.job is not None or _Background.wish is not None else None


class HALFSPACE_OT_build_structure(Modal, bpy.types.Operator):
    """Builds the chosen structure over the scene as the viewport shows it."""

    bl_idname = "halfspace.build_structure"
    bl_label = "Build Structure"
    bl_description = "Build the chosen structure over the scene as the viewport shows it, for inspection. Esc stops"

    work, stopped = WORK, "Building was stopped"

    def _begin(self, context: Any) -> Job:
        return Job(context.scene, context.evaluated_depsgraph_get())

    def _done(self, work: Job) -> set[str]:
        for line in work.notes.lines():
            self.report({"WARNING"}, line)
        self.report({"INFO"}, f"{work.label} over {work.triangles:,} triangles")
        return {"FINISHED"}

    def _tell(self, context: Any) -> None:
        context.window_manager.progress_update(100 * self._work.progress)
        context.workspace.status_text_set(f"{self._work.label}: {self._work.progress:.0%}   Esc: stop")

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Build while Blender stays usable, in place of an automatic build."""
        stop()
        return Modal.invoke(self, context, event)


class HALFSPACE_OT_free_structure(bpy.types.Operator):
    """Frees the memory of the last structure."""

    bl_idname = "halfspace.free_structure"
    bl_label = "Free Structure"
    bl_description = "Free the memory of the last structure"

    def execute(self, context: Any) -> set[str]:
        trees.clear()
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_build_structure, HALFSPACE_OT_free_structure)

FOLLOWED = (signals.structure_changed, signals.visibility_changed)
"""Signals at which the structure is requested."""


def register() -> None:
    """Listen to the settings that decide what is built."""
    for signal in FOLLOWED:
        signal.connect(request)


def unregister() -> None:
    """Stop a running build, and undo `register`."""
    for signal in FOLLOWED:
        signal.disconnect(request)
    stop()

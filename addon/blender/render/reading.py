# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a 3D view on its way from Blender: read on the main thread a slice at a time, then placed on another."""

from __future__ import annotations

import itertools
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.base.background import Background
from ...core.base.equality import same
from ...core.base.notes import Notes
from ...core.scene.instances import InstancedGeometry
from ...core.scene.scene import Scene
from ...core.structures.settings import RenderSettings, memory_limit
from .. import state
from ..read import extract
from ..read.remembered import Remembered
from ..read.value_nodes.outputs import Wanted
from ..session.reports import KEPT
from ..settings import properties, quality

_EVALUATIONS = itertools.count(1)

_evaluation = 0
"""Number of the last evaluation of a depsgraph of views."""


class Edit:
    """One edit of a scene, with the settings at that time.

    `read` it in Blender's callbacks until that returns True, then `place` it, and ask for the `placed` scene. spec,
    limit, settings, clean_from: of `Preview.edit`. notes: on what is missing.
    """

    def __init__(self, depsgraph: Any, space: Any, remembered: Remembered) -> None:
        """Begin to read. space: the 3D view, or None. Raises the exceptions of extraction."""
        group = depsgraph.scene.halfspace
        self.notes = Notes()
        properties.remark_unknown(group, self.notes)  # first: the status line has room for one note
        quality.remark_unknown(group, self.notes)
        # Copy the settings, which may change meanwhile.
        self.spec, self.limit = properties.spec(group), memory_limit(group.memory_limit)
        self.settings, self.clean_from = preview_settings(depsgraph.scene), clean_from(group)
        self._instancing, self._integrator = quality.instancing(group), quality.integrator(group)
        self._top, self._state = quality.top(group), state.of(depsgraph.scene)
        self._placing: Background | None = None
        self._placed: list[Scene] = []
        self._two_level = False
        self._evaluated = depsgraph.as_pointer(), _evaluation
        self._reading = extract.Reading(depsgraph, self.notes, space=space, wanted=Wanted(remembered=remembered))

    @property
    def unread(self) -> bool:
        """Whether `read` has more to do."""
        return not self._reading.ended

    def outdated(self, depsgraph: Any) -> bool:
        """Whether what was not read is gone: the depsgraph is another one, or was evaluated again."""
        return self._evaluated != (depsgraph.as_pointer(), _evaluation)

    def read(self, seconds: float) -> bool:
        """Read for about this time, at least one step. Returns whether everything was read. Raises as extraction does.
        Only if not `outdated`.
        """
        # Blender permits to make what movies are read with only while it updates the view.
        if any(image.source == "MOVIE" for image in bpy.data.images):
            seconds = float("inf")
        return self._reading.advance(seconds)

    def close(self) -> None:
        """Break off."""
        self._reading.close()
        if self._placing is not None:
            self._placing.stop()

    def place(self, last: Scene | None) -> None:
        """Begin to make the scene of what was read, which is `last` itself if it is the same."""
        step = (self._made(last) for _ in range(1))
        self._placing = Background(step, self._placed.append)

    @property
    def ended(self) -> bool:
        """Whether the scene is there, or cannot be made."""
        return self._placing is not None and self._placing.wait(0)

    def placed(self, seconds: float = 0.0) -> Scene | None:
        """The scene, after waiting at most this time; None if it is not there yet. Raises as extraction does."""
        if self._placing is None or not self._placing.wait(seconds):
            return None
        if (scene := self._state.scene) is not None:  # None if the scene was deleted meanwhile
            KEPT.keep(scene, self._two_level)
        return self._placed[0]

    def _made(self, last: Scene | None) -> Scene:
        """The scene of what was read, with all that its comparisons need."""
        found = self._reading.found()
        layout = found.layout(self._instancing, integrator=self._integrator, interactive=True)
        self._two_level = layout.two_level
        scene = found.instanced(top=self._top) if layout.two_level else found.flattened()
        if isinstance(scene.geometry, InstancedGeometry):
            for mesh in scene.geometry.meshes:
                mesh.shape  # noqa: B018 (computed here, for the main thread)
        return last if last is not None and same(last, scene) else scene


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


@persistent
def _evaluated(_scene: Any = None, depsgraph: Any = None, *_: Any) -> None:
    """After an evaluation, an undo step or the loading of a file: what views have not read yet is gone."""
    global _evaluation  # noqa: PLW0603 (one counter for all views)
    if depsgraph is None or depsgraph.mode == "VIEWPORT":
        _evaluation = next(_EVALUATIONS)


def _watched() -> tuple[Any, ...]:
    """Blender's lists of handlers that are called after changes of evaluated data."""
    handlers = bpy.app.handlers
    return (
        *(handlers.depsgraph_update_post, handlers.frame_change_post),
        *(handlers.undo_post, handlers.redo_post, handlers.load_post),
    )


def register() -> None:
    """Listen to evaluations."""
    for handlers in _watched():
        handlers.append(_evaluated)


def unregister() -> None:
    """Undo `register`."""
    for handlers in _watched():
        handlers.remove(_evaluated)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that compare and choose structures, while Blender goes on or at once, and that write the report."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from ...core.base import native
from ...core.session.session import POLL_SECONDS
from ..session import trees
from ..settings import presets
from . import compare_files, comparing

STOP_SECONDS = 10.0
"""How long unregistering waits for the step that runs."""

log = logging.getLogger(__name__)


class _Modal:
    """An operator that works while Blender goes on. Esc stops it."""

    _work: comparing.Work | None = None
    _timer: Any = None
    _told = ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def _begin(self, scene: Any) -> comparing.Work:
        raise NotImplementedError

    def _use(self, scene: Any, found: comparing.Found) -> None:
        """What else follows when the result is there."""

    def _done(self, work: comparing.Work) -> set[str]:
        """Write the result into the file as a text of the scene that was measured, whichever is shown by now."""
        scene = trees.scene_of(work.scene_uid)
        if scene is None:
            self.report({"WARNING"}, "The scene that was measured is gone")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        found = comparing.last(scene)
        if found is not None:
            compare_files.keep_text(scene, found)
            self._use(scene, found)
        return {"FINISHED"}

    def execute(self, context: Any) -> set[str]:
        """Work and wait, for scripts."""
        try:
            work = self._begin(context.scene)
            while not work.step(POLL_SECONDS):
                pass
        except Exception as error:
            return self._failed(error)
        return self._done(work)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Work while Blender goes on."""
        try:
            self._work = self._begin(context.scene)
        except Exception as error:
            return self._failed(error)
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(2 * POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Look at the work on each tick of a timer; all but Esc passes through."""
        assert self._work is not None
        if event.type == "ESC":
            self._work.cancel()
            self._end(context)
            self.report({"INFO"}, "Measuring was stopped")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        now = comparing.progress()
        if now is None:  # stopped from outside: another file, or the add-on goes
            self._end(context)
            return {"CANCELLED"}
        try:
            ended = self._work.step(0.0)
        except Exception as error:
            self._end(context)
            return self._failed(error)
        if ended:
            self._end(context)
            return self._done(self._work)
        done, text = now
        context.window_manager.progress_update(100 * done)
        if text != self._told:
            self._told = text
            context.workspace.status_text_set(f"{done:.0%}  {text}   Esc: stop")
            trees.redraw_panels()
        return {"PASS_THROUGH"}  # an event does not tell whose timer it is of

    def cancel(self, context: Any) -> None:
        """Blender closes the window or the file."""
        if self._work is not None:
            self._work.cancel()

    def _end(self, context: Any) -> None:
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        trees.redraw_panels()

    def _failed(self, error: Exception) -> set[str]:
        log.error("Halfspace could not measure", exc_info=error)
        self.report({"ERROR"}, " ".join(str(error).split()) or type(error).__name__)  # type: ignore[attr-defined]
        return {"CANCELLED"}


class HALFSPACE_OT_compare(_Modal, bpy.types.Operator):
    """Compares what is ticked."""

    bl_idname = "halfspace.compare"
    bl_label = "Compare"
    bl_description = (
        "Build the chosen structure and all ticked ones over this scene, prove their answers and time their rays. "
        "Blender can be used meanwhile; Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, scene: Any) -> comparing.Work:
        return comparing.comparing(scene)


class HALFSPACE_OT_choose(_Modal, bpy.types.Operator):
    """Chooses a structure."""

    bl_idname = "halfspace.choose"
    bl_label = "Choose for Me"
    bl_description = (
        "Try structures on a part of the scene, the promising ones on all of it, and use what makes the picture "
        "soonest, build included. Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, scene: Any) -> comparing.Work:
        return comparing.choosing(scene)

    def _use(self, scene: Any, found: comparing.Found) -> None:
        if found.comparison.best is not None:
            presets.apply(scene.halfspace, found.comparison.best.spec)
            self.report({"INFO"}, " ".join(found.notes[:2]))


class HALFSPACE_OT_write_report(bpy.types.Operator):
    """Writes the report."""

    bl_idname = "halfspace.write_report"
    bl_label = "Write Report"
    bl_description = "Write the last comparison into a folder: report.html, bench.json and bench.csv"

    directory: StringProperty(name="Folder", subtype="DIR_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        found = comparing.last(context.scene) if context.scene is not None else None
        return found is not None and bool(found.rows)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the folder."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        found = comparing.last(context.scene)
        assert found is not None
        folder = Path(bpy.path.abspath(self.directory))
        try:
            compare_files.write_report(folder, found)
        except (*native.FAILURES, OSError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {folder / 'report.html'}")
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_compare, HALFSPACE_OT_choose, HALFSPACE_OT_write_report)


def register() -> None:
    """Register the operators."""
    for operator in CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    """Stop what runs, and the reverse of `register`."""
    comparing.stop(STOP_SECONDS)
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
    comparing.clear()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that compare and choose structures, modally or at once, and that write the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from ...core.base import native
from ...core.session.session import POLL_SECONDS
from ..session import failures, trees
from ..settings import presets
from . import compare_files, comparing

STOP_SECONDS = 10.0
"""Time limit for the running step when the add-on is unregistered, in seconds."""


class _Modal:
    """An operator that works while Blender stays usable. Esc stops it."""

    _work: comparing.Work | None = None
    _timer: Any = None
    _told = ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def _begin(self, scene: Any) -> comparing.Work:
        raise NotImplementedError

    def _use(self, scene: Any, found: comparing.Found) -> None:
        """Apply the result, where the operator does more than to store it."""

    def _done(self, work: comparing.Work) -> set[str]:
        """Store the result as a text block of the measured scene, whichever scene is visible by now."""
        scene = work.state.scene
        if scene is None:
            self.report({"WARNING"}, "The measured scene was deleted")  # type: ignore[attr-defined]
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
        except BaseException as error:
            return failures.reported(self, error, "measure")
        return self._done(work)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Work while Blender stays usable."""
        try:
            self._work = self._begin(context.scene)
        except BaseException as error:
            return failures.reported(self, error, "measure")
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(2 * POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Advance the work on each timer event; all events but Esc pass through."""
        assert self._work is not None
        if event.type == "ESC":
            self._work.cancel()
            self._end(context)
            self.report({"INFO"}, "Measuring was stopped")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        now = comparing.progress()
        if now is None:  # stopped from outside: another file was loaded, or the add-on was disabled
            self._end(context)
            return {"CANCELLED"}
        try:
            ended = self._work.step(0.0)
        except BaseException as error:
            self._end(context)
            return failures.reported(self, error, "measure")
        if ended:
            self._end(context)
            return self._done(self._work)
        done, text = now
        context.window_manager.progress_update(100 * done)
        if text != self._told:
            self._told = text
            context.workspace.status_text_set(f"{done:.0%}  {text}   Esc: stop")
            trees.redraw_panels()
        return {"PASS_THROUGH"}  # events do not identify their timer

    def cancel(self, context: Any) -> None:
        """Stop when Blender closes the window or the file."""
        if self._work is not None:
            self._work.cancel()

    def _end(self, context: Any) -> None:
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        trees.redraw_panels()


class HALFSPACE_OT_compare(_Modal, bpy.types.Operator):
    """Compares the ticked structures."""

    bl_idname = "halfspace.compare"
    bl_label = "Compare"
    bl_description = (
        "Build the chosen structure and all ticked ones over this scene, check their answers and time their rays. "
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
        "Try structures on a part of the scene, the best of them on all of it, and use the one with the shortest "
        "predicted time for the picture, build included. Esc stops"
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
        """Open the folder selector."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        found = comparing.last(context.scene)
        assert found is not None
        folder = Path(bpy.path.abspath(self.directory))
        try:
            compare_files.write_report(folder, found)
        except BaseException as error:
            return failures.reported(self, error)
        self.report({"INFO"}, f"Wrote {folder / 'report.html'}")
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_compare, HALFSPACE_OT_choose, HALFSPACE_OT_write_report)


def unregister() -> None:
    """Stop running work."""
    comparing.stop(STOP_SECONDS)

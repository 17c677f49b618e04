# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that compare and choose structures, modally or at once, and that write the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from ...core.session.session import POLL_SECONDS
from ..session import failures, trees
from ..session.modal import Modal
from ..settings import presets
from . import compare_files, comparing

STOP_SECONDS = 10.0
"""Time limit for the running step when the add-on is unregistered, in seconds."""


class _Measuring(Modal):
    """An operator that measures the scene."""

    work, stopped, seconds = "measure", "Measuring was stopped", 2 * POLL_SECONDS

    _told = ""

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

    def _gone(self) -> bool:
        """Whether another file was loaded, or the add-on disabled."""
        return comparing.progress() is None

    def _tell(self, context: Any) -> None:
        if (now := comparing.progress()) is None:
            return
        done, text = now
        context.window_manager.progress_update(100 * done)
        if text != self._told:
            self._told = text
            context.workspace.status_text_set(f"{done:.0%}  {text}   Esc: stop")
            trees.redraw_panels()


class HALFSPACE_OT_compare(_Measuring, bpy.types.Operator):
    """Compares the ticked structures."""

    bl_idname = "halfspace.compare"
    bl_label = "Compare"
    bl_description = (
        "Build the chosen structure and all ticked ones over this scene, check their answers and time their rays. "
        "Blender can be used meanwhile; Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, context: Any) -> comparing.Work:
        return comparing.comparing(context.scene)


class HALFSPACE_OT_choose(_Measuring, bpy.types.Operator):
    """Chooses a structure."""

    bl_idname = "halfspace.choose"
    bl_label = "Choose for Me"
    bl_description = (
        "Try structures on a part of the scene, the best of them on all of it, and use the one with the shortest "
        "predicted time for the picture, build included. Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, context: Any) -> comparing.Work:
        return comparing.choosing(context.scene)

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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that work while Blender stays usable, or at once where a script calls them."""

from __future__ import annotations

from typing import Any

from ...core.base import native
from ...core.session.session import POLL_SECONDS
from . import failures, trees


class Modal:
    """An operator whose work has `step(seconds)`, which returns whether it has ended, and `cancel()`. Esc stops it."""

    work = ""
    """Its work, as in "could not `work`", for its errors."""
    stopped = ""
    """Its report after Esc."""
    seconds = POLL_SECONDS
    """Time between two steps."""

    _work: Any = None
    _timer: Any = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def _begin(self, context: Any) -> Any:
        """Begin the work. Raises what it raises."""
        raise NotImplementedError

    def _done(self, work: Any) -> set[str]:
        """Store or report the result. Returns that of the operator."""
        raise NotImplementedError

    def _gone(self) -> bool:
        """Whether the work was stopped from outside."""
        return False

    def _tell(self, context: Any) -> None:
        """Show how far the work is."""

    def execute(self, context: Any) -> set[str]:
        """Work and wait, for scripts."""
        try:
            work = self._begin(context)
            while not work.step(POLL_SECONDS):
                pass
        except BaseException as error:
            return failures.reported(self, error, self.work)
        return self._done(work)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Work while Blender stays usable."""
        try:
            self._work = self._begin(context)
        except BaseException as error:
            return failures.reported(self, error, self.work)
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(self.seconds, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Advance the work on each timer event; all events but Esc pass through."""
        assert self._work is not None
        if event.type == "ESC":
            self._work.cancel()
            self._end(context)
            self.report({"INFO"}, self.stopped)  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._gone():
            self._end(context)
            return {"CANCELLED"}
        try:
            ended = self._work.step(0.0)
        except BaseException as error:
            self._end(context)
            return failures.reported(self, error, self.work)
        if ended:
            self._end(context)
            return self._done(self._work)
        self._tell(context)
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

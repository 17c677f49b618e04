# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of one scene that are built one after another while a view is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.background import Background
from .session import Building, Session

if TYPE_CHECKING:
    from ..base.interface import Native
    from ..scene.scene import Scene
    from .stock import Stock


@dataclass(frozen=True, eq=False)
class Ready:
    """A traceable scene. building: kept so that its structure lives and can be shared."""

    edit: int
    session: Session
    building: Building


class Preparing:
    """Builds one structure after another over one scene, and makes each available to the renderer when it is done."""

    def __init__(
        self, native: Native, stock: Stock, scene: Scene, specs: list[str], limit: int | None, edit: int
    ) -> None:
        self.ended = False
        self.shown = False
        """Whether the first structure is ready."""
        self._native, self._stock, self._scene, self._limit, self._edit = native, stock, scene, limit, edit
        self._specs = specs
        self._joining: Background | None = None
        self._sessions: list[Session] = []
        self._building = self._begin()

    def _begin(self) -> Building:
        return self._stock.take(self._native, self._scene.geometry, self._specs[0], memory_limit=self._limit)

    @property
    def progress(self) -> tuple[str, float]:
        """The configuration that is being built, and its progress, 0 to 1."""
        return self._specs[0], self._building.progress

    def advance(self) -> Ready | None:
        """The scene that became ready since the last call, or None. Raises the native module's exceptions."""
        if self._joining is None:
            if not self._building.wait(0):
                return None
            structure, sessions = self._building.result(), self._sessions
            native, scene = self._native, self._scene
            # Prepare the scene on another thread, as an iterator of one step.
            self._joining = Background((Session.over(native, scene, structure) for _ in range(1)), sessions.append)
        if not self._joining.wait(0):
            return None
        ready = Ready(self._edit, self._sessions.pop(), self._building)
        self._joining = None
        self._specs = self._specs[1:]
        self.shown, self.ended = True, not self._specs
        if self._specs:
            self._building = self._begin()
        return ready

# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of one scene that are built one after another while a view is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.background import Background
from .session import render_scene

if TYPE_CHECKING:
    from ..base.interface import Native, RenderScene
    from ..scene.scene import Scene
    from .session import Session, Shown
    from .stock import Stock


@dataclass(frozen=True, eq=False)
class Ready:
    """A traceable scene, in both forms. session: kept so that its structure lives and can be shared with views of other
    scenes.
    """

    edit: int
    session: Session
    scene: RenderScene
    of: Scene


class Preparing:
    """Builds one structure after another over one scene, and makes each available to the renderer when it is done."""

    def __init__(
        self,
        native: Native,
        stock: Stock,
        scene: Scene,
        specs: list[str],
        limit: int | None,
        edit: int,
        last: Ready | None = None,
    ) -> None:
        """last: the scene before this edit, which shares with it what does not differ."""
        self.wanted = (specs[-1], limit)
        """The last structure, and the memory limit of all."""
        self.ended = False
        self.shown = False
        """Whether the first structure is ready."""
        self._native, self._stock, self._scene, self._limit, self._edit = native, stock, scene, limit, edit
        self._specs = specs
        alike = last is not None and type(last.of.geometry) is type(scene.geometry)
        self._first: Shown | None = (last.of, last.scene) if last is not None and alike else None
        self._joining: Background | None = None
        self._scenes: list[RenderScene] = []
        self._session = self._begin()

    def _begin(self) -> Session:
        return self._stock.take(self._native, self._scene.geometry, self._specs[0], memory_limit=self._limit)

    @property
    def progress(self) -> tuple[str, float]:
        """The configuration that is being built, and its progress, 0 to 1."""
        return self._specs[0], self._session.progress

    def advance(self) -> Ready | None:
        """The scene that became ready since the last call, or None. Raises the native module's exceptions."""
        if self._joining is None:
            if not self._session.wait(0):
                return None
            native, structure, scene, first = self._native, self._session.structure, self._scene, self._first
            # Prepare the scene on another thread, as an iterator of one step.
            step = (render_scene(native, structure, scene, first) for _ in range(1))
            self._joining = Background(step, self._scenes.append)
        if not self._joining.wait(0):
            return None
        ready = Ready(self._edit, self._session, self._scenes.pop(), self._scene)
        self._first = (ready.of, ready.scene)
        self._joining = None
        self._specs = self._specs[1:]
        self.shown, self.ended = True, not self._specs
        if self._specs:
            self._session = self._begin()
        return ready

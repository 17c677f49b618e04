# SPDX-License-Identifier: GPL-3.0-or-later
"""One state per scene: everything that the extension keeps of an open scene. Never saved."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import bpy
from bpy.app.handlers import persistent

from .settings import signals

T = TypeVar("T")

MOMENTS = itertools.count(1)
"""The numbers of moments: unique, so that data from before the deletion of a scene is outdated after its undo."""


@dataclass(eq=False)
class SceneState:
    """The state of the scene with this `session_uid`.

    moment: number of the last change that moved triangles. frame: the frame of that change, or of the last reading.
    values: by their slots.
    """

    uid: int
    moment: int = field(default_factory=MOMENTS.__next__)
    frame: float | None = None
    values: dict[Slot[Any], Any] = field(default_factory=dict)

    @property
    def scene(self) -> Any:
        """Blender's scene; None once it was deleted."""
        return next((scene for scene in bpy.data.scenes if scene.session_uid == self.uid), None)


_states: dict[int, SceneState] = {}
"""By `session_uid`."""

_LOCK = threading.Lock()
"""Held while a value takes the place of those of all scenes."""


def of(scene: Any) -> SceneState:
    """The state of a scene, original or evaluated, from any thread."""
    uid = scene.original.session_uid
    return _states.get(uid) or _states.setdefault(uid, SceneState(uid))


class Slot(Generic[T]):
    """A field of each scene's state, of type T. The room that fills it declares it: this one knows no type of later
    rooms.
    """

    def of(self, scene: Any) -> T | None:
        """The value of a scene, or None."""
        return of(scene).values.get(self)

    def keep(self, scene: Any, value: T | None) -> None:
        """Replace the value of a scene; None frees it."""
        of(scene).values[self] = value

    def all(self) -> list[T]:
        """The values of all scenes."""
        found = [one.values.get(self) for one in [*_states.values()]]
        return [value for value in found if value is not None]

    def keep_only(self, scene: Any, value: T) -> None:
        """Replace the values of all scenes by one of this scene. From any thread."""
        with _LOCK:
            mine = of(scene)
            mine.values[self] = value
            for one in [*_states.values()]:
                if one is not mine:
                    one.values.pop(self, None)

    def free(self) -> None:
        """Free the values of all scenes."""
        for one in [*_states.values()]:
            one.values.pop(self, None)


def drop(kept: Iterable[Any] = ()) -> None:
    """Drop the states of all scenes but these."""
    for uid in {*_states} - {scene.session_uid for scene in kept}:
        _states.pop(uid).values.clear()  # at once: values may refer to their state


@persistent
def _file_loaded(*_: Any) -> None:
    """After another file was loaded: drop the scenes of the old one, then begin with the new one."""
    drop()
    signals.file_loaded.fire(bpy.context.scene)


def register() -> None:
    """Register the handler of loaded files."""
    bpy.app.handlers.load_post.append(_file_loaded)


def unregister() -> None:
    """Undo `register`, and drop all states."""
    bpy.app.handlers.load_post.remove(_file_loaded)
    drop()

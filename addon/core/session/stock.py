# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared structures that are in use, so that equal ones are built only once.

Users are the four regions of a quad view, a final render at the same time, and the next frame of an animation in which
only the camera moves.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Unpack

from ..base.equality import same
from ..scene.instances import InstancedGeometry
from .refits import FOLLOWED, Followed
from .session import Session

if TYPE_CHECKING:
    from ..base.interface import BuildOptions, Native
    from ..scene.instances import AnyGeometry


class Stock:
    """Weak references to all live builds: deleting the last user's reference frees or cancels a build."""

    def __init__(self, followed: Followed | None = None) -> None:
        """followed: structures that are fitted where only vertices moved; None = those of this stock."""
        self._followed = Followed() if followed is None else followed
        self._sessions: weakref.WeakSet[Session] = weakref.WeakSet()

    def find(self, geometry: AnyGeometry, spec: str, memory_limit: int | None = None) -> Session | None:
        """A running or finished build of `spec` over exactly these triangles, or None."""
        for session in tuple(self._sessions):
            alike = session.spec == spec and session.memory_limit == memory_limit and session.usable
            if alike and _same_triangles(session.geometry, geometry):
                return session
        return None

    def take(self, native: Native, geometry: AnyGeometry, spec: str, **options: Unpack[BuildOptions]) -> Session:
        """The build that `find` returns, or a new one, which is started. options: of `Session`."""
        session = self.find(geometry, spec, options.get("memory_limit"))
        if session is None:
            session = Session(native, geometry, spec, followed=self._followed, **options)
            self._sessions.add(session)
        return session


def _same_triangles(old: AnyGeometry, new: AnyGeometry) -> bool:
    if isinstance(old, InstancedGeometry):
        return isinstance(new, InstancedGeometry) and old.same_triangles(new)
    if isinstance(new, InstancedGeometry):
        return False
    return same(old.triangles, new.triangles) and same(old.vertices, new.vertices)


STOCK = Stock(FOLLOWED)
"""Blender's stock. Answers depend on the triangles alone, built or fitted, so all users can share a tree."""

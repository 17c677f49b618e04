# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that somebody uses now, so that whoever needs the same one takes it.

That is four quads of a view, a final render beside it, the next frame of an animation in which only the camera moves.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Unpack

from ..base.equality import same
from ..scene.instances import InstancedGeometry
from .session import Building

if TYPE_CHECKING:
    from ..base.interface import BuildOptions, Native
    from ..scene.instances import AnyGeometry


class Stock:
    """Knows the builds that are alive, and keeps none: the last user who forgets one frees or stops it."""

    def __init__(self) -> None:
        self._buildings: weakref.WeakSet[Building] = weakref.WeakSet()

    def find(self, geometry: AnyGeometry, spec: str, memory_limit: int | None = None) -> Building | None:
        """A build of `spec` over just these triangles, whether it has ended or not."""
        for building in tuple(self._buildings):
            alike = building.spec == spec and building.memory_limit == memory_limit and building.usable
            if alike and _same_triangles(building.geometry, geometry):
                return building
        return None

    def take(self, native: Native, geometry: AnyGeometry, spec: str, **options: Unpack[BuildOptions]) -> Building:
        """The same, begun now if there is none."""
        building = self.find(geometry, spec, options.get("memory_limit"))
        if building is None:
            building = Building(native, geometry, spec, **options)
            self._buildings.add(building)
        return building


def _same_triangles(old: AnyGeometry, new: AnyGeometry) -> bool:
    if isinstance(old, InstancedGeometry):
        return isinstance(new, InstancedGeometry) and old.same_triangles(new)
    if isinstance(new, InstancedGeometry):
        return False
    return same(old.triangles, new.triangles) and same(old.vertices, new.vertices)


STOCK = Stock()
"""Blender's. A tree depends on its triangles and its spec alone, so it does not matter who asked first."""

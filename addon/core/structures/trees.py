# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of meshes, kept from one picture to the next: only what changed is built again."""

from __future__ import annotations

import threading
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..base.interface import Structure
    from ..scene.instances import InstancedGeometry, Mesh


class Trees:
    """Knows the native structures of meshes that somebody uses now, by what the meshes contain, and keeps none.

    So it does not matter how an edit, a frame change or an undo made a mesh what it is; and two objects with copies of
    one mesh share a tree. Any thread may ask.
    """

    def __init__(self) -> None:
        self._known: weakref.WeakValueDictionary[tuple[bytes, str], Structure] = weakref.WeakValueDictionary()
        self._lock = threading.Lock()

    def of(
        self, geometry: InstancedGeometry, spec: str, build: Callable[[Mesh, float, float], Structure]
    ) -> tuple[list[Structure], int]:
        """The structure of each mesh, to be held on to, and how many of them were not known.

        build: makes the structure of a mesh; it is also told which share of the work was done before, and which is its
        own, both 0 to 1.
        """
        keys = [(mesh.shape, spec) for mesh in geometry.meshes]
        with self._lock:
            found = {key: self._known.get(key) for key in keys}
        missing = {key: mesh for key, mesh in zip(keys, geometry.meshes, strict=True) if found[key] is None}
        total = sum(len(mesh.triangles) for mesh in missing.values()) or 1
        done = 0
        for key, mesh in missing.items():
            count = len(mesh.triangles)
            found[key] = build(mesh, done / total, count / total)
            done += count
        known = {key: structure for key, structure in found.items() if structure is not None}
        with self._lock:
            self._known.update(known)
        return [known[key] for key in keys], len(missing)


TREES = Trees()
"""Blender's. A tree depends on its triangles and its spec alone, so it does not matter who asked first."""

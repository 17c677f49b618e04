# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of meshes, shared between pictures, so that only changed meshes are built again."""

from __future__ import annotations

import threading
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..base.interface import Structure
    from ..scene.instances import InstancedGeometry, Mesh


class InUse:
    """Weak references to the newest structures in use, by a digest of their triangles and by configuration.
    Thread-safe.
    """

    def __init__(self) -> None:
        self._known: weakref.WeakValueDictionary[tuple[bytes, str], Structure] = weakref.WeakValueDictionary()
        self._lock = threading.Lock()

    def find(self, shape: bytes, spec: str) -> Structure | None:
        """The structure in use of this configuration over triangles with this digest, or None."""
        with self._lock:
            return self._known.get((shape, spec))

    def keep(self, shape: bytes, spec: str, structure: Structure) -> None:
        """Remember a structure while it is in use."""
        with self._lock:
            self._known[shape, spec] = structure


class Trees(InUse):
    """The structures of meshes in use, by the meshes' content.

    A structure is thus reused however an edit, a frame change or an undo restored its mesh, and copies of one mesh
    share a structure.
    """

    def of(
        self, geometry: InstancedGeometry, spec: str, build: Callable[[Mesh, float, float], Structure]
    ) -> tuple[list[Structure], int]:
        """The structure of each mesh, which the caller must keep, and the number of those that were built.

        build: builds the structure of a mesh; its other arguments are the share of the missing structures' triangles
        before this mesh, and that of this mesh, both 0 to 1.
        """
        # Look up the structures in use, and build the others.
        keys = [(mesh.shape, spec) for mesh in geometry.meshes]
        found = {key: self.find(*key) for key in keys}
        missing = {key: mesh for key, mesh in zip(keys, geometry.meshes, strict=True) if found[key] is None}
        total = sum(len(mesh.triangles) for mesh in missing.values()) or 1
        done = 0
        for key, mesh in missing.items():
            count = len(mesh.triangles)
            found[key] = structure = build(mesh, done / total, count / total)
            self.keep(*key, structure)
            done += count
        known = {key: structure for key, structure in found.items() if structure is not None}
        return [known[key] for key in keys], len(missing)


TREES = Trees()
"""Blender's cache. A tree depends only on its triangles and its spec, so all users can share it."""

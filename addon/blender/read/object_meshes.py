# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of objects, each read once for all its instances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ...core.base import native
from ...core.scene.scene import SceneError
from . import layers as texture_layers
from .meshes import FEWER, MeshArrays, read_mesh
from .value_nodes import STRAND

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from .object_values import Instance
    from .standing import Standing
    from .values import Layers

MESH_TYPES = {"MESH"}

Key = tuple[str, int]
""""mesh" with the data block, or "object" with the object whose mesh Blender makes for the occasion; by address."""


class ObjectMeshes:
    """Reads meshes during one pass over the depsgraph's instances."""

    def __init__(self, notes: Notes, layers: Layers, standing: Standing, *, uvs: bool) -> None:
        """layers: of all materials, complete. uvs: whether the active UV map is needed."""
        self._notes, self._layers, self._standing, self._uvs = notes, layers, standing, uvs
        self._known: dict[Key, MeshArrays] = {}
        self._unreadable: set[texture_layers.Key] = set()
        self._widths: dict[texture_layers.Key, int] = {}
        self._triangles = 0

    def of(self, instance: Instance) -> tuple[Key, MeshArrays | None]:
        """The key and the arrays of an instance's mesh; None if its object has no mesh. Raises SceneError."""
        item = instance.item
        # In edit mode the evaluated mesh is a wrapper without attributes.
        if item.type in MESH_TYPES and not item.data.is_editmode:
            key = ("mesh", item.data.as_pointer())
            if key not in self._known:
                self._read(key, instance, item.data)
            self._triangles += len(self._known[key].triangles)  # other meshes may be dropped at the end
            return key, self._known[key]
        key = ("object", item.original.as_pointer())
        if key not in self._known:
            # Edited meshes and other types provide a temporary mesh, which `to_mesh_clear` frees.
            mesh = item.to_mesh()
            if mesh is None:
                return key, None
            self._read(key, instance, mesh)
            item.to_mesh_clear()
        return key, self._known[key]

    def note_layers(self, readers: Mapping[texture_layers.Key, Iterable[str]], more: set[texture_layers.Key]) -> None:
        """Note layers that no mesh has. readers: materials that read each. more: layers of other shapes."""
        there = self._unreadable.union(more, *(mesh.layers for mesh in self._known.values()))
        for key, names in readers.items():
            kind, layer = key
            if key in there or not layer or kind == STRAND:
                continue
            for name in names:
                what = "attribute" if kind == texture_layers.COLOR else "UV map"
                self._notes.add(f"No mesh has the {what} {layer!r}, it is 0 everywhere, in material", name)

    def _read(self, key: Key, instance: Instance, mesh: Any) -> None:
        """Read a mesh with the layers that materials read, or take that of the frame if its shape stands still."""
        item, keys = instance.item, self._layers.keys

        def read() -> MeshArrays:
            self._check_room(mesh)
            for one in keys:
                if reason := texture_layers.unreadable(mesh, one):
                    self._unreadable.add(one)
                    text = f"The attribute {one[1]!r} is black, its {reason} is not supported yet"
                    self._notes.add(text, item.name_full)
            found = read_mesh(mesh, uvs=self._uvs, layers=keys)
            if found.lost:
                text = "Custom normals that are not finite are replaced by those of the faces"
                self._notes.add(text, item.name_full)
            return found

        self._known[key] = self._standing.shape(item, instance.parent, item.data, read)

    def _check_room(self, mesh: Any) -> None:
        """Raise SceneError if a mesh's layers, plus all layers over the triangles of all instances so far, do not fit
        into memory.
        """
        found = texture_layers.widths(mesh, self._layers.keys)
        for key, numbers in found.items():
            self._widths[key] = max(numbers, self._widths.get(key, 0))
        if not found:
            return
        own = len(mesh.loop_triangles)
        triangles = self._triangles + own
        size = 12 * (sum(found.values()) * own + sum(self._widths.values()) * triangles)
        if size > native.load().free_memory():
            raise SceneError(
                f"What materials read of {triangles:,} triangles or more, {size / 2**30:.1f} GiB, does not fit; {FEWER}"
            )

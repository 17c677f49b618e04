# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of objects, each read once for all its instances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ...core.base import native
from ...core.base.steps import Steps, completed
from ...core.scene.scene import SceneError
from . import layers as texture_layers
from .meshes import FEWER, MeshArrays, read_mesh
from .value_nodes import STRAND

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from .object_values import Instance
    from .remembered import Remembered
    from .standing import Standing
    from .values import Layers

MESH_TYPES = {"MESH"}

Key = tuple[str, int]
""""mesh" with the data block, or "object" with the object whose mesh Blender makes for the occasion; by address."""

_Read = tuple[MeshArrays, dict[texture_layers.Key, str]]
"""A mesh, and the reasons why layers of it cannot be read."""


class ObjectMeshes:
    """Reads meshes during one pass over the depsgraph's instances."""

    def __init__(self, notes: Notes, layers: Layers, standing: Standing, remembered: Remembered, *, uvs: bool) -> None:
        """layers: of all materials, complete. uvs: whether the active UV map is needed."""
        self._notes, self._layers, self._standing, self._uvs = notes, layers, standing, uvs
        self._remembered = remembered
        self._known: dict[Key, MeshArrays] = {}
        self._unreadable: set[texture_layers.Key] = set()

    def of(self, instance: Instance) -> Steps[tuple[Key, MeshArrays | None]]:
        """The key and the arrays of an instance's mesh; None if its object has no mesh. Raises SceneError."""
        item = instance.item
        # In edit mode the evaluated mesh is a wrapper without attributes.
        if item.type in MESH_TYPES and not item.data.is_editmode:
            key = ("mesh", item.data.as_pointer())
            if key not in self._known:
                read = yield from self._remembered.of(key, instance, lambda: self._read(instance, item.data))
                self._know(key, instance, read)
            return key, self._known[key]
        key = ("object", item.original.as_pointer())
        if key not in self._known:
            made = yield from self._remembered.of(key, instance, lambda: self._make(instance))
            if made is None:
                return key, None
            self._know(key, instance, made)
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

    def _make(self, instance: Instance) -> Steps[_Read | None]:
        """Read the temporary mesh that an edited mesh or another type provides; None if there is none."""
        mesh = instance.item.to_mesh()
        if mesh is None:
            return None
        # Do not pause here: Blender frees this mesh when it makes the object's mesh again.
        found = completed(self._read(instance, mesh))
        instance.item.to_mesh_clear()
        yield
        return found

    def _read(self, instance: Instance, mesh: Any) -> Steps[_Read]:
        """Read a mesh with the layers that materials read, or take that of the frame if its shape stands still."""
        keys = self._layers.keys

        def read() -> Steps[_Read]:
            self._check_room(mesh)
            black = {key: reason for key in keys if (reason := texture_layers.unreadable(mesh, key))}
            return (yield from read_mesh(mesh, uvs=self._uvs, layers=keys)), black

        return self._standing.shape(instance.item, instance.parent, instance.item.data, read)

    def _know(self, key: Key, instance: Instance, read: _Read) -> None:
        """Use a mesh that was read, and note what it lacks."""
        self._known[key], black = read
        name = instance.item.name_full
        for one, reason in black.items():
            self._unreadable.add(one)
            self._notes.add(f"The attribute {one[1]!r} is black, its {reason} is not supported yet", name)
        if self._known[key].lost:
            self._notes.add("Custom normals that are not finite are replaced by those of the faces", name)

    def _check_room(self, mesh: Any) -> None:
        """Raise SceneError if a mesh's layers do not fit into memory."""
        triangles = len(mesh.loop_triangles)
        size = 12 * sum(texture_layers.widths(mesh, self._layers.keys).values()) * triangles
        if size > native.load().free_memory():
            raise SceneError(
                f"What materials read of {triangles:,} triangles, {size / 2**30:.1f} GiB, does not fit; {FEWER}"
            )

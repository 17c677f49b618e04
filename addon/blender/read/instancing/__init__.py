# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that an instance has from its instancer: of particles, texture coordinates, attributes of instances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..object_values import INSTANCER, MASK, PARTICLE, PLACE, Key, Value, as_value, found, hashed

END = 0x7FFFFFFF
"""Marks the unused entries of Blender's identifiers of instances."""

FIELDS = {"BOOLEAN": "value", "INT": "value", "INT8": "value", "FLOAT": "value", "FLOAT_VECTOR": "vector"} | {
    "FLOAT2": "vector",
    "FLOAT_COLOR": "color",
    "BYTE_COLOR": "color",
}
"""The readable types of attributes, with the name of their field."""


class Instancing:
    """Reads values of instances during one pass over a depsgraph."""

    def __init__(self, depsgraph: Any, keys: Sequence[Key]) -> None:
        """keys: the values that materials read, complete."""
        self._keys = [key for key in keys if key[0] in (PARTICLE, PLACE, INSTANCER)]
        scene = depsgraph.scene_eval
        self._frame = scene.frame_current + scene.frame_subframe
        self._depsgraph = depsgraph
        self._levels: dict[int, _Level] = {}
        self._members: dict[int, list[Any]] = {}

    def of(self, instance: Any) -> Mapping[Key, Value]:
        """The values of an instance of the depsgraph; those that it does not have are missing."""
        if not self._keys or not instance.is_instance:
            return {}
        values = {key: self._value(instance, *key) for key in self._keys}
        return {key: value for key, value in values.items() if value is not None}

    def _value(self, instance: Any, kind: str, name: str) -> Value | None:
        if kind == PLACE:
            return _place(instance, name)
        if kind == PARTICLE:
            return self._particle(instance, name)
        system = instance.particle_system
        value = None if system is None else found([system.settings], name)
        return self._attribute(instance, name) if value is None else value

    def _particle(self, instance: Any, name: str) -> Value | None:
        """A value of the particle at whose place the instance is; None for those of child particles."""
        system, number = instance.particle_system, instance.persistent_id[0]
        if system is None or not 0 <= number < len(system.particles):
            return None
        particle = system.particles[number]
        match name:
            case "Index":
                return as_value(number)
            case "Random":
                return as_value(hashed(number) / MASK)
            case "Age":
                return as_value(self._frame - particle.birth_time)
            case _:
                return as_value(getattr(particle, name.lower().replace(" ", "_")))

    def _attribute(self, instance: Any, name: str) -> Value | None:
        """An attribute of the instances that geometry nodes made: of the innermost ones that have it."""
        # Blender lists the numbers of nested instances from the inside out.
        numbers = [number for number in instance.persistent_id if number != END]
        parent = instance.parent
        # A collection is instanced by an empty, which has no geometry; one of its objects may have instances.
        while parent is not None and parent.type == "EMPTY":
            parent = self._member(parent, numbers.pop()) if numbers else None
        read = getattr(parent, "evaluated_geometry", None)  # since Blender 5.0
        if read is None or instance.particle_system is not None:
            return None
        key = parent.original.as_pointer()
        if key not in self._levels:
            self._levels[key] = _Level(read())
        value, level = None, self._levels[key]
        for number in reversed(numbers):
            row = level.row(number)
            value = level.value(name, row) or value
            inner = level.inner(row)
            if inner is None:
                break
            level = inner
        return value

    def _member(self, empty: Any, number: int) -> Any | None:
        """The evaluated object with this number among those of the collection that an empty shows."""
        group = empty.instance_collection
        if group is None:
            return None
        # Numbers count all of them, also those that are hidden.
        key = group.as_pointer()
        if key not in self._members:
            self._members[key] = list(group.all_objects)
        items = self._members[key]
        return items[number].evaluated_get(self._depsgraph) if 0 <= number < len(items) else None


class _Level:
    """Instances of one geometry, which may be instances of geometries themselves."""

    def __init__(self, geometry: Any) -> None:
        self._geometry = geometry  # its points belong to it
        self._points = geometry.instances_pointcloud()
        attributes = {} if self._points is None else self._points.attributes
        numbers, self._references = attributes.get("id"), attributes.get(".reference_index")
        self._rows = None if numbers is None else {item.value: row for row, item in enumerate(numbers.data)}
        self._inner: dict[int, _Level] = {}

    def row(self, number: int) -> int:
        """The row of an instance by its own number, or else by its position."""
        return number if self._rows is None else self._rows.get(number, -1)

    def value(self, name: str, row: int) -> Value | None:
        """An attribute of the instance in this row."""
        attribute = None if self._points is None else self._points.attributes.get(name)
        if attribute is None or attribute.data_type not in FIELDS or not 0 <= row < len(attribute.data):
            return None
        value = getattr(attribute.data[row], FIELDS[attribute.data_type])
        return as_value((*value, 0.0) if attribute.data_type == "FLOAT2" else value)

    def inner(self, row: int) -> _Level | None:
        """The instances within that in this row; None if it shows something else."""
        if self._references is None or not 0 <= row < len(self._references.data):
            return None
        number = self._references.data[row].value
        if number not in self._inner:
            references = self._geometry.instance_references()
            found = references[number] if 0 <= number < len(references) else None
            if not hasattr(found, "instances_pointcloud"):
                return None
            self._inner[number] = _Level(found)
        return self._inner[number]


def _place(instance: Any, name: str) -> Value | None:
    """The place of an instance on its instancer, as texture coordinates."""
    if name == "UV":
        return as_value((*instance.uv, 0.0))
    return as_value(tuple(0.5 * x - 0.5 for x in instance.orco))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's materials: one list, each Blender material in it once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..core.scene import RGB, Material
from .nodes import Place, Unsupported, active_tree
from .surfaces import BLACK, Context, surface

if TYPE_CHECKING:
    from ..core.notes import Notes

DEFAULT = Material("(no material)")


class Palette:
    """Collects materials while objects are visited; number 0 is what objects without a material get."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._materials = [DEFAULT]
        self._numbers: dict[int, int] = {}
        self._pass_indices = [0.0]

    def indices(self, item: Any, data: Any) -> tuple[int, ...]:
        """The scene's material for each slot of an evaluated object; at least one.

        A slot linked to the object wins over the material of the same number on the object's data.
        """
        own = data.materials
        slots = item.material_slots
        numbers = []
        for i in range(max(len(own), len(slots))):
            linked_to_object = i < len(slots) and (slots[i].link == "OBJECT" or i >= len(own))
            numbers.append(self._number(slots[i].material if linked_to_object else own[i]))
        return tuple(numbers) or (0,)

    def materials(self) -> tuple[Material, ...]:
        """All materials met so far, by number."""
        return tuple(self._materials)

    def pass_indices(self) -> tuple[float, ...]:
        """The number that the user gave each of these materials."""
        return tuple(self._pass_indices)

    def _number(self, material: Any) -> int:
        if material is None:
            return 0
        key = material.original.as_pointer()
        if key not in self._numbers:
            self._numbers[key] = len(self._materials)
            self._pass_indices.append(float(material.pass_index))
            self._materials.append(_in_range(read_material(material, self._notes)))
        return self._numbers[key]


def read_material(material: Any, notes: Notes) -> Material:
    """The constant values of a Blender material. Nodes that are not understood go into `notes`."""
    name = material.name
    viewport = Material(
        name,
        base_color=tuple(material.diffuse_color[:3]),
        metallic=material.metallic,
        roughness=material.roughness,
    )
    tree = active_tree(material)
    if tree is None:
        return viewport
    context = Context(viewport, lambda what: notes.add(f"{what} is not supported yet in material", name))
    output = tree.get_output_node("ALL")
    if output is None:
        return replace(BLACK, name=name)
    for socket in ("Displacement", "Volume"):
        if output.inputs[socket].is_linked:
            context.remark(socket)
    try:
        return surface(Place(output.inputs["Surface"]), context)
    except Unsupported as unsupported:
        context.remark(str(unsupported))
        return viewport


def _in_range(material: Material) -> Material:
    """The material with each value where Blender's own engines clamp it."""

    def color(rgb: RGB) -> RGB:
        return (max(rgb[0], 0.0), max(rgb[1], 0.0), max(rgb[2], 0.0))

    return replace(
        material,
        base_color=color(material.base_color),
        metallic=min(max(material.metallic, 0.0), 1.0),
        roughness=min(max(material.roughness, 0.0), 1.0),
        ior=min(max(material.ior, 1e-3), 1e3),
        transmission=min(max(material.transmission, 0.0), 1.0),
        specular=min(max(material.specular, 0.0), 1e3),
        emission=color(material.emission),
        alpha=min(max(material.alpha, 0.0), 1.0),
    )

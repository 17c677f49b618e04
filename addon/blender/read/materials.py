# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's materials: one list with each Blender material once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy

from ...core.base.notes import Notes
from ...core.base.steps import Steps
from ...core.scene.scene import TERMINATOR, Closure, Hidden, Image, Material
from .displacement import programs
from .images import Gallery
from .linking import PLAIN, Sets
from .media.volumes import Volume
from .nodes import Place, Unsupported, active_tree, output_node
from .surfaces import Surface
from .value_nodes import outputs
from .values import Layers, Values

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from ...core.scene.scene import Step
    from .object_values import Key

DEFAULT = Material("(no material)")

NAMELESS = "default_surface"
"""The name of surfaces without a material in Cryptomatte, as in Cycles."""

UNSUPPORTED = "is not supported yet in material"

CLEAR = (Closure("transparent", {"weight": 1.0, "color": (1.0, 1.0, 1.0)}),)
"""The surface of a material that has only a volume: light passes it unchanged."""

NOTHING = (Closure("transparent", {"weight": 0.0}),)
"""A surface that neither scatters nor emits, such as that around a portal."""

BLACK = Material("", base_color=(0.0, 0.0, 0.0), specular=0.0, roughness=1.0)
"""A material without a surface shader: absorbs everything, emits nothing."""


Mask = tuple[bool, bool, float]
"""Whether an object is a holdout, whether it is a shadow catcher, and its *Shadow Terminator*, *Geometry Offset*."""

SEEN: Mask = (False, False, TERMINATOR)
"""Of an object that is rendered as it is."""


@dataclass(frozen=True)
class _Read:
    """A material with the notes to report once it is in use."""

    material: Material
    remarks: tuple[str, ...]
    images: frozenset[int]
    displacement: programs.Displacement | None = None


class Palette:
    """Collects materials while objects are visited; number 0 is for objects without a material.

    layers: corner attributes that the materials that were read, or met since, read.
    """

    def __init__(
        self,
        notes: Notes,
        override: Any = None,
        owners: Sequence[Any] = (),
        wanted: outputs.Outputs | None = None,
        *,
        grids: bool = False,
        gallery: Gallery | None = None,
    ) -> None:
        """override: a material that replaces all others. owners: see `Values`. wanted: the passes that materials write.
        grids: whether there are volume objects. gallery: for the images.
        """
        self.layers = Layers()
        self.gallery = gallery or Gallery()
        self._notes = notes
        self._materials = [DEFAULT]
        self._numbers: dict[tuple[int, Hidden, Sets, Mask, bool], int] = {(0, (), PLAIN, SEEN, False): 0}
        self._pass_indices = [0.0]
        self._displacements: list[programs.Displacement | None] = [None]
        self._read: dict[int, _Read] = {}
        self._images: set[int] = set()
        self._given: dict[tuple[int, tuple[Key, ...]], int] = {}
        self._override = override
        self._owners = owners
        self._wanted = wanted or {}
        self._names = [NAMELESS]
        self.layers.grids = grids

    def read(self, blocks: Iterable[Any]) -> Steps[None]:
        """Read the materials among the data blocks of a depsgraph, one at a time, so that `layers` is complete before
        the first mesh is read.
        """
        for block in list(blocks) if self._override is None else [self._override]:
            if isinstance(block, bpy.types.Material):
                self._of(block)
                yield

    def indices(
        self,
        item: Any,
        data: Any,
        hidden: Hidden = (),
        sets: Sets = PLAIN,
        mask: Mask = SEEN,
        *,
        tube: bool = False,
    ) -> tuple[int, ...]:
        """The scene's material for each slot of an evaluated object; at least one.

        A slot linked to the object takes precedence over the same slot of the object's data. hidden: the rays that
        ignore the object; sets: those of linked lights; mask: how rays see it; tube: whether they are on tubes around
        hairs. In the scene, a material with others is a separate one.
        """
        own = data.materials
        slots = item.material_slots
        numbers = []
        for i in range(max(len(own), len(slots))):
            linked_to_object = i < len(slots) and (slots[i].link == "OBJECT" or i >= len(own))
            numbers.append(self._number(slots[i].material if linked_to_object else own[i], hidden, sets, mask, tube))
        return tuple(numbers) or (self._number(None, hidden, sets, mask, tube),)

    def layers_of(self, numbers: Iterable[int]) -> set[Key]:
        """The layers that the materials of these numbers read."""
        return {key for number in numbers for key in self._layers_of(self._materials[number])}

    def with_values(self, numbers: Iterable[int], keys: Iterable[Key]) -> tuple[int, ...]:
        """The numbers of the same materials that read these layers as values of the object."""
        return tuple(self._with_values(number, tuple(keys)) for number in numbers)

    def materials(self) -> tuple[Material, ...]:
        """All materials met so far, by number."""
        return tuple(self._materials)

    def displacements(self, numbers: Sequence[int]) -> list[programs.Displacement | None]:
        """The displacement of the materials of these numbers."""
        return [self._displacements[number] for number in numbers]

    def readers(self) -> dict[tuple[str, str], list[str]]:
        """By layer the names of the materials met so far that read it."""
        found: dict[tuple[str, str], dict[str, None]] = {}
        for material in self._materials:
            for key in self._layers_of(material):
                found.setdefault(key, {})[material.name] = None
        return {key: list(names) for key, names in found.items()}

    def images(self, notes: Notes, more: Iterable[int] = ()) -> Steps[tuple[Image, ...]]:
        """All images by number, with the pixels of those used by materials met so far and of `more`; read one at a
        time.
        """
        return self.gallery.read(self._images | set(more), notes)

    def pass_indices(self) -> tuple[float, ...]:
        """The pass index of each of these materials."""
        return tuple(self._pass_indices)

    def names(self) -> tuple[str, ...]:
        """The name of each of these materials."""
        return tuple(self._names)

    def _number(self, material: Any, hidden: Hidden, sets: Sets, mask: Mask, tube: bool) -> int:
        """The number of a material, or of none, with these hidden rays and sets; added with its notes if new."""
        material = material if self._override is None else self._override
        key = (0 if material is None else material.original.as_pointer(), hidden, sets, mask, tube)
        if key not in self._numbers:
            self._numbers[key] = len(self._materials)
            self._pass_indices.append(0.0 if material is None else float(material.pass_index))
            self._names.append(NAMELESS if material is None else material.name)
            found = _Read(DEFAULT, (), frozenset()) if material is None else self._of(material)
            hole, catcher, terminator = mask
            own = {"hidden_from": hidden, "hole": hole, "catcher": catcher, "terminator": terminator, "tube": tube}
            own |= dict(zip(("receives", "blocks", "receivers", "blockers"), sets, strict=True))
            self._materials.append(replace(found.material, **own))
            self._displacements.append(found.displacement)
            self._images |= found.images
            for remark in found.remarks:
                self._notes.add(remark, found.material.name)
        return self._numbers[key]

    def _layers_of(self, material: Material) -> Iterator[Key]:
        return (self.layers.keys[step["layer"]] for step in material.program if step["op"] == "attribute")

    def _with_values(self, number: int, keys: tuple[Key, ...]) -> int:
        columns = {self.layers.number(*key): self.layers.object_value(key) for key in keys}

        def given(step: Step) -> Step:
            found = columns.get(step["layer"]) if step["op"] == "attribute" else None
            return step if found is None else {"op": "object_value", "args": (), "column": found}

        if (number, keys) not in self._given:
            self._given[number, keys] = len(self._materials)
            material = self._materials[number]
            self._materials.append(replace(material, program=tuple(map(given, material.program))))
            self._pass_indices.append(self._pass_indices[number])
            self._names.append(self._names[number])
            self._displacements.append(self._displacements[number])
        return self._given[number, keys]

    def _of(self, material: Any) -> _Read:
        """The conversion of a Blender material, done once."""
        key = material.original.as_pointer()
        if key not in self._read:
            remarks: dict[str, None] = {}
            values = self._values(material, remarks)
            surface = replace(_material(material, values), opaque_shadow=not material.use_transparent_shadow)
            tree = active_tree(material)
            if self._wanted and tree is not None:
                written = outputs.read(tree, values, self._wanted)
                surface = replace(surface, program=tuple(values.steps), outputs=written)
            displacement = self._displacement(material, remarks)
            self._read[key] = _Read(surface, tuple(remarks), frozenset(values.images), displacement)
        return self._read[key]

    def _values(self, material: Any, remarks: dict[str, None]) -> Values:
        """The writer of a new program for a material, which adds to `remarks`."""
        values = Values(self.layers, self.gallery, lambda what: remarks.setdefault(f"{what} {UNSUPPORTED}"))
        values.material_index, values.owners = float(material.pass_index), self._owners
        return values

    def _displacement(self, material: Any, remarks: dict[str, None]) -> programs.Displacement | None:
        """The displacement of meshes with this material, if any."""
        tree = active_tree(material)
        output = None if tree is None else output_node(tree)
        if output is None or programs.method(material) == "BUMP":
            return None
        # Vertices are moved before shading: the frames of objects are not needed for that.
        needed = self.layers.objects
        found = programs.read(output, self._values(material, remarks))
        self.layers.objects = needed
        return found


def _material(material: Any, values: Values) -> Material:
    """Convert a Blender material; without nodes, or with an unsupported surface, its viewport settings are used."""
    surface = _surface(material, values)
    tree = active_tree(material)
    output = None if tree is None else output_node(tree)
    if output is None or not output.inputs["Volume"].is_linked:
        return surface
    # A volume has a program of its own, which runs along rays.
    inner = values.inner()
    volume = Volume(inner)
    try:
        volume.read(Place(output.inputs["Volume"]))
    except Unsupported as unsupported:
        values.remark(f"{unsupported} (volume)")
        return surface
    values.images |= inner.images
    values.layers.apart |= bool(volume.closures)
    return replace(surface, volume=volume.as_dict())


def _surface(material: Any, values: Values) -> Material:
    """The surface of a material."""
    name = material.name
    viewport = Material(
        name,
        base_color=tuple(max(c, 0.0) for c in material.diffuse_color[:3]),  # type: ignore[arg-type]
        metallic=min(max(material.metallic, 0.0), 1.0),
        roughness=min(max(material.roughness, 0.0), 1.0),
    )
    tree = active_tree(material)
    if tree is None:
        return viewport
    output = output_node(tree)
    if output is None:
        return _black(name)
    # Note outputs that are not rendered, then read the surface.
    if output.inputs["Displacement"].is_linked and programs.method(material) == "BOTH":
        values.remark("Bump by displacement, in addition to true displacement,")
    surface = Surface(values, viewport.base_color)
    socket = Place(output.inputs["Surface"])
    try:
        if output.inputs["Volume"].is_linked and not socket.source().socket.is_output:
            return Material(name, closures=CLEAR)
        surface.read(socket)
    except Unsupported as unsupported:
        values.remark(str(unsupported))
        return viewport
    if not surface.closures and not surface.portals:
        return _black(name)
    closures = surface.closures or list(NOTHING)
    if programs.method(material) == "BUMP":
        closures = programs.bumped(closures, output, values)
    portals = tuple(surface.portals)
    strands = values.strands
    return Material(name, closures=tuple(closures), program=tuple(values.steps), portals=portals, strands=strands)


def _black(name: str) -> Material:
    return Material(name, base_color=BLACK.base_color, specular=BLACK.specular, roughness=BLACK.roughness)

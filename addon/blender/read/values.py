# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a shader tree as the steps of a program, see `core.scene.Step`.

The conversion of each node is in `value_nodes.NODES`. An unsupported node is noted, and the input that it drives keeps
its own value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from .nodes import NUMBERS, Place, Remark, Unsupported, converted
from .object_values import GRID, Key, found
from .value_nodes import NODES, UV, constant

if TYPE_CHECKING:
    from ...core.scene.scene import Light, Operand, Step
    from .images import Gallery

DEEPEST = 100
"""Longest chain of nodes that is followed; a recursion reads each."""

WHOLE = 10.0
"""Distance of ambient occlusion without a world, Blender's default for worlds."""

MOST_STEPS = 4096
"""Limit of the native module. Nested groups that use each other twice double the steps at each level."""


class Layers:
    """The numbered layers that all materials read. objects: whether they read frames of objects. apart: whether media,
    or rays of programs, need to tell objects apart.
    """

    def __init__(self) -> None:
        self.keys: list[tuple[str, str]] = []
        self.objects = False
        self.apart = False
        self.grids = False
        self.object_values: list[Key] = []

    def number(self, kind: str, name: str) -> int:
        """The number of a layer, added if new."""
        key = (kind, name)
        if key not in self.keys:
            self.keys.append(key)
        return self.keys.index(key)

    def object_value(self, key: Key) -> int:
        """The number of a value of objects, added if new."""
        self.objects = True
        if key not in self.object_values:
            self.object_values.append(key)
        return self.object_values.index(key)


class Values:
    """Writes the program of one material or world."""

    def __init__(
        self,
        layers: Layers,
        gallery: Gallery,
        remark: Remark,
        *,
        background: bool = False,
        wait: bool = True,
        keep_going: Callable[[], bool] | None = None,
    ) -> None:
        """background: for a world. wait: whether to wait for slow nodes, while `keep_going` returns True.

        sun_strength: factor of a sky's sun if that becomes a light, appended to `suns`; None if it is part of the
        program. material_index: that of the material. strands: the layer that is 1 on tubes around hairs, if the
        material scatters like hair. owners: data blocks whose properties are attributes of the view layer. lamp: for a
        light. far: for one at an infinite distance.
        """
        self.steps: list[Step] = []
        self.images: set[int] = set()
        self.layers, self.gallery, self.remark, self.background = layers, gallery, remark, background
        self.wait, self.keep_going = wait, keep_going
        self.material_index = 0.0
        self.volume = False
        self.lamp = self.far = False
        self.strands: int | None = None
        self.owners: Sequence[Any] = ()
        self.sun_strength: float | None = None
        self.suns: list[Light] = []
        # Operands by output or coordinate, and the outputs whose inputs are being read, to detect loops.
        self._known: dict[Any, Operand] = {}
        self._open: list[Any] = []
        self._shift: dict[str, Any] = {}

    def inner(self) -> Values:
        """For another program of the same material."""
        inner = Values(self.layers, self.gallery, self.remark, background=self.background)
        inner.material_index, inner.owners, inner.volume = self.material_index, self.owners, True
        return inner

    def step(self, op: str, *args: Operand, **settings: Any) -> int:
        """Append a step. Returns its number. Raises Unsupported if there are too many."""
        self._check_room()
        self.steps.append({"op": op, "args": args, **settings})
        return len(self.steps) - 1

    def coordinate(self, kind: str) -> int:
        """The step for a property of the shading point, such as its position."""
        if self.lamp and kind in ("camera", "window", "view_vector", "view_depth", "view_distance"):
            raise Unsupported("A coordinate of the camera in a light")
        if (
            kind in ("object", "generated", "object_normal", "tangent_x", "tangent_y", "tangent_z")
            and not self.background
        ):
            self.layers.objects = True
        return self.once(("coordinate", kind), lambda: self.step("coordinate", kind=kind, **self._shift))

    def layer(self, kind: str, name: str) -> Operand:
        """The step for the value of a layer at the shading point; in volumes that of a grid."""
        if self.volume:
            return self.grid(name, 0.0)
        if self.lamp:
            return self.coordinate("parametric") if kind == UV else (0.0, 0.0, 0.0, 0.0)
        number = self.layers.number(kind, name)
        return self.once((kind, name), lambda: self.step("attribute", layer=number, **self._shift))

    def grid(self, name: str, absent: float) -> Operand:
        """The step for the value of a grid; `absent` in objects that have none of this name."""
        if self.background or not (name and self.layers.grids):
            return absent
        number, position = self.of_object(GRID, name), self.coordinate("object")
        return self.once((GRID, name, absent), lambda: self.step("voxels", number, position, absent))

    def of_object(self, kind: str, name: str) -> Operand:
        """The step for a value of the shaded object, see `object_values`."""
        if self.background:
            raise Unsupported("A value of an object in a world")
        column = self.layers.object_value((kind, name))
        return self.once((kind, name), lambda: self.step("object_value", column=column))

    def of_view_layer(self, name: str) -> Operand:
        """A property of the view layer, the scene or its world; 0 if none has it."""
        return found(self.owners, name) or (0.0, 0.0, 0.0, 0.0)

    def object_space(self, item: Any) -> Operand:
        """The position in the space of another object; in worlds the direction is the position."""
        matrix = np.array(item.matrix_world, np.float64)
        if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-30:
            raise Unsupported("Texture Coordinate: Object of an object without size")
        rows = np.linalg.inv(matrix)[:3].tolist()
        return self.step("matrix", self.coordinate("position"), matrix=rows)

    @property
    def occlusion_distance(self) -> float:
        """The distance of ambient occlusion that the world has."""
        world = next((owner for owner in self.owners if isinstance(owner, bpy.types.World)), None)
        return WHOLE if world is None else float(world.light_settings.distance)

    @property
    def shift(self) -> dict[str, Any]:
        """Settings of steps that are computed next to the shading point."""
        return self._shift

    @property
    def shifted(self) -> bool:
        """Whether values are computed next to the shading point."""
        return bool(self._shift)

    @contextmanager
    def beside(self, axis: str, width: float) -> Iterator[None]:
        """Compute values next to the shading point meanwhile: along the surface's axis X or Y, by `width` pixels."""
        self._shift = {"shift": axis, "width": width}
        try:
            yield
        finally:
            self._shift = {}

    @contextmanager
    def here(self) -> Iterator[None]:
        """Compute values at the shading point meanwhile."""
        shift, self._shift = self._shift, {}
        try:
            yield
        finally:
            self._shift = shift

    def input(self, node: Place, name: str | int, absent: Operand = 0.0) -> Operand:
        """The value of a node's input; `absent` if this version of Blender has no such input."""
        if isinstance(name, int):
            return self.value(node.beside(node.node.inputs[name]))
        place = node.input(name)
        return absent if place is None else self.value(place)

    def vector(self, node: Place, fallback: str) -> Operand:
        """The Vector input of a texture node; if unlinked, a coordinate of the shading point."""
        place = node.input("Vector")
        if place is not None and place.source() != place:  # an input of a surrounding group counts as linked
            return self.value(place)
        if self.background:
            return self.coordinate("generated")
        return self.layer(UV, "") if fallback == "uv" else self.coordinate(fallback)

    def value(self, place: Place, fallback: Operand | None = None) -> Operand:
        """The value of an input, in its own type; `fallback`, or its own value, if its node is unsupported."""
        try:
            source = place.source()
            is_constant = not source.socket.is_output
            operand = self._finite(constant(source.socket), place) if is_constant else self.output(source)
            have = source.socket.type
            for want in (*source.through, place.socket.type):
                operand, have = self._converted(operand, have, want), want
            return operand
        except Unsupported as unsupported:
            self.remark(f"{unsupported} for {place.socket.name}")
            return constant(place.socket) if fallback is None else fallback

    def _finite(self, constant: Operand, place: Place) -> Operand:
        """The operand; 0, with a remark, instead of a constant that is not finite."""
        if isinstance(constant, int) or np.isfinite(constant).all():
            return constant
        self.remark(f"A value that is not finite, in {place.socket.name},")
        return 0.0

    def output(self, source: Place) -> Operand:
        """The operand for an output of a node, whose steps are written once. Raises Unsupported."""
        node, socket = source.node, source.socket
        groups = tuple(group.as_pointer() for group in source.groups)
        key = (groups, node.as_pointer(), socket.identifier, *self._shift.values())
        if key in self._known:
            return self._known[key]
        # Check before reading inputs, whose number may double in every group. A node without inputs may need no step.
        if len(node.inputs):
            self._check_room()
        write = NODES.get(node.bl_idname)
        if write is None:
            raise Unsupported(node.bl_label)
        if key in self._open:
            raise Unsupported(f"A loop through {node.bl_label}")
        if len(self._open) >= DEEPEST:
            raise Unsupported(f"A chain of more than {DEEPEST} nodes")
        self._open.append(key)
        try:
            operand = self._finite(write(self, source), source)
        finally:
            self._open.pop()
        self._known[key] = operand
        return operand

    def _check_room(self) -> None:
        if len(self.steps) >= MOST_STEPS:
            raise Unsupported(f"More than {MOST_STEPS} steps")

    def _converted(self, operand: Operand, have: str, want: str) -> Operand:
        """An operand converted between types of sockets, as by `nodes.converted`."""
        if not isinstance(operand, int):
            constant: Operand = converted(operand, have, want)
            return constant
        # As in Cycles, computed values are not truncated to integers.
        if want not in NUMBERS or have in NUMBERS:
            return operand
        return self.step("luminance" if have == "RGBA" else "mean", operand)

    def once_of(self, node: Place, key: str, write: Callable[[], int]) -> int:
        """Like `once`, for a step that several outputs of a node share."""
        groups = tuple(group.as_pointer() for group in node.groups)
        return self.once((groups, node.node.as_pointer(), key), write)

    def once(self, key: Any, write: Callable[[], int]) -> int:
        """The number of the step that `write` appends, called once per key and shift."""
        key = (key, *self._shift.values())
        if key not in self._known:
            self._known[key] = write()
        return self._known[key]  # type: ignore[return-value]

# SPDX-License-Identifier: GPL-3.0-or-later
"""The displacement of a material: as a program for the vertices of meshes, or as bump of its shading normal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..nodes import Place
from ..value_nodes.normals import FILTER_WIDTH

if TYPE_CHECKING:
    from ....core.scene.scene import Closure, Operand, Step
    from ..values import Values


@dataclass(frozen=True)
class Displacement:
    """A program that moves the vertices of a mesh. result: the operand of `program` with the vector in the world.
    images: numbers of the images that it reads.
    """

    program: tuple[Step, ...]
    result: Operand
    images: frozenset[int] = frozenset()


def method(material: Any) -> str:
    """How a material displaces: BUMP, DISPLACEMENT or BOTH."""
    return str(getattr(material, "displacement_method", "BUMP"))


def read(output: Any, values: Values) -> Displacement | None:
    """The displacement that feeds a material's output; None without one. values: of its own program."""
    socket = output.inputs["Displacement"]
    place = Place(socket)
    if not socket.is_linked or not place.source().socket.is_output:
        return None
    result = values.value(place, fallback=0.0)
    if not isinstance(result, int):
        return None
    return Displacement(tuple(values.steps), result, frozenset(values.images))


def bumped(closures: list[Closure], output: Any, values: Values) -> list[Closure]:
    """The closures with the normal of the displaced surface, where they have none of their own."""
    socket = output.inputs["Displacement"]
    place = Place(socket)
    if not socket.is_linked or not place.source().socket.is_output:
        return closures
    # The height is the part of the displacement along the normal, at the point and a part of a pixel next to it.
    normal = values.coordinate("normal")
    heights: list[Operand] = []
    for axis in ("", "X", "Y"):
        if axis:
            with values.beside(axis, FILTER_WIDTH):
                vector = values.value(place, fallback=0.0)
        else:
            vector = values.value(place, fallback=0.0)
        if not isinstance(vector, int):
            return closures
        heights.append(values.step("vector_math", vector, normal, 0.0, kind="DOT_PRODUCT"))
    bump = values.step("bump", *heights, 1.0, 1.0, normal, width=FILTER_WIDTH, invert=False)
    return [replace(closure, normal=bump) if closure.normal is None else closure for closure in closures]

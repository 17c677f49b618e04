# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that displace a surface, to vectors of the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..nodes import Place, Unsupported
from .sockets import TANGENT

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values


def _displacement(values: Values, node: Place) -> Operand:
    normal = node.input("Normal")
    linked = normal is not None and normal.source().socket.is_output
    along = values.value(normal) if linked and normal is not None else values.coordinate("normal")
    amount = _scaled(values, node, values.input(node, "Height"))
    if node.node.space == "WORLD":
        return values.step("vector_math", along, amount, 0.0, kind="MULTIPLY")
    along = _transformed(values, along, "NORMAL", "WORLD", "OBJECT")
    offset = values.step("vector_math", along, amount, 0.0, kind="MULTIPLY")
    return _transformed(values, offset, "VECTOR", "OBJECT", "WORLD")


def _vector_displacement(values: Values, node: Place) -> Operand:
    space = node.node.space
    if space not in ("TANGENT", "OBJECT", "WORLD"):
        raise Unsupported(f"{node.node.bl_label} ({space.title()})")
    offset = _scaled(values, node, values.input(node, "Vector"))
    if space == "WORLD":
        return offset
    if space == "TANGENT":
        offset = _from_tangents(values, offset)
    return _transformed(values, offset, "VECTOR", "OBJECT", "WORLD")


def _scaled(values: Values, node: Place, amount: Operand) -> Operand:
    """The amount above the node's middle level, multiplied by its scale."""
    middle, scale = values.input(node, "Midlevel"), values.input(node, "Scale", 1.0)
    above = values.step("vector_math", amount, middle, 0.0, kind="SUBTRACT")
    return values.step("vector_math", above, scale, 0.0, kind="MULTIPLY")


def _from_tangents(values: Values, offset: Operand) -> Operand:
    """A vector along the tangent, the normal and the bitangent of the active UV map, in object space."""
    raw = values.layer(TANGENT, "")
    tangent = values.step("unit", raw)
    normal = _transformed(values, values.coordinate("normal"), "NORMAL", "WORLD", "OBJECT")
    across = values.step("vector_math", normal, tangent, 0.0, kind="CROSS_PRODUCT")
    bitangent = values.step("vector_math", across, values.step("alpha", raw), 0.0, kind="MULTIPLY")
    total: Operand = 0.0
    for channel, axis in enumerate((tangent, normal, bitangent)):
        part = values.step("vector_math", axis, values.step("channel", offset, channel=channel), 0.0, kind="MULTIPLY")
        total = part if channel == 0 else values.step("vector_math", total, part, 0.0, kind="ADD")
    return total


def _transformed(values: Values, vector: Operand, kind: str, begin: str, end: str) -> Operand:
    values.layers.objects = True
    return values.step("transform", vector, vector=kind, **{"from": begin, "to": end})


DISPLACING = {
    "ShaderNodeDisplacement": _displacement,
    "ShaderNodeVectorDisplacement": _vector_displacement,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""

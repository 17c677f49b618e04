# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that compute normals and depend on the direction of the view."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..nodes import Place, Unsupported
from .sockets import TANGENT

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values


FILTER_WIDTH = 0.1
"""Pixels between the heights of a bump in versions of Blender without that input."""


def _normal_map(values: Values, node: Place) -> Operand:
    item = node.node
    # Check this before reading its inputs: failures are not cached, and a chain of such nodes would double the reads at
    # each.
    if item.space not in ("TANGENT", "OBJECT", "WORLD"):
        raise Unsupported(f"Normal Map ({item.space.replace('_', ' ').lower()})")
    color, strength = values.input(node, "Color"), values.input(node, "Strength")
    # Both choices are new in Blender 5.
    if getattr(item, "convention", "OPENGL") == "DIRECTX":
        color = values.step("vector_math", color, (1.0, -1.0, 1.0), (0.0, 1.0, 0.0), kind="MULTIPLY_ADD")
    if getattr(item, "base", "DISPLACED") == "ORIGINAL":
        values.remark("Normal Map relative to the surface before displacement")
    if item.space == "TANGENT":
        layer = values.layers.number(TANGENT, item.uv_map)
        values.layers.objects = True
        return values.step("normal_map", color, strength, layer=layer)
    values.layers.objects |= item.space == "OBJECT"
    return values.step("normal_map_space", color, strength, object=item.space == "OBJECT")


def _bump(values: Values, node: Place) -> Operand:
    if values.background:
        raise Unsupported("Bump of a world")
    if values.shifted:
        # As in Cycles, a bump within the height of another is the same next to the point.
        with values.here():
            return values.output(node)
    normal, height = node.input("Normal"), node.input("Height")
    linked = normal is not None and normal.source().socket.is_output
    base = values.value(normal) if linked and normal is not None else values.coordinate("normal")
    if height is None or not height.source().socket.is_output:
        return base
    # The heights at the point, and a small part of a pixel next to it.
    width = values.input(node, "Filter Width", FILTER_WIDTH)
    width = width if isinstance(width, float) and width > 0.0 else FILTER_WIDTH
    heights = [values.value(height)]
    for axis in "XY":
        with values.beside(axis, width):
            heights.append(values.value(height))
    strength, distance = values.input(node, "Strength", 1.0), values.input(node, "Distance", 1.0)
    return values.step("bump", *heights, strength, distance, base, width=width, invert=node.node.invert)


def _layer_weight(values: Values, node: Place) -> Operand:
    op = "layer_fresnel" if node.socket.name == "Fresnel" else "layer_facing"
    return values.step(op, values.input(node, "Blend"))


def _normal(values: Values, node: Place) -> Operand:
    # The direction that the user drew is the value of an output.
    drawn = [float(x) for x in node.node.outputs["Normal"].default_value]
    length = math.hypot(*drawn)
    direction = tuple(x / length for x in drawn) if 0.0 < length < math.inf else (0.0, 0.0, 0.0)
    if node.socket.name == "Normal":
        return direction
    unit = values.step("unit", values.input(node, "Normal"))
    return values.step("vector_math", unit, direction, 0.0, kind="DOT_PRODUCT")


NORMALS = {
    "ShaderNodeNormal": _normal,
    "ShaderNodeNormalMap": _normal_map,
    "ShaderNodeBump": _bump,
    "ShaderNodeLayerWeight": _layer_weight,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""

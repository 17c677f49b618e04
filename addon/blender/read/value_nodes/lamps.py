# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that are made for lights: photometric files and falloff."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ....core.scene.photometry import PhotometricError, Photometry, parse
from ..nodes import Place

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values

WITHOUT = 100.0
"""The value of the node without a file that can be read, as in Cycles."""

MOST_BYTES = 1 << 26
"""Largest file that is read."""


def _photometry(item: Any) -> Photometry:
    """The table of a node. Raises PhotometricError or OSError."""
    if item.mode == "INTERNAL":
        if item.ies is None:
            raise PhotometricError("no text")
        return parse(item.ies.as_string())
    if not item.filepath:
        raise PhotometricError("no file")
    path = Path(bpy.path.abspath(item.filepath, library=item.id_data.library))
    if path.stat().st_size > MOST_BYTES:
        raise PhotometricError(f"more than {MOST_BYTES:,} bytes")
    return parse(path.read_text(encoding="latin-1"))


def _ies(values: Values, node: Place) -> Operand:
    strength = values.input(node, "Strength", 1.0)
    try:
        table = _photometry(node.node)
    except (PhotometricError, OSError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        values.remark(f"IES Texture without a readable file ({reason})")
        return values.step("math", strength, WITHOUT, 0.0, kind="MULTIPLY")
    place = node.input("Vector")
    if place is not None and place.source() != place:
        direction = values.value(place)
    else:
        # The direction from the light to the point that it shines on, in the light's space.
        direction = values.coordinate("incoming")
        if not values.background:
            values.layers.objects = True
            spaces = {"from": "WORLD", "to": "OBJECT"}
            direction = values.step("transform", direction, vector="NORMAL", **spaces)
    sides = {"horizontal": table.horizontal, "vertical": table.vertical, "values": table.values}
    return values.step("math", values.step("ies", direction, **sides), strength, 0.0, kind="MULTIPLY")


def _light_falloff(values: Values, node: Place) -> Operand:
    strength, smooth = values.input(node, "Strength"), values.input(node, "Smooth")
    if values.background or values.far:
        return strength  # at an infinite distance

    def math(operation: str, a: Operand, b: Operand) -> Operand:
        return values.step("math", a, b, 0.0, kind=operation)

    distance = values.coordinate("ray_length")
    square = math("MULTIPLY", distance, distance)
    softened = math("ADD", square, math("MAXIMUM", smooth, 0.0))
    strength = math("MULTIPLY", strength, math("DIVIDE", square, softened))
    match node.socket.name:
        case "Linear":
            return math("MULTIPLY", strength, distance)
        case "Constant":
            return math("MULTIPLY", strength, square)
    return strength


LAMPS = {
    "ShaderNodeTexIES": _ies,
    "ShaderNodeLightFalloff": _light_falloff,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""

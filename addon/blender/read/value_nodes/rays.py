# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that trace rays from the shaded point."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..nodes import Place, Unsupported

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values

MOST_SAMPLES = 255
"""Limit of the native module. Blender's is lower."""


def _ambient_occlusion(values: Values, node: Place) -> Operand:
    item = node.node
    values.layers.apart |= item.only_local
    normal, distance = _linked(values, node, "Normal"), values.input(node, "Distance")
    # A distance of 0 that no node computes stands for that of the world.
    if distance == 0.0 and isinstance(distance, float):
        distance = values.occlusion_distance

    def write() -> int:
        return values.step(
            "occlusion",
            distance,
            (0.0, 0.0, 0.0) if normal is None else normal,
            samples=min(item.samples, MOST_SAMPLES),
            inside=item.inside,
            local=item.only_local,
        )

    share = values.once_of(node, "occlusion", write)
    if node.socket.name == "AO":
        return share
    return values.step("mix", 1.0, values.input(node, "Color"), share, kind="MULTIPLY", clamp_factor=False)


def _bevel(values: Values, node: Place) -> Operand:
    values.layers.apart = True
    bevel = values.step("bevel", values.input(node, "Radius"), samples=min(node.node.samples, MOST_SAMPLES))
    normal = _linked(values, node, "Normal")
    if normal is None:
        return bevel
    # Another normal is turned as that of the surface is.
    turned = values.step("vector_math", bevel, values.coordinate("normal"), 0.0, kind="SUBTRACT")
    return values.step("unit", values.step("vector_math", normal, turned, 0.0, kind="ADD"))


def _raycast(values: Values, node: Place) -> Operand:
    item, name = node.node, node.socket.name
    if name not in _OF_HIT and name not in ("Hit Position", "Hit Normal"):
        raise Unsupported(f"Raycast: attribute {name!r} of the surface that is hit")
    values.layers.apart |= item.only_local or name == "Self Hit"
    position = _linked(values, node, "Position")
    direction = _linked(values, node, "Direction")
    position = values.coordinate("position") if position is None else position
    direction = values.coordinate("normal") if direction is None else direction
    length = values.input(node, "Length")

    def cast(*, of_normal: bool) -> int:
        key = "normal" if of_normal else "hit"
        return values.once_of(
            node,
            f"raycast {key}",
            lambda: values.step(
                "raycast", position, direction, length, local=item.only_local, of_normal=of_normal, **values.shift
            ),
        )

    if name == "Hit Normal":
        return cast(of_normal=True)
    hit = cast(of_normal=False)
    if name in _OF_HIT:
        return values.step("channel", hit, channel=_OF_HIT[name])
    # The position of a hit; the origin of the world without one.
    distance, there = (values.step("channel", hit, channel=_OF_HIT[key]) for key in ("Hit Distance", "Is Hit"))
    along = values.step("vector_math", direction, distance, position, kind="MULTIPLY_ADD")
    return values.step("mix", 1.0, along, there, kind="MULTIPLY", clamp_factor=False)


def _linked(values: Values, node: Place, name: str) -> Operand | None:
    """The value of an input that is linked; None for any other."""
    place = node.input(name)
    return None if place is None or place.source() == place else values.value(place)


_OF_HIT = {"Hit Distance": 0, "Is Hit": 1, "Self Hit": 2}
"""The channels of the step that casts a ray."""

RAYS = {
    "ShaderNodeAmbientOcclusion": _ambient_occlusion,
    "ShaderNodeBevel": _bevel,
    "ShaderNodeRaycast": _raycast,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""

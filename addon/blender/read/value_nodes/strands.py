# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that read hair and points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..nodes import Place, Unsupported
from .sockets import STRAND

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values

_CURVES = ("Is Strand", "Intercept", "Length", "Thickness", "Random")
_POINTS = {"Position": "Position", "Radius": "Radius", "Random": "Point Random"}


def _hair_info(values: Values, node: Place) -> Operand:
    name = node.socket.name
    if name == "Tangent Normal" and not values.background:
        return _tangent_normal(values)
    if name not in _CURVES or values.background:
        raise Unsupported(f"{node.node.bl_label}: {name}")
    return values.step("mean", values.layer(STRAND, name))


def _tangent_normal(values: Values) -> Operand:
    """The direction towards the viewer, perpendicular to the strand; 0 on anything else."""
    values.layers.objects = True
    tangent, incoming = values.layer(STRAND, "Tangent"), values.coordinate("incoming")
    along = values.step("transform", tangent, vector="VECTOR", **{"from": "OBJECT", "to": "WORLD"})
    ahead = values.step("vector_math", incoming, along, 0.0, kind="PROJECT")
    across = values.step("unit", values.step("vector_math", incoming, ahead, 0.0, kind="SUBTRACT"))
    return values.step("vector_math", across, values.layer(STRAND, "Is Strand"), 0.0, kind="MULTIPLY")


def _point_info(values: Values, node: Place) -> Operand:
    name = node.socket.name
    if name not in _POINTS or values.background:
        raise Unsupported(f"{node.node.bl_label}: {name}")
    layer = values.layer(STRAND, _POINTS[name])
    return layer if name == "Position" else values.step("mean", layer)


STRANDS = {
    "ShaderNodeHairInfo": _hair_info,
    "ShaderNodePointInfo": _point_info,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""

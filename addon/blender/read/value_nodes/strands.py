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
    if name not in _CURVES or values.background:
        raise Unsupported(f"{node.node.bl_label}: {name}")
    return values.step("mean", values.layer(STRAND, name))


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

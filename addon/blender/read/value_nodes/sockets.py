# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of sockets, and the kinds of layers that value nodes read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ....core.scene.scene import Operand

UV, COLOR, TANGENT, ISLAND, POINTINESS = "uv", "color", "tangent", "island", "pointiness"
"""Kinds of layers: a UV map, a colour attribute, the tangents of a UV map, a random number of each connected part,
pointiness. The name "" is the active one.
"""

STRAND = "strand"
"""The kind of layers that only hair and point clouds have; 0 elsewhere."""


def is_constant(operand: Operand, value: float) -> bool:
    """Whether an operand is this number; an integer is the index of a step, also 0 and 1."""
    return isinstance(operand, float) and operand == value


def constant(socket: Any) -> Operand:
    """The value of an unlinked socket."""
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, str):
        return 0.0
    return tuple(float(x) for x in value)

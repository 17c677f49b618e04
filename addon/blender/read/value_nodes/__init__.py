# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the value nodes of shader trees: a function in NODES writes the steps of one of a node's outputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .coordinates import COORDINATES
from .displacing import DISPLACING
from .lamps import LAMPS
from .normals import NORMALS
from .numbers import NUMBERS
from .pictures import PICTURES
from .rays import RAYS
from .sockets import COLOR, ISLAND, POINTINESS, STRAND, TANGENT, UV, constant, is_constant
from .strands import STRANDS
from .textures import TEXTURES

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..nodes import Place
    from ..values import Values

__all__ = ["COLOR", "ISLAND", "NODES", "POINTINESS", "STRAND", "TANGENT", "UV", "constant", "is_constant"]

NODES: dict[str, Callable[[Values, Place], Operand]] = {
    **TEXTURES,
    **PICTURES,
    **COORDINATES,
    **NUMBERS,
    **NORMALS,
    **STRANDS,
    **RAYS,
    **LAMPS,
    **DISPLACING,
    "ShaderNodeRGB": lambda _, node: constant(node.socket),
    "ShaderNodeValue": lambda _, node: constant(node.socket),
}

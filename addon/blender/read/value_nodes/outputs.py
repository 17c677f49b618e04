# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of AOV Output nodes: the values that a material writes to passes of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..nodes import Place, Unsupported

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..remembered import Remembered
    from ..standing import Standing
    from ..values import Values

Outputs = Mapping[str, tuple[int, str]]
"""The number of each pass and its type, COLOR or VALUE, by name."""

MOST = 64
"""Largest number of passes that materials write, and of light groups: the limit of the native module."""

DEEPEST = 32
"""Largest depth of groups within each other that are searched."""


@dataclass(frozen=True)
class Wanted:
    """Needs of a picture. mattes: the names for Cryptomatte. outputs: the passes that materials write.
    groups: the number of each light group, from 1, by name. standing: what stays as it is at the frame, if the picture
    shows several times. remembered: what a 3D view has read before.
    """

    mattes: bool = False
    outputs: Outputs = field(default_factory=dict)
    groups: Mapping[str, int] = field(default_factory=dict)
    standing: Standing | None = None
    remembered: Remembered | None = None


NOTHING = Wanted()


def wanted(view_layer: Any) -> dict[str, tuple[int, str]]:
    """The passes of a view layer that materials write. Those beyond the largest number stay empty."""
    valid = [aov for aov in view_layer.aovs if aov.is_valid][:MOST]
    return {aov.name: (number, aov.type) for number, aov in enumerate(valid)}


def groups(view_layer: Any) -> dict[str, int]:
    """The number of each light group of a view layer, from 1. Those beyond the largest number stay empty."""
    return {group.name: number for number, group in enumerate(view_layer.lightgroups[:MOST], 1)}


def read(tree: Any, values: Values, wanted: Outputs) -> tuple[tuple[int, Operand], ...]:
    """The number of each pass that the tree's nodes write, and the value."""
    found: dict[int, Operand] = {}
    for node, groups in _nodes(tree):
        entry = wanted.get(node.aov_name)
        if entry is None:
            continue
        number, kind = entry
        place = Place(node.inputs["Color" if kind == "COLOR" else "Value"], groups)
        try:
            found.setdefault(number, values.value(place))
        except Unsupported as unsupported:
            values.remark(str(unsupported))
    return tuple(found.items())


def _nodes(tree: Any, groups: tuple[Any, ...] = ()) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """The AOV Output nodes of a tree and of the groups in it, with the group nodes that lead to each."""
    for node in tree.nodes:
        if node.mute:
            continue
        if node.bl_idname == "ShaderNodeOutputAOV":
            yield node, groups
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and len(groups) < DEEPEST:
            yield from _nodes(node.node_tree, (*groups, node))

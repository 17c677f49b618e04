# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of tests, as the extension reads them."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import bpy

from addon.blender.read.materials import Palette
from addon.core.base.notes import Notes
from addon.core.scene.scene import Material
from tests.blender.shapes import node


def converted(block: Any) -> tuple[Material, list[str]]:
    """The converted material of an object that has only this one, and the notes."""
    notes = Notes()
    palette = Palette(notes)
    item, data = SimpleNamespace(material_slots=[]), SimpleNamespace(materials=[block])
    (number,) = palette.indices(item, data)
    return palette.materials()[number], notes.lines()


def inputs(block: Any, kind: str = "principled") -> Any:
    """The inputs of the material's only closure. Checks its kind, and that there are no notes."""
    found, notes = converted(block)
    assert notes == []
    (closure,) = found.closures
    assert closure.kind == kind
    return closure.inputs


def plug(block: Any, kind: str, socket: int = 0) -> Any:
    """Put a new shader node in front of the material's output."""
    tree = block.node_tree
    new = tree.nodes.new(kind)
    tree.links.new(new.outputs[socket], node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return new


def nodes_group(kind: str, result: str, make: Callable[[Any, Any], Any]) -> Any:
    """A group of shader nodes with one input and one output of these types. make: the output, of tree and input."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    for direction, one in (("INPUT", kind), ("OUTPUT", result)):
        group.interface.new_socket("Value", in_out=direction, socket_type=f"NodeSocket{one}")
    source = group.nodes.new("NodeGroupInput").outputs[0]
    group.links.new(make(group, source), group.nodes.new("NodeGroupOutput").inputs[0])
    return group

# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as `core.scene.World`: one colour."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..core.scene import World
from .nodes import Place, Unsupported, active_tree, color, number, scaled

if TYPE_CHECKING:
    from ..core.notes import Notes


def read_world(world: Any, notes: Notes) -> World:
    """The background's colour × strength. What is not constant goes into `notes` and is replaced by its default."""
    if world is None:
        return World()
    plain = World(tuple(world.color))
    tree = active_tree(world)
    if tree is None:
        return plain

    def remark(what: str) -> None:
        notes.add(f"{what} is not supported yet in world", world.name)

    output = tree.get_output_node("ALL")
    if output is None:
        return World()
    if output.inputs["Volume"].is_linked:
        remark("Volume")
    try:
        background = Place(output.inputs["Surface"]).source()
    except Unsupported as unsupported:
        remark(str(unsupported))
        return plain
    if not background.socket.is_output:
        return World()
    if background.node.bl_idname not in ("ShaderNodeBackground", "ShaderNodeEmission"):
        remark(background.node.bl_label)
        return plain
    tint = color(background.input("Color"), remark)
    return World(scaled(tint, number(background.input("Strength"), remark)))

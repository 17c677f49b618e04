# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees that stand for far more than they hold are read in time, or only in part."""

from typing import Any

import bpy
import pytest

from addon.blender.read import values
from addon.blender.read.values import Values
from addon.blender.read.world import read_world
from addon.core.base.notes import Notes
from tests.blender.atlas import add, made, number, tile_material
from tests.blender.read_materials import converted, nodes_group
from tests.blender.shapes import material, node, with_nodes

LEVELS = 30

MOST_STEPS = 4096
"""Largest number of steps of a program in the native module."""


def doubled(tree: Any, kind: str, first: Any, levels: int = LEVELS) -> Any:
    """The last output of a chain of nodes, each of which takes the one before in its last two inputs."""
    before = first
    for _ in range(levels):
        new = tree.nodes.new(kind)
        for socket in new.inputs[-2:] if before is not None else ():
            tree.links.new(before, socket)
        before = new.outputs[0]
    return before


def groups_of_two(levels: int = 14) -> Any:
    """A group that computes a number from two groups, each of them from two, and so on. Blender itself doubles."""
    inner = None
    for level in range(levels):
        tree = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        tree.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
        end, both = tree.nodes.new("NodeGroupOutput"), tree.nodes.new("ShaderNodeMath")
        for socket in both.inputs[:2] if inner is not None else ():
            user = tree.nodes.new("ShaderNodeGroup")
            user.node_tree = inner
            tree.links.new(user.outputs[0], socket)
        tree.links.new(both.outputs[0], end.inputs[0])
        inner = tree
    return inner


@pytest.mark.parametrize("kind", ["ShaderNodeAddShader", "ShaderNodeMixShader"])
@pytest.mark.parametrize("shader", [None, "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfPrincipled"])
def test_a_shader_that_is_mixed_with_itself_again_and_again(kind: str, shader: str | None) -> None:
    block = material("Doubled")
    tree = block.node_tree
    first = None if shader is None else tree.nodes.new(shader).outputs[0]
    end = node(tree, "ShaderNodeOutputMaterial").inputs["Surface"]
    tree.links.new(doubled(tree, kind, first), end)
    block.diffuse_color = (0.25, 0.5, 0.75, 1)
    found, notes = converted(block)
    assert found.base_color == (0.25, 0.5, 0.75)
    assert any("More than 4096 shaders is not supported yet in material: Doubled" in line for line in notes)


@pytest.mark.parametrize(
    ("shader", "most"), [("ShaderNodeBsdfPrincipled", 4), ("ShaderNodeBsdfMetallic", 4), ("ShaderNodeBsdfGlass", 8)]
)
def test_shaders_for_which_there_is_no_room_are_not_read(
    shader: str, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    block = material("Crowded")
    tree = block.node_tree
    end = node(tree, "ShaderNodeOutputMaterial").inputs["Surface"]
    tree.links.new(doubled(tree, "ShaderNodeAddShader", tree.nodes.new(shader).outputs[0], 9), end)
    asked: list[str] = []
    value = Values.value
    monkeypatch.setattr(
        Values, "value", lambda self, place, *rest: asked.append(place.socket.name) or value(self, place, *rest)
    )
    found, notes = converted(block)
    assert len(found.closures) == most
    assert notes == ["More than 8 shaders, 4 of them Principled, is not supported yet in material: Crowded"]
    assert asked.count("Roughness") == most


def test_a_normal_map_of_normal_maps_that_are_unknown() -> None:
    block = material("Bent")
    tree = block.node_tree
    last = doubled(tree, "ShaderNodeNormalMap", None)
    for item in tree.nodes:
        if item.bl_idname == "ShaderNodeNormalMap":
            item.space = "BLENDER_OBJECT"
    tree.links.new(last, node(tree, "ShaderNodeBsdfPrincipled").inputs["Normal"])
    found, notes = converted(block)
    assert len(found.closures) == 1
    assert any(line.startswith("Normal Map (blender object) for Normal") for line in notes)


def test_groups_that_double_at_each_level_end_at_what_the_native_module_takes() -> None:
    block = material("Grouped", Roughness=0.25)
    tree = block.node_tree
    user = add(tree, "Group", node_tree=groups_of_two())
    tree.links.new(user.outputs[0], node(tree, "ShaderNodeBsdfPrincipled").inputs["Roughness"])
    found, notes = converted(block)
    assert found.closures[0].inputs["roughness"] == 0.25
    assert any(line.startswith(f"More than {MOST_STEPS} steps for Roughness") for line in notes)
    assert len(found.program) <= MOST_STEPS


def test_a_constant_is_read_where_there_is_no_room_for_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(values, "MOST_STEPS", 1)

    def full(tree: Any) -> Any:
        color = add(tree, "RGB")
        color.outputs[0].default_value = (0.25, 0.5, 0.75, 1)
        tints = {"Coat_Tint": color.outputs[0], "Specular_Tint": made("Gamma")}
        position = made("NewGeometry", output="Position")
        return made("BsdfPrincipled", Base_Color=position, IOR=number(0.125), **tints)(tree)

    block = tile_material("Full", full)
    found, notes = converted(block)
    inputs = found.closures[0].inputs
    assert (len(found.program), inputs["ior"], inputs["coat_tint"]) == (1, 0.125, (0.25, 0.5, 0.75, 1.0))
    assert notes == ["More than 1 steps for Specular Tint is not supported yet in material: Full"]


def test_the_empty_socket_of_a_group_s_input_is_unknown() -> None:
    inner = nodes_group("Float", "Float", lambda tree, _: made("Math", 0.125, 0.25)(tree))
    inner.links.new(node(inner, "NodeGroupInput").outputs[-1], node(inner, "ShaderNodeMath").inputs[0])
    block = tile_material("Grouped", made("BsdfPrincipled", Roughness=made("Group", node_tree=inner)))
    found, notes = converted(block)
    assert [step["args"][:2] for step in found.program] == [(0.125, 0.25)]
    assert notes == ["Group Input for Value is not supported yet in material: Grouped"]


def test_a_world_of_too_many_steps_is_its_plain_colour() -> None:
    world = bpy.data.worlds.new("Grouped")
    with_nodes(world)
    tree = world.node_tree
    backgrounds = [made("Background", Strength=made("Group", node_tree=groups_of_two())) for _ in range(2)]
    both = made("AddShader", *backgrounds)(tree)
    tree.links.new(both, node(tree, "ShaderNodeOutputWorld").inputs["Surface"])
    notes = Notes()
    found, _, _ = read_world(world, notes)
    assert len(found.program) <= MOST_STEPS
    assert any("steps" in line for line in notes.lines())


def test_a_tree_is_not_looked_through_for_each_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    block = material("Linked")
    tree = block.node_tree
    shader = node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(doubled(tree, "ShaderNodeGamma", None, 50), shader.inputs["Base Color"])
    looked: list[Any] = []
    found = bpy.types.NodeSocket.links
    monkeypatch.setattr(bpy.types.NodeSocket, "links", property(lambda self: looked.append(self) or found.fget(self)))
    read, notes = converted(block)
    assert (len(read.program), notes) == (99, [])
    assert looked == []

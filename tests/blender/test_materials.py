# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes become constants; what cannot is listed by material, never raised."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import pytest
from shapes import material, node, triangle, with_nodes

from addon.blender.materials import Palette, read_material
from addon.core.notes import Notes

if TYPE_CHECKING:
    from addon.core.scene import Material


def understood(block: Any) -> tuple[Material, list[str]]:
    notes = Notes()
    return read_material(block, notes), notes.lines()


def plug(block: Any, kind: str, socket: int = 0) -> Any:
    """Put a new shader node in front of the material's output."""
    tree = block.node_tree
    new = tree.nodes.new(kind)
    tree.links.new(new.outputs[socket], node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return new


def test_principled_constants() -> None:
    block = material(
        "All",
        Base_Color=(0.1, 0.2, 0.3, 1),
        Metallic=0.25,
        Roughness=0.75,
        IOR=1.33,
        Transmission_Weight=0.5,
        Specular_IOR_Level=0.2,
        Emission_Color=(1, 0.5, 0.25, 1),
        Emission_Strength=4.0,
        Alpha=0.9,
    )
    found, notes = understood(block)
    assert notes == []
    assert found.name == "All"
    assert found.base_color == pytest.approx((0.1, 0.2, 0.3))
    assert (found.metallic, found.transmission) == (0.25, 0.5)
    assert (found.roughness, found.ior, found.specular, found.alpha) == pytest.approx((0.75, 1.33, 0.2, 0.9))
    assert found.emission == pytest.approx((4, 2, 1))


@pytest.mark.parametrize(
    ("kind", "inputs", "expected"),
    [
        ("ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.2, 0.3, 1)}, {"base_color": (0.1, 0.2, 0.3), "specular": 0}),
        ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.125}, {"metallic": 1, "roughness": 0.125}),
        ("ShaderNodeBsdfGlass", {"IOR": 1.25, "Roughness": 0}, {"transmission": 1, "ior": 1.25, "roughness": 0}),
        (
            "ShaderNodeEmission",
            {"Color": (1, 0.5, 0, 1), "Strength": 2},
            {"emission": (2, 1, 0), "base_color": (0, 0, 0)},
        ),
        ("ShaderNodeBsdfTransparent", {}, {"alpha": 0}),
    ],
)
def test_simple_shaders(kind: str, inputs: dict[str, Any], expected: dict[str, Any]) -> None:
    block = material("Simple")
    shader = plug(block, kind)
    for name, value in inputs.items():
        shader.inputs[name].default_value = value
    found, notes = understood(block)
    assert notes == []
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value), name


def test_reroutes_groups_values_and_muted_nodes_are_followed() -> None:
    block = material("Routed")
    tree = block.node_tree
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside, outside = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    diffuse = group.nodes.new("ShaderNodeBsdfDiffuse")
    group.links.new(inside.outputs["Tint"], diffuse.inputs["Color"])
    group.links.new(diffuse.outputs[0], outside.inputs["Shader"])
    user = tree.nodes.new("ShaderNodeGroup")
    user.node_tree = group
    colour, gamma = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("ShaderNodeGamma")
    colour.outputs[0].default_value = (0.5, 0.25, 0.125, 1)
    gamma.mute = True
    tree.links.new(colour.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], user.inputs["Tint"])
    bend = tree.nodes.new("NodeReroute")
    tree.links.new(user.outputs["Shader"], bend.inputs[0])
    tree.links.new(bend.outputs[0], node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    found, notes = understood(block)
    assert notes == []
    assert found.base_color == pytest.approx((0.5, 0.25, 0.125))
    tree.links.remove(next(link for link in tree.links if link.to_node == user))
    user.inputs["Tint"].default_value = (0.1, 0.2, 0.3, 1)
    assert understood(block)[0].base_color == pytest.approx((0.1, 0.2, 0.3))


def test_a_mix_with_a_constant_factor_is_blended() -> None:
    block = material("Mixed")
    tree = block.node_tree
    mix = plug(block, "ShaderNodeMixShader")
    black, white = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    black.inputs["Color"].default_value, white.inputs["Color"].default_value = (0, 0, 0, 1), (1, 1, 1, 1)
    tree.links.new(black.outputs[0], mix.inputs[1])
    tree.links.new(white.outputs[0], mix.inputs[2])
    mix.inputs[0].default_value = 0.25
    assert understood(block)[0].base_color == pytest.approx((0.25, 0.25, 0.25))
    clear = tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(clear.outputs[0], mix.inputs[1])
    found, notes = understood(block)
    assert (found.alpha, found.base_color, notes) == (0.25, (1, 1, 1), [])


def test_emission_added_to_a_surface() -> None:
    block = material("Glowing")
    tree = block.node_tree
    add = plug(block, "ShaderNodeAddShader")
    tree.links.new(tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], add.inputs[0])
    tree.links.new(tree.nodes.new("ShaderNodeEmission").outputs[0], add.inputs[1])
    found, notes = understood(block)
    assert found.emission == (1, 1, 1)
    assert found.base_color == pytest.approx((0.8, 0.8, 0.8))
    assert notes == []


def test_a_texture_falls_back_to_the_viewport_colour_and_is_listed() -> None:
    block = material("Textured")
    block.diffuse_color = (0.25, 0.5, 0.75, 1)
    tree = block.node_tree
    shader = node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(tree.nodes.new("ShaderNodeTexChecker").outputs["Fac"], shader.inputs["Roughness"])
    shader.inputs["Coat Weight"].default_value = 1
    found, notes = understood(block)
    assert found.base_color == (0.25, 0.5, 0.75)
    assert found.roughness == pytest.approx(shader.inputs["Roughness"].default_value)
    assert all("Textured" in line for line in notes)
    assert [
        word for word in ("Noise Texture", "Checker Texture", "Coat Weight") if not any(word in n for n in notes)
    ] == []


def test_an_unknown_shader_falls_back_to_the_viewport_look() -> None:
    block = material("Hairy")
    block.diffuse_color = (0.25, 0.5, 0.75, 1)
    plug(block, "ShaderNodeBsdfHair")
    found, notes = understood(block)
    assert found.base_color == (0.25, 0.5, 0.75)
    assert len(notes) == 1
    assert "Hair" in notes[0]


def test_materials_without_output_or_shader_are_black() -> None:
    block = material("Cut")
    block.node_tree.links.clear()
    assert understood(block)[0].base_color == (0, 0, 0)
    block.node_tree.nodes.clear()
    found, notes = understood(block)
    assert (found.base_color, found.name, notes) == ((0, 0, 0), "Cut", [])


def test_values_out_of_range_are_clamped_as_blender_clamps(add: Any) -> None:
    block = material("Wild", IOR=1.5)
    value = block.node_tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = -3.0
    shader = node(block.node_tree, "ShaderNodeBsdfPrincipled")
    for name in ("Base Color", "Metallic", "IOR", "Alpha", "Emission Strength"):
        block.node_tree.links.new(value.outputs[0], shader.inputs[name])
    mesh = triangle()
    mesh.materials.append(block)
    palette = Palette(Notes())
    palette.indices(add("Wild", mesh), mesh)
    found = palette.materials()[1]
    assert (found.metallic, found.alpha, found.base_color, found.emission) == (0, 0, (0, 0, 0), (0, 0, 0))
    assert found.ior > 0


def test_a_world_is_a_colour(scene: Any) -> None:
    from addon.blender.world import read_world

    world = bpy.data.worlds.new("World")
    with_nodes(world)
    background = node(world.node_tree, "ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
    background.inputs["Strength"].default_value = 2
    notes = Notes()
    assert read_world(world, notes).color == pytest.approx((1, 0.5, 0.25))
    assert not notes
    sky = world.node_tree.nodes.new("ShaderNodeTexSky")
    world.node_tree.links.new(sky.outputs[0], background.inputs["Color"])
    assert read_world(world, notes).color == pytest.approx((1, 0.5, 0.25))
    assert any("Sky Texture" in line and "World" in line for line in notes.lines())
    assert read_world(None, notes).color == (0, 0, 0)

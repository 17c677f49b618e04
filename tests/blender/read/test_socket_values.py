# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of sockets: converted on their way through groups, mapped, clamped, and divided by alpha."""

from typing import Any

import bpy
import pytest
from mathutils import Euler

from addon.blender.read.images import read_image
from addon.core.base.notes import Notes
from tests.blender.atlas import add, made, tile_material
from tests.blender.read_materials import converted, inputs, nodes_group
from tests.blender.shapes import material, node


def grouped(block: Any, kinds: tuple[str, str], inside: str = "", socket: str = "") -> Any:
    """A group linked to the material's base colour. kinds: of its input and output. inside: a node in the group, whose
    `socket` is linked to the group's input; "" for none.
    """

    def within(tree: Any, value: Any) -> Any:
        return made(inside, **{socket: value})(tree) if inside else value

    tree = block.node_tree
    user = add(tree, "Group", node_tree=nodes_group(*kinds, within))
    tree.links.new(user.outputs[0], node(tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"])
    return user


@pytest.mark.parametrize(
    ("kinds", "socket", "expected", "step"),
    [
        (("Color", "Color"), "Metallic", 0.2126 * 0.9 + 0.7152 * 0.1 + 0.0722 * 0.2, "luminance"),
        (("Color", "Vector"), "Metallic", 0.4, "mean"),
        (("Vector", "Float"), "Metallic", 0.4, "mean"),
        (("Color", "Float"), "Base Color", 0.2126 * 0.9 + 0.7152 * 0.1 + 0.0722 * 0.2, "luminance"),
    ],
)
def test_values_through_a_group_are_converted_to_its_socket_types(
    kinds: tuple[str, str], socket: str, expected: float, step: str
) -> None:
    block = material("Typed")
    user = grouped(block, kinds)
    user.inputs[0].default_value = (0.9, 0.1, 0.2, 1)[: len(user.inputs[0].default_value)]
    block.node_tree.links.new(user.outputs[0], node(block.node_tree, "ShaderNodeBsdfPrincipled").inputs[socket])
    name = {"Metallic": "metallic", "Base Color": "color"}[socket]
    assert inputs(block)[name] == pytest.approx(expected)
    colour = add(block.node_tree, "RGB")
    colour.outputs[0].default_value = (0.9, 0.1, 0.2, 1)
    block.node_tree.links.new(colour.outputs[0], user.inputs[0])
    assert inputs(block)[name] == pytest.approx(expected)
    checker = block.node_tree.nodes.new("ShaderNodeTexChecker")
    block.node_tree.links.new(checker.outputs["Color"], user.inputs[0])
    found, notes = converted(block)
    assert notes == []
    number = found.closures[0].inputs[name]
    assert found.program[number]["op"] == step
    assert found.program[found.program[number]["args"][0]]["op"] == "checker"


@pytest.mark.parametrize(
    ("kinds", "value", "expected"),
    [
        (("Float", "Int"), 1.7, 1),
        (("Float", "Int"), -1.7, -1),
        (("Vector", "Int"), (0, 0, -4.5), -1),
        (("Color", "Int"), (3, 0.5, 0.5, 1), 1),
        (("Float", "Bool"), 0.3, 1),
        (("Float", "Bool"), -0.3, 0),
        (("Vector", "Bool"), (0, 4, -4), 1),
        (("Int", "Float"), 2, 2),
    ],
)
def test_constants_are_converted_to_integer_and_boolean_sockets(
    kinds: tuple[str, str], value: Any, expected: float
) -> None:
    """As in Cycles, which converts constants but no computed values."""
    block = material("Whole")
    user = grouped(block, kinds)
    user.inputs[0].default_value = value
    assert inputs(block)["color"] == expected
    checker = block.node_tree.nodes.new("ShaderNodeTexChecker")
    block.node_tree.links.new(checker.outputs["Fac"], user.inputs[0])
    steps = [step["op"] for step in converted(block)[0].program]
    assert [op for op in steps if op not in ("mean", "luminance")] == ["coordinate", "checker"]


@pytest.mark.parametrize("kind", ["Float", "Int", "Vector", "Color"])
@pytest.mark.parametrize("socket", ["Location", "Rotation", "Scale"])
def test_a_mapping_takes_any_value_that_its_group_gives(kind: str, socket: str) -> None:
    block = material("Mapped")
    user = grouped(block, (kind, "Color"), "Mapping", socket)
    value = {"Float": 2.0, "Int": 2, "Vector": (2, 2, 2), "Color": (2, 2, 2, 1)}[kind]
    user.inputs[0].default_value = value
    found, notes = converted(block)
    assert notes == []
    (matrix,) = [step["matrix"] for step in found.program if step["op"] == "matrix"]
    if socket == "Scale":
        assert matrix[0][:3] == pytest.approx((2, 0, 0))
    elif socket == "Location":
        assert [row[3] for row in matrix] == pytest.approx((2, 2, 2))
    else:
        turned = Euler((2, 2, 2)).to_matrix()
        assert [x for row in matrix for x in row[:3]] == pytest.approx([x for row in turned for x in row])


@pytest.mark.parametrize("kind", ["TEXTURE", "NORMAL", "POINT"])
def test_a_mapping_divides_by_no_zero(kind: str) -> None:
    block = material("Flat")
    user = grouped(block, ("Vector", "Color"), "Mapping", "Vector")
    mapping = node(user.node_tree, "ShaderNodeMapping")
    mapping.vector_type = kind
    mapping.inputs["Scale"].default_value = (0, 2, 1)
    (matrix,) = [step["matrix"] for step in converted(block)[0].program if step["op"] == "matrix"]
    assert matrix[0][:3] == pytest.approx((0, 0, 0))
    assert matrix[1][1] == pytest.approx(2 if kind == "POINT" else 0.5)


def test_a_clamp_to_a_range_takes_its_ends_in_either_order() -> None:
    block = material("Clamped")
    user = grouped(block, ("Float", "Float"), "Clamp", "Value")
    assert [step["op"] for step in converted(block)[0].program] == ["clamp"]
    node(user.node_tree, "ShaderNodeClamp").clamp_type = "RANGE"
    low, high, clamp = converted(block)[0].program
    assert (low["kind"], high["kind"], clamp["args"][1:]) == ("MINIMUM", "MAXIMUM", (0, 1))


def test_a_texture_in_a_group_uses_the_vector_of_the_group() -> None:
    """As in Cycles: the vector of the group counts even where nothing is linked to it."""
    block = material("Placed")
    user = grouped(block, ("Vector", "Color"), "TexChecker", "Vector")
    user.inputs[0].default_value = (0.5, 0.25, 0)
    (checker,) = [step for step in converted(block)[0].program if step["op"] == "checker"]
    assert checker["args"][0] == (0.5, 0.25, 0)


@pytest.mark.parametrize(
    ("space", "mode", "expected"),
    [
        ("sRGB", "STRAIGHT", (True, 0.25)),
        # Before Blender 5.0 bytes are multiplied by alpha, whatever is declared.
        ("sRGB", "PREMUL", (True, 0.5 if bpy.app.version >= (5, 0) else 0.25)),
        ("sRGB", "CHANNEL_PACKED", (False, 0.5)),
        ("sRGB", "NONE", (False, 0.5)),
        ("Linear Rec.709", "STRAIGHT", (True, 0.25)),
        ("Non-Color", "STRAIGHT", (False, 0.5)),
    ],
)
def test_colours_are_divided_by_alpha_only_where_it_is_in_them(
    space: str, mode: str, expected: tuple[bool, float]
) -> None:
    """As in Cycles. Alpha is one half."""
    picture = bpy.data.images.new("Leaf", 2, 2, alpha=True)
    picture.colorspace_settings.name, picture.alpha_mode = space, mode
    picture.pixels.foreach_set([0.5] * 16)  # last: another space generates it anew

    def textured(tree: Any) -> Any:
        texture = add(tree, "TexImage", image=picture).outputs
        return made("BsdfPrincipled", Base_Color=texture["Color"], Alpha=texture["Alpha"])(tree)

    block = tile_material("Cut out", textured)
    (step,) = [step for step in converted(block)[0].program if step["op"] == "image"]
    pixels = read_image(picture, Notes()).pixels
    assert (step["unassociate"], pixels[0, 0, 0]) == (expected[0], pytest.approx(255 * expected[1], abs=1))

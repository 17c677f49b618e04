# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes become closures and programs; unsupported ones are listed by material and raise nothing."""

from typing import Any

import bpy
import pytest

from addon.blender.read.images import Gallery
from addon.blender.read.materials import Palette
from addon.blender.read.world import read_world
from addon.core.base.notes import Notes
from addon.core.base.steps import completed
from tests.blender.atlas import add, made, number, tile_material
from tests.blender.read_materials import converted, inputs, nodes_group, plug
from tests.blender.shapes import material, node, world


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
    found = inputs(block)
    assert found["color"][:3] == pytest.approx((0.1, 0.2, 0.3))
    assert (found["metallic"], found["transmission"], found["weight"]) == (0.25, 0.5, 1)
    names = ("roughness", "ior", "specular", "alpha")
    assert [found[name] for name in names] == pytest.approx([0.75, 1.33, 0.2, 0.9])
    assert found["emission"] == pytest.approx((4, 2, 1))
    assert converted(block)[0].name == "All"


@pytest.mark.parametrize(
    ("node_type", "kind", "values", "expected"),
    [
        ("BsdfDiffuse", "diffuse", {"Color": (0.1, 0.2, 0.3, 1)}, {"color": (0.1, 0.2, 0.3, 1)}),
        ("BsdfAnisotropic", "glossy", {"Roughness": 0.125}, {"roughness": 0.125}),
        ("BsdfGlass", "glass", {"IOR": 1.25, "Roughness": 0}, {"ior": 1.25, "roughness": 0}),
        ("BsdfRefraction", "refraction", {"IOR": 1.25}, {"ior": 1.25}),
        ("Emission", "emission", {"Color": (1, 0.5, 0, 1), "Strength": 2}, {"emission": (2, 1, 0)}),
        ("BsdfSheen", "sheen", {"Roughness": 0.25}, {"roughness": 0.25}),
        ("BsdfToon", "toon_diffuse", {"Size": 0.25, "Smooth": 0.5}, {"roughness": 0.25, "smooth": 0.5}),
        ("Holdout", "holdout", {}, {"weight": 1.0}),
        ("BsdfTransparent", "transparent", {"Color": (1, 0.5, 0, 1)}, {"color": (1, 0.5, 0, 1)}),
    ],
)
def test_simple_shaders(node_type: str, kind: str, values: dict[str, Any], expected: dict[str, Any]) -> None:
    settings = {"distribution": "GGX"} if kind in ("glossy", "glass", "refraction") else {}
    found = inputs(tile_material("Simple", made(node_type, **settings, **values)), kind)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value), name


def test_facets_are_stretched_along_a_tangent_and_follow_the_distribution() -> None:
    block = tile_material("Brushed", made("BsdfAnisotropic", distribution="BECKMANN"))
    assert "tangent" not in inputs(block, "glossy")
    node(block.node_tree, "ShaderNodeBsdfAnisotropic").inputs["Anisotropy"].default_value = 0.5
    found, notes = converted(block)
    (closure,) = found.closures
    assert (closure.distribution, closure.multiscatter, notes) == ("beckmann", False, [])
    assert closure.inputs["anisotropy"] == pytest.approx(0.5)
    tangent = closure.inputs["tangent"]
    assert isinstance(tangent, int)
    assert found.program[tangent]["kind"] == "tangent_z"


def test_reroutes_groups_values_and_muted_nodes_are_followed() -> None:
    group = nodes_group("Color", "Shader", lambda tree, tint: made("BsdfDiffuse", tint)(tree))
    block = material("Routed")
    tree = block.node_tree
    user, colour, gamma = add(tree, "Group", node_tree=group), add(tree, "RGB"), add(tree, "Gamma")
    colour.outputs[0].default_value = (0.5, 0.25, 0.125, 1)
    gamma.mute = True
    tree.links.new(colour.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], user.inputs[0])
    bend = tree.nodes.new("NodeReroute")
    tree.links.new(user.outputs[0], bend.inputs[0])
    tree.links.new(bend.outputs[0], node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    assert inputs(block, "diffuse")["color"][:3] == pytest.approx((0.5, 0.25, 0.125))
    tree.links.remove(next(link for link in tree.links if link.to_node == user))
    user.inputs[0].default_value = (0.1, 0.2, 0.3, 1)
    assert inputs(block, "diffuse")["color"][:3] == pytest.approx((0.1, 0.2, 0.3))


@pytest.mark.parametrize("kind", ["RGB", "Gamma", "NewGeometry", "TexImage"])
def test_a_muted_node_that_passes_nothing_on_is_no_link(kind: str) -> None:
    """As in Cycles: the input at the end of its link keeps its own value."""
    block = material("Muted", Base_Color=(0.5, 0.25, 0.125, 1))
    muted = add(block.node_tree, kind)
    block.node_tree.links.new(muted.outputs[0], node(block.node_tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"])
    muted.mute = True
    assert inputs(block)["color"][:3] == pytest.approx((0.5, 0.25, 0.125))


def test_a_muted_shader_is_black() -> None:
    block = material("Muted", Base_Color=(0.5, 0.25, 0.125, 1))
    node(block.node_tree, "ShaderNodeBsdfPrincipled").mute = True
    assert (converted(block)[0].base_color, converted(block)[0].closures) == ((0, 0, 0), ())


@pytest.mark.parametrize("target", ["ALL", "CYCLES", "EEVEE"])
def test_an_output_for_another_engine_is_better_than_none(target: str) -> None:
    block = material("Aimed", Base_Color=(0.5, 0.25, 0.125, 1))
    node(block.node_tree, "ShaderNodeOutputMaterial").target = target
    assert inputs(block)["color"][:3] == pytest.approx((0.5, 0.25, 0.125))


def test_mixed_and_added_shaders_keep_their_shares() -> None:
    mix = made("MixShader", 0.25, made("BsdfDiffuse"), made("BsdfTransparent"))
    block = tile_material("Mixed", made("AddShader", mix, made("Emission")))
    found, notes = converted(block)
    shares = [("diffuse", 0.75), ("transparent", 0.25), ("emission", 1.0)]
    assert [(c.kind, c.inputs["weight"]) for c in found.closures] == shares
    assert (found.program, notes) == ((), [])
    tree = block.node_tree
    checker = add(tree, "TexChecker").outputs["Fac"]
    tree.links.new(checker, node(tree, "ShaderNodeMixShader").inputs[0])
    found, notes = converted(block)
    assert notes == []
    assert [step["op"] for step in found.program] == ["coordinate", "checker", "clamp", "math"]
    assert [c.inputs["weight"] for c in found.closures] == [3, 2, 1.0]


def test_an_unknown_node_leaves_the_input_at_its_value_and_is_listed() -> None:
    unknown = {"Base_Color": made("ShaderToRGB"), "Roughness": made("ShaderToRGB", output=1)}
    block = tile_material("Textured", made("BsdfPrincipled", **unknown))
    block.diffuse_color = (0.25, 0.5, 0.75, 1)
    shader = node(block.node_tree, "ShaderNodeBsdfPrincipled")
    found, notes = converted(block)
    values = found.closures[0].inputs
    assert values["color"] == (0.25, 0.5, 0.75)
    assert values["roughness"] == pytest.approx(shader.inputs["Roughness"].default_value)
    assert all("Textured" in line for line in notes)
    assert any("Shader to RGB" in line for line in notes)


def test_a_coat_over_emission_is_supported() -> None:
    found, notes = converted(material("Sign", Emission_Strength=2.0, Coat_Weight=0.5))
    assert notes == []
    assert found.closures[0].inputs["coat_weight"] == pytest.approx(0.5)


def test_a_picture_goes_through_mapping_ramp_and_mix() -> None:
    def pictured(tree: Any) -> Any:
        mapping = made("Mapping", made("UVMap", uv_map="Second"), Scale=(2, 3, 1))
        settings = {"image": bpy.data.images.new("Picture", 4, 2), "extension": "EXTEND", "interpolation": "Closest"}
        image = add(tree, "TexImage", mapping, **settings)
        ramp = made("ValToRGB", image.outputs["Color"])
        mix = made("Mix", *[None] * 6, ramp, data_type="RGBA", blend_type="MULTIPLY", output=2)
        return made("BsdfPrincipled", Base_Color=mix, Alpha=image.outputs["Alpha"])(tree)

    block = tile_material("Pictured", pictured)
    palette = Palette(Notes())
    completed(palette.read([block]))
    assert palette.layers.keys == [("uv", "Second")]
    found, notes = converted(block)
    assert notes == []
    ops = [step["op"] for step in found.program]
    assert ops == ["attribute", "matrix", "image", "luminance", "ramp", "mix", "alpha"]
    settings = found.program[2]
    assert (settings["extension"], settings["interpolation"], settings["unassociate"]) == ("extend", "closest", True)


def test_bad_nodes_make_remarks_not_exceptions() -> None:
    def broken(tree: Any) -> Any:
        a, b = add(tree, "Math"), add(tree, "Math")
        tree.links.new(a.outputs[0], b.inputs[0])
        tree.links.new(b.outputs[0], a.inputs[0])
        values = {"Base_Color": made("TexImage"), "Metallic": a.outputs[0], "Alpha": number(float("nan"))}
        return made("BsdfPrincipled", **values)(tree)

    found, notes = converted(tile_material("Broken", broken))
    assert found.closures[0].inputs["color"] == (1.0, 0.0, 1.0, 1.0)
    assert any("Broken" in line for line in notes)


def test_an_unknown_shader_becomes_a_diffuse_one_of_its_colour() -> None:
    found, notes = converted(tile_material("Specular", made("EeveeSpecular", Base_Color=(0.2, 0.5, 0.7, 1))))
    assert [closure.kind for closure in found.closures] == ["diffuse"]
    assert found.closures[0].inputs["color"] == pytest.approx((0.2, 0.5, 0.7, 1.0))
    (note,) = notes
    assert "Specular BSDF" in note


def test_subsurface_scattering_keeps_its_method_and_lets_objects_be_told_apart() -> None:
    block = material("Skin", Subsurface_Weight=0.5)
    palette = Palette(Notes())
    completed(palette.read([block]))
    assert palette.layers.apart
    shader = node(block.node_tree, "ShaderNodeBsdfPrincipled")
    older = "RANDOM_WALK_LEGACY" not in shader.bl_rna.properties["subsurface_method"].enum_items
    for method, expected in (
        ("RANDOM_WALK", "random_walk_legacy" if older else "random_walk"),
        ("RANDOM_WALK_SKIN", "random_walk_skin"),
        ("BURLEY", "random_walk_legacy"),
    ):
        shader.subsurface_method = method
        found, notes = converted(block)
        assert found.closures[0].method == expected
        assert found.closures[0].inputs["subsurface_weight"] == 0.5
        assert len(notes) == (method == "BURLEY")
    shader.inputs["Subsurface Weight"].default_value = 0
    found, notes = converted(block)
    assert "subsurface_weight" not in found.closures[0].inputs


def test_principled_hair_has_the_pigments_of_its_parametrisation() -> None:
    block = material("Hair")
    shader = plug(block, "ShaderNodeBsdfHairPrincipled")
    shader.inputs["Color"].default_value = (0.2, 0.5, 0.7, 1)

    def inputs() -> Any:
        found, notes = converted(block)
        assert notes == []
        assert found.strands is not None
        return found.closures[0].inputs

    assert inputs()["color"][:3] == pytest.approx((0.2, 0.5, 0.7))
    shader.parametrization = "MELANIN"
    shader.inputs["Melanin"].default_value = 0.3
    assert inputs()["melanin"] == pytest.approx(0.3)
    shader.parametrization = "ABSORPTION"
    shader.inputs["Absorption Coefficient"].default_value = (0.1, 0.2, 0.3)
    assert inputs()["absorption"] == pytest.approx((0.1, 0.2, 0.3))
    assert inputs()["color"] == 1.0
    shader.model = "HUANG"
    found, notes = converted(block)
    assert found.closures[0].kind == "hair"
    assert found.closures[0].inputs["radial_roughness"] == found.closures[0].inputs["roughness"]
    assert len(notes) == 1
    assert "Huang" in notes[0]


def test_a_shader_of_volumes_as_a_surface_falls_back_to_the_viewport_look() -> None:
    block = tile_material("Cut out", made("VolumeScatter"))
    block.diffuse_color = (0.25, 0.5, 0.75, 1)
    found, notes = converted(block)
    assert found.base_color == (0.25, 0.5, 0.75)
    (note,) = notes
    assert "Volume Scatter" in note


def test_materials_without_output_or_shader_are_black() -> None:
    block = material("Cut")
    block.node_tree.links.clear()
    assert converted(block)[0].base_color == (0, 0, 0)
    block.node_tree.nodes.clear()
    found, notes = converted(block)
    assert (found.base_color, found.name, notes) == ((0, 0, 0), "Cut", [])


def test_a_world_is_a_colour(scene: Any) -> None:
    background = world(0.5, 0.25, 0.125)
    background.inputs["Strength"].default_value = 2
    notes = Notes()
    assert read_world(scene.world, notes)[0].color == pytest.approx((1, 0.5, 0.25))
    assert not notes
    tree = scene.world.node_tree
    tree.links.new(add(tree, "ShaderToRGB").outputs[0], background.inputs["Color"])
    assert read_world(scene.world, notes)[0].color == pytest.approx((1, 0.5, 0.25))
    assert any("Shader to RGB" in line and "World" in line for line in notes.lines())
    assert read_world(None, notes)[0].color == (0, 0, 0)


def test_a_panorama_is_a_program_over_the_direction(scene: Any) -> None:
    background, tree = world(), scene.world.node_tree
    sky = add(tree, "TexEnvironment", image=bpy.data.images.new("Sky", 8, 4, float_buffer=True))
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    notes = Notes()
    found, images, _ = read_world(scene.world, notes, Gallery())
    assert [step["op"] for step in found.program] == ["coordinate", "image"]
    assert found.program[1]["projection"] == "panorama"
    assert (found.radiance, images, notes.lines()) == (1, {0}, [])


@pytest.mark.parametrize("by_reroute", [False, True])
def test_a_material_with_only_a_volume_lets_light_through(by_reroute: bool) -> None:
    """As in Cycles, where a surface without a shader has no effect."""
    block = tile_material("Fog", made("VolumePrincipled"))
    tree = block.node_tree
    output, volume = node(tree, "ShaderNodeOutputMaterial"), node(tree, "ShaderNodeVolumePrincipled")
    tree.links.remove(output.inputs["Surface"].links[0])
    if by_reroute:
        through = tree.nodes.new("NodeReroute")
        tree.links.new(volume.outputs[0], through.inputs[0])
        volume = through
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    found, notes = converted(block)
    (closure,) = found.closures
    assert closure.kind == "transparent"
    assert closure.inputs["color"] == (1.0, 1.0, 1.0)
    assert len(found.volume["closures"]) == 1
    assert not notes
    # With a surface shader that emits and scatters nothing, the material is black as before.
    plug(block, "ShaderNodeMixShader")
    found, _ = converted(block)
    assert not found.closures
    assert found.base_color == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("before", [0, 1])
@pytest.mark.parametrize("kind", ["BsdfPrincipled", "Emission"])
def test_a_computed_strength_multiplies_whichever_step_computes_it(kind: str, before: int) -> None:
    """The index of a step is no constant 0 or 1."""
    strength, color = ("Emission_Strength", "Emission_Color") if "Principled" in kind else ("Strength", "Color")
    total = made("Math") if before == 0 else made("Math", made("Math"))
    found, _ = converted(tile_material("Lamp", made(kind, **{strength: total, color: (1, 0.5, 0.25, 1)})))
    (closure,) = found.closures
    last = closure.inputs["emission"]
    assert isinstance(last, int)
    assert found.program[last]["op"] == "mix"
    assert found.program[last]["args"][1:] == ((1.0, 0.5, 0.25, 1.0), before)


def test_nested_mixes_multiply_whichever_step_is_a_factor() -> None:
    def nested(tree: Any) -> Any:
        facing = add(tree, "LayerWeight").outputs
        inner = made("MixShader", facing["Fresnel"], None, made("BsdfDiffuse"))
        return made("MixShader", facing["Facing"], None, inner)(tree)

    found, _ = converted(tile_material("Nested", nested))
    (closure,) = found.closures
    weight = closure.inputs["weight"]
    assert isinstance(weight, int)
    product = found.program[weight]
    assert product["kind"] == "MULTIPLY"
    factors = [found.program[index] for index in product["args"][:2]]
    assert [factor["op"] for factor in factors] == ["clamp", "clamp"]

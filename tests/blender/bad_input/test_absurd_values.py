# SPDX-License-Identifier: GPL-3.0-or-later
"""Absurd values of nodes, lights, images and views: a finite picture, and a line of the report for what is changed."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import add, made, number
from tests.blender.shapes import cube, grid, lamp, node, place, with_nodes, world

ODD = (math.nan, math.inf, -math.inf, -1e30, 1e30)
"""Values that no input expects. Blender stores infinity as the largest float."""

SHADERS: dict[str, tuple[dict[str, str], ...]] = {
    **dict.fromkeys(("BsdfPrincipled", "BsdfDiffuse", "BsdfTranslucent", "BsdfRefraction", "BsdfHair"), ({},)),
    **dict.fromkeys(("BsdfHairPrincipled", "BsdfTransparent", "BsdfRayPortal", "Emission", "Holdout"), ({},)),
    "BsdfAnisotropic": ({}, {"distribution": "BECKMANN"}, {"distribution": "ASHIKHMIN_SHIRLEY"}),
    "BsdfMetallic": ({}, {"fresnel_type": "PHYSICAL_CONDUCTOR"}),
    "BsdfGlass": ({}, {"distribution": "BECKMANN"}),
    "BsdfSheen": ({}, {"distribution": "ASHIKHMIN"}),
    "BsdfToon": ({}, {"component": "GLOSSY"}),
    "SubsurfaceScattering": ({}, {"falloff": "RANDOM_WALK_SKIN"}, {"falloff": "BURLEY"}),
}
"""Kinds of shaders of surfaces, and the choices to try with each."""

VOLUMES = ("VolumePrincipled", "VolumeScatter", "VolumeAbsorption", "VolumeCoefficients")
"""Kinds of shaders of volumes."""

NOT_FINITE = "A value that is not finite"

FLOOR = {"floor": made("BsdfDiffuse")}
"""A matte tile."""


@pytest.fixture(name="lit")
def lights(scene: Any) -> Any:
    """A scene with a dim world and a sun."""
    world()
    lamp("SUN", 3.0, "Sun", angle=0.5, rotation_euler=(0.6, 0.3, 0))
    return scene


def linked(kind: str, odd: float, **choices: str) -> atlas.Maker:
    """A shader all of whose inputs but normals have this value."""

    def make(tree: Any) -> Any:
        shader, value = add(tree, kind, **choices), number(odd)(tree)
        for socket in shader.inputs:
            if socket.enabled and socket.type in ("VALUE", "VECTOR", "RGBA") and "Normal" not in socket.name:
                tree.links.new(value, socket)
        return shader.outputs[0]

    return make


def known(kinds: Iterable[str]) -> list[str]:
    """The kinds of shaders that this Blender has."""
    return [kind for kind in kinds if hasattr(bpy.types, f"ShaderNode{kind}")]


def finite(scene: Any, family: dict[str, atlas.Maker], samples: int = 4, bounces: int = 3) -> atlas.Tiles:
    """The tiles, after a check that all their numbers are finite."""
    atlas.configure(scene, samples, bounces)
    tiles = atlas.rendered(scene, family, ENGINE)
    assert not [name for name, tile in tiles.items() if not np.isfinite(tile).all()]
    return tiles


def noted(scene: Any, *parts: str) -> bool:
    """Whether a warning of the last report has all these parts."""
    return any(all(part in line for part in parts) for line in atlas.warnings(scene))


@pytest.mark.parametrize("odd", [*ODD, -7.0, 1e-30])
def test_shaders_of_absurd_inputs_give_a_picture(lit: Any, odd: float) -> None:
    ways = [(kind, choices) for kind in known(SHADERS) for choices in SHADERS[kind]]
    family = {" ".join((kind, *choices.values())): linked(kind, odd, **choices) for kind, choices in ways}
    atlas.sheet(lit, family, cube(size=0.6))
    finite(lit, family)
    assert noted(lit, NOT_FINITE, "BsdfPrincipled") == math.isnan(odd)


@pytest.mark.parametrize("odd", ODD)
def test_volumes_of_absurd_inputs_give_a_picture(lit: Any, odd: float) -> None:
    family = {kind: linked(kind, odd) for kind in known(VOLUMES)}
    atlas.sheet(lit, family, cube(size=0.6))
    for material in bpy.data.materials:
        tree = material.node_tree
        output = node(tree, "ShaderNodeOutputMaterial")
        link = output.inputs["Surface"].links[0]
        tree.links.new(link.from_socket, output.inputs["Volume"])
        tree.links.remove(link)
    finite(lit, family)
    assert noted(lit, NOT_FINITE) == math.isnan(odd)
    assert noted(lit, "negative coefficient") == (odd < 0)


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Blender 4.5 has no Raycast")
def test_rays_without_a_direction_hit_nothing(lit: Any) -> None:
    odd = (0.0, math.nan, math.inf, 1e-42)
    family = {str(x): made("Raycast", Length=2.0, Direction=number(x), output="Hit Distance") for x in odd}
    atlas.sheet(lit, family, grid(1))
    assert all((tile == 2.0).all() for tile in finite(lit, family, samples=1).values())
    assert noted(lit, NOT_FINITE, "nan")


@pytest.mark.parametrize("bounces", [0, 64])
def test_portals_that_lead_into_each_other_end(lit: Any, bounces: int) -> None:
    def to(height: float, up: float) -> atlas.Maker:
        position, direction = made("CombineXYZ", 0.5, 0.5, height), made("CombineXYZ", 0.0, 0.0, up)
        return made("BsdfRayPortal", Position=position, Direction=direction)

    # Rays that enter the tile go up to the plate, and those go down to the tile.
    family = {"loop": to(0.5, 1.0)}
    atlas.sheet(lit, family, grid(1))
    plate = atlas.tile_material("Plate", to(0.25, -1.0))
    place("Plate", grid(1), plate, location=(0.5, 0.5, 1.0), scale=(0.4, 0.4, 1.0))
    assert (finite(lit, family, bounces=bounces)["loop"] == 0).any(), "the path ends without light"


@pytest.mark.parametrize("odd", [*ODD, -1.0, 0.0])
def test_falloffs_of_absurd_strength_give_a_picture(lit: Any, odd: float) -> None:
    atlas.sheet(lit, FLOOR, grid(1))
    for kind in ("POINT", "SPOT", "AREA", "SUN"):
        light = lamp(kind, 1.0, kind, location=(0.5, 0.5, 2)).data
        with_nodes(light)
        falloff = made("LightFalloff", Strength=number(odd), Smooth=number(odd), output="Linear")
        tree = light.node_tree
        tree.links.new(falloff(tree), node(tree, "ShaderNodeEmission").inputs["Strength"])
    tile = finite(lit, FLOOR)["floor"]
    assert noted(lit, NOT_FINITE) == math.isnan(odd)
    assert noted(lit, "power that is too large", "SUN") == (abs(odd) > 1e20), "a sun has no distance to fall off with"
    if odd == 0.0:
        assert 0.1 < tile.mean() < 2.0, "the other lights shine"
    if odd == -1.0:
        assert tile.mean() < 0.7, "negative light is subtracted"


@pytest.mark.parametrize("odd", [*ODD, 0.0])
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
def test_lights_of_absurd_power_and_size_give_a_picture(lit: Any, kind: str, odd: float) -> None:
    atlas.sheet(lit, FLOOR, grid(1))
    for i, (energy, size) in enumerate(((odd, 0.1), (1.0, odd), (odd, odd))):
        light = lamp(kind, energy, f"{kind} {i}", location=(0.5, 0.5, 2)).data
        for name in ("shadow_soft_size", "size", "angle", "spot_size", "spot_blend", "spread"):
            if hasattr(light, name):
                setattr(light, name, size)
    tile = finite(lit, FLOOR)["floor"]
    if not math.isfinite(odd):
        assert noted(lit, "Dropped, the power is not finite", f"{kind} 0")
    elif odd == 0.0:
        assert tile.mean() > 0.5, "the sun still shines"
    else:
        assert noted(lit, "power that is too large", f"{kind} 0")


@pytest.mark.parametrize("odd", [*ODD, 0.0])
def test_worlds_of_absurd_strength_give_a_picture(lit: Any, odd: float) -> None:
    tree = lit.world.node_tree
    tree.links.new(number(odd)(tree), node(tree, "ShaderNodeBackground").inputs["Strength"])
    atlas.sheet(lit, FLOOR, grid(1))
    finite(lit, FLOOR)
    assert noted(lit, "radiance that is too large", "World") == (abs(odd) > 1e20)


def test_images_without_pixels_are_pink_and_named(lit: Any, tmp_path: Path) -> None:
    (tmp_path / "empty.png").write_bytes(b"")
    family: dict[str, atlas.Maker] = {}
    for name in ("empty.png", "missing.exr"):
        image = bpy.data.images.new(name, 1, 1)
        image.source, image.filepath = "FILE", str(tmp_path / name)
        family[name] = made("TexImage", image=image)
    atlas.sheet(lit, family, grid(1))
    for name, tile in finite(lit, family, samples=1).items():
        assert np.allclose(tile, (1, 0, 1)), name
        assert noted(lit, name), name


def test_groups_that_are_linked_in_a_circle_are_named(lit: Any) -> None:
    def circle(tree: Any) -> Any:
        inner = bpy.data.node_groups.new("Circle", "ShaderNodeTree")
        for way in ("INPUT", "OUTPUT"):
            inner.interface.new_socket("Value", in_out=way, socket_type="NodeSocketFloat")
        inner.links.new(inner.nodes.new("NodeGroupInput").outputs[0], inner.nodes.new("NodeGroupOutput").inputs[0])
        group = tree.nodes.new("ShaderNodeGroup")
        group.node_tree = inner
        tree.links.new(group.outputs[0], group.inputs[0])
        return made("Emission", Strength=group.outputs[0])(tree)

    family = {"circle": circle}
    atlas.sheet(lit, family, grid(1))
    finite(lit, family, samples=1)
    assert noted(lit, "A chain of more than", "circle")


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Blender 4.5 reads no pixels of a file that names one view")
@pytest.mark.parametrize("name", ["left", "right"])
def test_a_view_that_is_not_used_is_not_rendered(lit: Any, name: str) -> None:
    atlas.sheet(lit, FLOOR, grid(1))
    atlas.configure(lit, 1, 0)
    lit.render.engine = ENGINE
    lit.render.use_multiview = True
    shape = (atlas.TILE, atlas.TILE)
    both = pictures.render(lit)
    assert both.shape[:2] == (shape[0], 2 * shape[1])
    lit.render.views[name].use = False
    one = pictures.render(lit)
    assert one.shape[:2] == shape
    half = slice(shape[1], None) if name == "left" else slice(0, shape[1])
    assert np.array_equal(one, both[:, half])

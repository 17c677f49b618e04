# SPDX-License-Identifier: GPL-3.0-or-later
"""Displaced and bumped surfaces, and lights with spread or as spheres, compared with Cycles."""

from __future__ import annotations

import math
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import add as node
from tests.blender.rounds import camera
from tests.blender.shapes import grid, material, with_nodes


@pytest.fixture(autouse=True)
def view(scene: Any) -> None:
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    camera(scene, distance=6.0, width=64)
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)


def lamp(scene: Any, kind: str, location: Any, energy: float, **settings: Any) -> Any:
    """A light that shines towards the origin."""
    data = bpy.data.lights.new("Lamp", kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    item = bpy.data.objects.new("Lamp", data)
    item.location = location
    item.rotation_euler = (
        math.atan2(math.hypot(*location[:2]), location[2]),
        0,
        math.atan2(location[1], location[0]) + math.pi / 2,
    )
    scene.collection.objects.link(item)
    return item


def floor(add: Any, segments: int = 2, size: float = 2.0) -> Any:
    """A matte plane."""
    mesh = grid(segments)
    mesh.materials.append(atlas.tile_material("Matte", lambda tree: node(tree, "BsdfDiffuse").outputs[0]))
    return add("Floor", mesh, scale=(size, size, 1))


def compared(scene: Any, samples: int = 64) -> tuple[Any, Any]:
    atlas.configure(scene, samples, 1)
    found = []
    for engine in (ENGINE, "CYCLES"):
        scene.render.engine = engine
        found.append(pictures.render(scene)[..., :3].astype(float))
    return found[0], found[1]


def assert_alike(ours: Any, theirs: Any, share: float = 0.01, alike: float = 0.98) -> None:
    mean, expected = (picture.mean(axis=(0, 1)) for picture in (ours, theirs))
    assert expected.max() > 0.01
    assert np.abs(mean - expected).max() <= share * expected.max(), (mean, expected)
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > alike


@pytest.mark.parametrize("method", ["DISPLACEMENT", "BUMP"])
@pytest.mark.parametrize("space", ["OBJECT", "WORLD"])
def test_displaced_surfaces(add: Any, scene: Any, method: str, space: str) -> None:
    item = floor(add, 60)
    material = item.data.materials[0]
    material.displacement_method = method
    tree = material.node_tree
    noise, up = node(tree, "TexNoise", Scale=3.0), node(tree, "Displacement", space=space, Scale=0.4)
    tree.links.new(noise.outputs[0], up.inputs["Height"])
    tree.links.new(node(tree, "TexCoord").outputs["Object"], noise.inputs["Vector"])
    tree.links.new(up.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    item.scale = (2, 2, 1.5)
    lamp(scene, "SUN", (3, 2, 4), 3.0)
    assert_alike(*compared(scene))


@pytest.mark.parametrize("kind", ["CATMULL_CLARK", "SIMPLE"])
def test_diced_surfaces(add: Any, scene: Any, kind: str) -> None:
    item = floor(add, 4)
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels, modifier.subdivision_type = 1, kind
    material = item.data.materials[0]
    material.displacement_method = "DISPLACEMENT"
    tree = material.node_tree
    noise, up = node(tree, "TexNoise", Scale=3.0), node(tree, "Displacement", Scale=0.4)
    tree.links.new(noise.outputs[0], up.inputs["Height"])
    tree.links.new(node(tree, "TexCoord").outputs["Object"], noise.inputs["Vector"])
    tree.links.new(up.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    lamp(scene, "SUN", (3, 2, 4), 3.0)
    coarse, _ = compared(scene, 16)
    if hasattr(modifier, "use_adaptive_subdivision"):
        modifier.use_adaptive_subdivision = True
    else:
        scene.cycles.feature_set, item.cycles.use_adaptive_subdivision = "EXPERIMENTAL", True
    ours, theirs = compared(scene)
    assert_alike(ours, theirs)
    assert np.corrcoef(coarse.ravel(), theirs.ravel())[0, 1] < np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] - 0.02


@pytest.mark.parametrize("degrees", [0, 20, 60, 120, 180])
@pytest.mark.parametrize("shape", ["SQUARE", "DISK"])
def test_spread_of_area_lights(add: Any, scene: Any, degrees: float, shape: str) -> None:
    floor(add)
    lamp(scene, "AREA", (0.4, 0.2, 1.5), 20.0, shape=shape, size=0.8, spread=math.radians(degrees))
    assert_alike(*compared(scene, 256 if degrees < 30 else 64))


@pytest.mark.parametrize("kind", ["POINT", "SPOT"])
@pytest.mark.parametrize("soft", [True, False])
def test_falloff_of_lights_with_a_radius(add: Any, scene: Any, kind: str, soft: bool) -> None:
    floor(add)
    energy = 20.0 if kind == "POINT" else 200.0
    light = lamp(scene, kind, (0.5, 0.3, 0.7), energy, shadow_soft_size=0.6, use_soft_falloff=soft)
    light.rotation_euler = (0, 0, 0)
    assert_alike(*compared(scene, 128))


def test_a_light_that_a_plane_cuts(add: Any, scene: Any) -> None:
    floor(add)
    lamp(scene, "POINT", (0.5, 0.3, 0.2), 20.0, shadow_soft_size=0.6, use_soft_falloff=False)
    assert_alike(*compared(scene, 256), share=0.02)


def linked(name: str, *items: Any, state: str = "INCLUDE") -> Any:
    """A collection of these objects for light linking."""
    collection = bpy.data.collections.new(name)
    for item in items:
        collection.objects.link(item)
    for entry in collection.collection_objects:
        entry.light_linking.link_state = state
    return collection


@pytest.mark.parametrize("state", ["INCLUDE", "EXCLUDE"])
@pytest.mark.parametrize("kind", ["receiver", "blocker"])
def test_linked_lights(add: Any, scene: Any, state: str, kind: str) -> None:
    floor(add)
    balls = []
    for k, x in enumerate((-1.0, 1.0)):
        ball = grid(2, f"Tile {k}")
        ball.materials.append(bpy.data.materials[0])
        balls.append(add(f"Tile {k}", ball, location=(x, 0.2, 0.5), scale=(0.5, 0.5, 1)))
    for number, (place, size) in enumerate((((0.2, 0.3, 2.0), 0.2), ((-1.0, -1.0, 1.5), 0.0))):
        light = lamp(scene, "POINT", place, 60.0, shadow_soft_size=size)
        if number == 0:
            setattr(light.light_linking, f"{kind}_collection", linked("Linked", balls[0], state=state))
    assert_alike(*compared(scene, 128))


@pytest.mark.parametrize("state", ["INCLUDE", "EXCLUDE"])
@pytest.mark.parametrize("kind", ["receiver", "blocker"])
def test_linked_glowing_objects(add: Any, scene: Any, state: str, kind: str) -> None:
    floor(add)
    tiles = []
    for k, x in enumerate((-1.0, 1.0)):
        tile = grid(2, f"Tile {k}")
        tile.materials.append(bpy.data.materials[0])
        tiles.append(add(f"Tile {k}", tile, location=(x, 0.2, 0.5), scale=(0.5, 0.5, 1)))
    for number, (x, strength) in enumerate(((-0.9, 8.0), (1.2, 3.0))):
        sheet = grid(1, f"Sheet {number}")
        sheet.materials.append(material(f"Glow {number}", Emission_Strength=strength))
        item = add(f"Sheet {number}", sheet, location=(x, -0.3, 1.2), scale=(0.3, 0.2, 1))
        if number == 0:
            setattr(item.light_linking, f"{kind}_collection", linked("Linked", tiles[0], state=state))
    assert_alike(*compared(scene, 128))

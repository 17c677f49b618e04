# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked pictures compared with those of Cycles."""

from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.shapes import cube, grid, lamp, look, material, node, place, world

SIZE = 32
"""Pixels along a side of a baked picture."""


def target(item: Any, name: str) -> Any:
    """A new image that is baked into: the active node of each of the object's materials."""
    image = bpy.data.images.new(name, SIZE, SIZE, float_buffer=True, alpha=True)
    image.colorspace_settings.name = "Non-Color"
    for slot in item.material_slots:
        tree = slot.material.node_tree
        texture = tree.nodes.get("Target") or tree.nodes.new("ShaderNodeTexImage")
        texture.name, texture.image = "Target", image
        tree.nodes.active = texture
    return image


def bake(engine: str, wanted: str, active: Any, *others: Any, **options: Any) -> Any:
    """The picture of the active object that an engine bakes, (SIZE, SIZE, 3)."""
    bpy.context.scene.render.engine = engine
    image = target(active, f"{engine} {wanted}")
    bpy.ops.object.select_all(action="DESELECT")
    for item in (active, *others):
        item.select_set(True)
    bpy.context.view_layer.objects.active = active
    assert bpy.ops.object.bake(type=wanted, margin=0, **options) == {"FINISHED"}
    return np.array(image.pixels[:]).reshape(SIZE, SIZE, 4)[..., :3]


@pytest.fixture
def stage(scene: Any) -> Any:
    """A mirrored box with UVs next to a wall, in the light of a lamp, a coloured floor and a world. Returns the box."""
    atlas.with_cycles(scene)
    paint = material("Paint", Base_Color=(0.2, 0.5, 0.7, 1), Roughness=0.35, Transmission_Weight=0.2)
    shader = node(paint.node_tree, "ShaderNodeBsdfPrincipled")
    shader.inputs["Emission Strength"].default_value = 0.3
    shader.inputs["Emission Color"].default_value = (0.9, 0.4, 0.1, 1)
    turned = {"location": (0.3, -0.2, 1.1), "rotation_euler": (0.1, 0.2, 0.4), "scale": (-1, 1, 0.8)}
    item = place("Box", cube("Box", 1.6), paint, **turned)
    red, green = (
        material("Wall", Base_Color=color, Roughness=1.0) for color in ((0.8, 0.3, 0.2, 1), (0.2, 0.7, 0.3, 1))
    )
    place("Floor", grid(1, "Floor"), red, scale=(4, 4, 1))
    place("Wall", grid(1, "Wall"), green, location=(-1.6, 0, 1), rotation_euler=(0, 1.57, 0))
    lamp("AREA", 250.0, size=1.0, location=(-2.5, -1, 4), rotation_euler=(0.2, -0.5, 0))
    world(0.3, 0.4, 0.5)
    scene.world.light_settings.distance = scene.halfspace.ambient_distance = 3.0
    look((SIZE, SIZE), (0, -8, 4), 1.1)
    atlas.configure(scene, 16, 3)
    return item


EXACT = ("NORMAL", "POSITION", "ROUGHNESS", "EMIT", "ENVIRONMENT")
"""Bakes without noise."""

SAMPLES = 64
"""Samples of bakes with noise."""


@pytest.mark.parametrize("wanted", EXACT)
def test_surfaces_are_baked_as_in_cycles(stage: Any, wanted: str) -> None:
    atlas.configure(bpy.context.scene, 1, 0)  # further samples lie elsewhere in their pixels
    stage.data.polygons.foreach_set("use_smooth", [True] * 6)
    options = {"normal_space": "OBJECT"} if wanted == "NORMAL" else {}
    ours, theirs = (bake(engine, wanted, stage, **options) for engine in (ENGINE, "CYCLES"))
    assert (theirs.max(axis=2) > 0.1).mean() > 0.3
    assert np.abs(ours - theirs).max() < 2e-3


def test_uvs_are_the_places_of_their_pixels(stage: Any) -> None:
    """Cycles bakes zeros."""
    atlas.configure(bpy.context.scene, 1, 0)
    found = bake(ENGINE, "UV", stage)
    y, x = np.indices((SIZE, SIZE))
    inside = found[..., 2] > 0
    assert inside.mean() > 0.3
    wanted = np.dstack([x + 0.5, y + 0.5]) / SIZE
    assert np.abs(found[..., :2] - wanted)[inside].max() < 1e-4


@pytest.mark.parametrize(
    ("wanted", "contents"),
    [
        ("COMBINED", None),
        ("COMBINED", {"DIRECT", "INDIRECT", "DIFFUSE", "EMIT"}),
        ("DIFFUSE", {"DIRECT", "INDIRECT", "COLOR"}),
        ("DIFFUSE", {"DIRECT"}),
        ("TRANSMISSION", {"COLOR"}),
        ("GLOSSY", {"DIRECT", "INDIRECT", "COLOR"}),
        ("AO", None),
    ],
)
def test_light_is_baked_as_in_cycles(stage: Any, wanted: str, contents: set[str] | None) -> None:
    atlas.configure(bpy.context.scene, SAMPLES, 3)
    options = {} if contents is None else {"pass_filter": contents}
    ours, theirs = (bake(engine, wanted, stage, **options) for engine in (ENGINE, "CYCLES"))
    assert theirs.mean() > 0.003
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 0.01 * theirs.mean() + 1e-3
    # Squares of 8 × 8 pixels have little noise.
    a, b = (one.reshape(4, 8, 4, 8, 3).mean(axis=(1, 3)) for one in (ours, theirs))
    assert np.abs(a - b).max() < 0.06 * theirs.mean() + 0.02


def test_other_surfaces_are_baked_into_the_active_one(stage: Any) -> None:
    around = place("Shell", cube("Shell", 2.4), material("Shell"), location=stage.location)
    options: dict[str, Any] = {"use_selected_to_active": True, "cage_extrusion": 0.3, "pass_filter": {"COLOR"}}
    ours, theirs = (bake(engine, "DIFFUSE", around, stage, **options) for engine in (ENGINE, "CYCLES"))
    assert (theirs.max(axis=2) > 0.1).mean() > 0.15
    assert np.abs(ours - theirs).max() < 0.02


def test_shadows_are_the_share_of_light_that_arrives(stage: Any) -> None:
    atlas.configure(bpy.context.scene, SAMPLES, 0)
    floor = bpy.data.objects["Floor"]
    uv = floor.data.uv_layers.new(name="UVMap")
    corners = [floor.data.vertices[loop.vertex_index].co for loop in floor.data.loops]
    uv.uv.foreach_set("vector", np.array([(0.5 + co.x / 2, 0.5 + co.y / 2) for co in corners], np.float32).ravel())
    shadow = bake(ENGINE, "SHADOW", floor)
    assert shadow.max() <= 1
    assert shadow.min() < 0.2, "below the box"
    assert (shadow > 0.95).mean() > 0.3


def test_the_camera_may_see_the_surface(stage: Any) -> None:
    atlas.configure(bpy.context.scene, SAMPLES, 1)
    bpy.context.scene.render.bake.view_from = "ACTIVE_CAMERA"
    ours, theirs = (bake(engine, "GLOSSY", stage) for engine in (ENGINE, "CYCLES"))
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 0.02 * theirs.mean()


def test_a_bake_that_fails_says_why_in_one_line(stage: Any) -> None:
    bpy.context.scene.camera.location.x = float("nan")
    with pytest.raises(RuntimeError, match="camera: its transform, lens or shift is not finite"):
        bake(ENGINE, "COMBINED", stage)

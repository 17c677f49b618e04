# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that Cycles stores, or that only Cycles had: with each, pictures are those of Cycles."""

from __future__ import annotations

from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from shapes import cube, grid, material, node, with_nodes

from addon.blender.measure import pictures

SIZE, SAMPLES = 24, 256


@pytest.fixture(name="stage")
def staged(scene: Any, add: Any) -> Any:
    """A parallel camera above a dark world."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    shine(scene, 0.0)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 2.0
    scene.camera = add("Camera", camera, location=(0, 0, 8))
    render = scene.render
    render.resolution_x = render.resolution_y = SIZE
    render.resolution_percentage = 100
    atlas.configure(scene, SAMPLES, 4)
    return scene


def shine(scene: Any, strength: float, *, varying: bool = False) -> None:
    """Set the strength of the world."""
    tree = scene.world.node_tree
    background = node(tree, "ShaderNodeBackground")
    background.inputs["Strength"].default_value = strength
    if varying:
        gradient, place = tree.nodes.new("ShaderNodeTexGradient"), tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(place.outputs["Generated"], gradient.inputs[0])
        tree.links.new(gradient.outputs[0], background.inputs["Color"])


def clear(share: float) -> Any:
    """A material through which this share of the light passes."""
    made = material("Clear")
    tree = made.node_tree
    tree.nodes.clear()
    output, shader = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeBsdfTransparent")
    shader.inputs["Color"].default_value = (share, share, share, 1)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def sheets(add: Any, count: int, size: float = 8.0) -> None:
    """Clear sheets above each other."""
    mesh = grid(1, smooth=False)
    mesh.materials.append(clear(0.9))
    for i in range(count):
        add("Sheet", mesh, location=(0, 0, 0.5 + 0.1 * i), scale=(size, size, 1))


def floor(add: Any, **inputs: Any) -> Any:
    mesh = grid(1, smooth=False)
    mesh.materials.append(material("Floor", Specular_IOR_Level=0.0, **inputs))
    return add("Floor", mesh)


def lamp(add: Any, kind: str, energy: float, **properties: Any) -> Any:
    data = bpy.data.lights.new(kind, kind)
    data.energy = energy
    return add(kind, data, **properties)


def room(scene: Any, add: Any) -> None:
    """The inside of a box, seen from it, without one wall."""
    whole, mesh = cube(size=4.0), bpy.data.meshes.new("Walls")
    faces = [tuple(face.vertices) for face in whole.polygons if face.normal.x < 0.5]
    mesh.from_pydata([tuple(one.co) for one in whole.vertices], [], faces)
    mesh.materials.append(material("Walls", Specular_IOR_Level=0.0))
    add("Walls", mesh)
    scene.camera.location.z, scene.camera.data.type = 1.5, "PERSP"


def mean(scene: Any, engine: str) -> Any:
    """Mean colour and alpha of the picture of an engine."""
    scene.render.engine = engine
    return pictures.render(scene).mean(axis=(0, 1))


def agree(scene: Any, *, within: float = 0.01) -> Any:
    """Our mean colour and alpha, which must be those of Cycles."""
    ours, theirs = mean(scene, "HALFSPACE"), mean(scene, "CYCLES")
    assert ours == pytest.approx(theirs, rel=within, abs=1e-3)
    return ours


@pytest.mark.parametrize("count", [7, 8, 9])
@pytest.mark.parametrize("below", ["sky", "glow", "matte", "film"])
def test_as_many_transparent_surfaces_are_passed(stage: Any, add: Any, count: int, below: str) -> None:
    passed = 7 if below == "matte" else 8
    if bpy.app.version < (5, 0) and count == passed + 1:
        pytest.skip("Cycles 4.5 lets camera rays pass one surface more, shadow rays as many")
    stage.halfspace.samples = stage.cycles.samples = 64
    stage.render.film_transparent = below == "film"
    if below in ("sky", "film"):
        shine(stage, 1.0)
    elif below == "glow":
        floor(add, Base_Color=(0, 0, 0, 1), Emission_Strength=1.0)
    else:
        floor(add)
        lamp(add, "SUN", 3.0).data.use_shadow = False
    sheets(add, count)
    found = agree(stage)
    seen = found[3] < 1 if below == "film" else found[0] > 0
    assert seen == (count <= passed)


@pytest.mark.parametrize(("count", "most"), [(6, 12), (7, 12), (7, 14), (8, 15), (8, 16)])
def test_shadow_rays_pass_as_many_as_their_paths_left(stage: Any, add: Any, count: int, most: int) -> None:
    stage.halfspace.samples = stage.cycles.samples = 64
    stage.cycles.transparent_max_bounces = most
    floor(add)
    lamp(add, "SUN", 3.0)
    sheets(add, count)
    assert (agree(stage)[0] > 0) == (2 * count <= most)


def test_a_transparent_surface_may_have_an_opaque_shadow(stage: Any, add: Any) -> None:
    floor(add)
    lamp(add, "SUN", 3.0, rotation_euler=(0.3, 0, 0))
    sheets(add, 1, 0.5)
    before = agree(stage)
    bpy.data.materials["Clear"].use_transparent_shadow = False
    assert agree(stage)[0] < 0.99 * before[0]


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
@pytest.mark.parametrize("bounces", [0, 1, 2])
def test_light_samples_see_a_light_up_to_its_bounces(stage: Any, add: Any, kind: str, bounces: int) -> None:
    room(stage, add)
    light = lamp(add, kind, 30.0, location=(0.5, 0.5, 1.2), rotation_euler=(0, 1.1 if kind == "SUN" else 0, 0)).data
    if kind == "AREA":
        light.size = 1.5
    before = mean(stage, "HALFSPACE")
    light.cycles.max_bounces = bounces
    assert agree(stage)[0] < 0.99 * before[0]


@pytest.mark.parametrize("varying", [False, True])
def test_light_samples_of_the_world(stage: Any, add: Any, varying: bool) -> None:
    room(stage, add)
    shine(stage, 1.0, varying=varying)
    before = agree(stage)
    cycles = stage.world.cycles
    cycles.max_bounces = 0
    limited = agree(stage, within=0.02)
    assert (limited[0] < 0.99 * before[0]) == varying
    cycles.max_bounces = 1024
    if hasattr(cycles, "use_shadows"):
        cycles.use_shadows = False
        assert (agree(stage, within=0.02)[0] > 1.1 * before[0]) == varying
        cycles.sampling_method = "NONE"
        assert agree(stage)[0] == pytest.approx(before[0], rel=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_the_offset_of_shadow_terminators(stage: Any, add: Any, offset: float) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=6, ring_count=4, radius=0.9)
    ball = bpy.context.object
    ball.data.polygons.foreach_set("use_smooth", [True] * len(ball.data.polygons))
    ball.data.materials.append(material("Ball", Specular_IOR_Level=0.0))
    lamp(add, "SUN", 3.0, rotation_euler=(1.57, 0, 0.3)).data.angle = 0.0
    before = agree(stage)
    ball.shadow_terminator_geometry_offset = offset
    assert (agree(stage)[0] < 0.99 * before[0]) == (offset == 0)


@pytest.mark.parametrize("roughness", [0.0, 0.05, 0.3])
def test_a_transparent_film_sees_through_glass(stage: Any, add: Any, roughness: float) -> None:
    shine(stage, 1.0)
    stage.render.film_transparent = True
    ball = cube(size=1.2)
    look = {"Transmission_Weight": 1.0, "Roughness": roughness, "Base_Color": (0.5, 0.9, 0.9, 1)}
    ball.materials.append(material("Glass", **look))
    add("Glass", ball, rotation_euler=(0.3, 0.2, 0.0))
    before = agree(stage)
    stage.cycles.film_transparent_glass, stage.cycles.film_transparent_roughness = True, 0.1
    found = agree(stage)
    assert (found[3] < 0.95 * before[3]) == (roughness < 0.1)


@pytest.mark.parametrize(
    ("place", "by", "kept"),
    [
        ((1.5, 0, 1), {"camera": 0.1}, True),
        ((2.5, 0, 1), {"camera": 0.1}, False),
        ((2.5, 0, 1), {"camera": 2.0}, True),
        ((0, 0, 12), {"camera": 0.1}, False),
        ((0, 0, 12), {"distance": 5.0}, True),
        ((0, 0, 12), {"distance": 2.0}, False),
        ((2.5, 0, 1), {"camera": 0.1, "distance": 50.0}, True),
        ((2.5, 0, 1), {"camera": 0.1, "distance": 2.0}, False),
    ],
)
@pytest.mark.parametrize("kind", ["ORTHO", "PERSP"])
def test_objects_out_of_view_are_left_out(
    stage: Any, add: Any, place: Any, by: dict[str, float], kept: bool, kind: str
) -> None:
    floor(add)
    glow = cube(size=0.8)
    glow.materials.append(material("Glow", Emission_Strength=20.0))
    item = add("Glow", glow, location=place)
    camera = stage.camera.data
    camera.type, camera.angle = kind, 0.3  # both see two units at the floor
    stage.render.use_simplify = True
    for name, margin in by.items():
        setattr(stage.cycles, f"use_{name}_cull", True)
        setattr(stage.cycles, f"{name}_cull_margin", margin)
        setattr(item.cycles, f"use_{name}_cull", True)
    if kind == "PERSP" and place[2] == 1 and by.get("camera") == 0.1:
        item.location.x *= 0.95
    # Cycles leaves nothing out that is behind a parallel camera.
    kept = kept or (kind == "ORTHO" and place[2] > 8 and "camera" in by)
    assert (agree(stage, within=0.03)[0] > 1e-3) == kept


@pytest.mark.parametrize("switch", ["use_motion_blur", "use_deform_motion"])
def test_an_object_may_have_no_motion_blur(stage: Any, add: Any, switch: str) -> None:
    shine(stage, 0.1)
    mesh = cube(size=0.6)
    mesh.materials.append(material("Glow", Emission_Strength=1.0))
    item = add("Cube", mesh)
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="Long")
    for point in key.data:
        point.co.y *= 3
    for frame, value in enumerate((0.0, 0.5, 1.0)):
        key.value, item.location.x = value, value - 0.5
        key.keyframe_insert("value", frame=frame)
        item.keyframe_insert("location", frame=frame)
    stage.frame_set(1)
    stage.render.use_motion_blur, stage.render.motion_blur_shutter = True, 1.0
    stage.halfspace.motion_steps = 32
    blurred = mean(stage, "HALFSPACE")
    setattr(item.cycles, switch, False)
    found = []
    for engine in ("HALFSPACE", "CYCLES"):
        stage.render.engine = engine
        found.append(pictures.render(stage)[..., 0].astype(float))
    ours, theirs = found
    assert ((ours - theirs) ** 2).mean() ** 0.5 < 0.1 * theirs.std()
    stage.view_layers[0].use_motion_blur = False
    still = pictures.render(stage)[..., 0] if stage.render.engine == "CYCLES" else None
    stage.render.engine = "HALFSPACE"
    assert still is not None
    assert np.sqrt(((pictures.render(stage)[..., 0] - still) ** 2).mean()) < 0.1 * still.std()
    assert blurred[0] > 0


@pytest.mark.parametrize("space", ["TANGENT", "OBJECT", "WORLD"])
def test_a_normal_map_with_the_green_of_directx(stage: Any, add: Any, space: str) -> None:
    block = cube()
    block.materials.append(material("Block", Specular_IOR_Level=0.0))
    add("Block", block)
    tree = block.materials[0].node_tree
    bent = tree.nodes.new("ShaderNodeNormalMap")
    if "convention" not in bent.bl_rna.properties:
        pytest.skip("new in Blender 5")
    bent.space, bent.inputs["Color"].default_value = space, (0.6, 0.8, 0.8, 1)
    tree.links.new(bent.outputs[0], node(tree, "ShaderNodeBsdfPrincipled").inputs["Normal"])
    lamp(add, "SUN", 3.0, rotation_euler=(-0.4, 0.1, 0))
    before = agree(stage)
    bent.convention = "DIRECTX"
    assert abs(agree(stage)[0] / before[0] - 1) > 0.1

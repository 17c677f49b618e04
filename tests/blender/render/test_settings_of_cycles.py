# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that Cycles stores, or that only Cycles had: with each, pictures are those of Cycles."""

from typing import Any

import bpy
import pytest

from addon.blender.measure import pictures
from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.shapes import cube, grid, lamp, look, material, node, place, world

SIZE, SAMPLES = 24, 256


@pytest.fixture(name="stage")
def staged(scene: Any) -> Any:
    """A parallel camera above a dark world."""
    atlas.with_cycles(scene)
    world()
    shine(scene, 0.0)
    look((SIZE, SIZE), (0, 0, 8), type="ORTHO", ortho_scale=2.0)
    atlas.configure(scene, SAMPLES, 4)
    return scene


def shine(scene: Any, strength: float, *, varying: bool = False) -> None:
    """Set the strength of the world."""
    tree = scene.world.node_tree
    background = node(tree, "ShaderNodeBackground")
    background.inputs["Strength"].default_value = strength
    if varying:
        gradient = made("TexGradient", made("TexCoord", output="Generated"))
        tree.links.new(gradient(tree), background.inputs["Color"])


def sheets(count: int, size: float = 8.0) -> None:
    """Clear sheets above each other, through each of which nine tenths of the light pass."""
    mesh = grid(1, smooth=False)
    mesh.materials.append(atlas.tile_material("Clear", made("BsdfTransparent", Color=(0.9, 0.9, 0.9, 1))))
    for i in range(count):
        place("Sheet", mesh, location=(0, 0, 0.5 + 0.1 * i), scale=(size, size, 1))


def floor(**inputs: Any) -> Any:
    return place("Floor", grid(1, smooth=False), material("Floor", Specular_IOR_Level=0.0, **inputs))


def room(scene: Any) -> None:
    """The inside of a box, seen from it, without one wall."""
    whole, mesh = cube(size=4.0), bpy.data.meshes.new("Walls")
    faces = [tuple(face.vertices) for face in whole.polygons if face.normal.x < 0.5]
    mesh.from_pydata([tuple(one.co) for one in whole.vertices], [], faces)
    place("Walls", mesh, material("Walls", Specular_IOR_Level=0.0))
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
def test_as_many_transparent_surfaces_are_passed(stage: Any, count: int, below: str) -> None:
    passed = 7 if below == "matte" else 8
    if bpy.app.version < (5, 0) and count == passed + 1:
        pytest.skip("Cycles 4.5 lets camera rays pass one surface more, shadow rays as many")
    stage.halfspace.samples = stage.cycles.samples = 64
    stage.render.film_transparent = below == "film"
    if below in ("sky", "film"):
        shine(stage, 1.0)
    elif below == "glow":
        floor(Base_Color=(0, 0, 0, 1), Emission_Strength=1.0)
    else:
        floor()
        lamp("SUN", 3.0).data.use_shadow = False
    sheets(count)
    found = agree(stage)
    seen = found[3] < 1 if below == "film" else found[0] > 0
    assert seen == (count <= passed)


@pytest.mark.parametrize(("count", "most"), [(6, 12), (7, 12), (7, 14), (8, 15), (8, 16)])
def test_shadow_rays_pass_as_many_as_their_paths_left(stage: Any, count: int, most: int) -> None:
    stage.halfspace.samples = stage.cycles.samples = 64
    stage.cycles.transparent_max_bounces = most
    floor()
    lamp("SUN", 3.0)
    sheets(count)
    assert (agree(stage)[0] > 0) == (2 * count <= most)


def test_a_transparent_surface_may_have_an_opaque_shadow(stage: Any) -> None:
    floor()
    lamp("SUN", 3.0, rotation_euler=(0.3, 0, 0))
    sheets(1, 0.5)
    before = agree(stage)
    bpy.data.materials["Clear"].use_transparent_shadow = False
    assert agree(stage)[0] < 0.99 * before[0]


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
@pytest.mark.parametrize("bounces", [0, 1, 2])
def test_light_samples_see_a_light_up_to_its_bounces(stage: Any, kind: str, bounces: int) -> None:
    room(stage)
    light = lamp(kind, 30.0, location=(0.5, 0.5, 1.2), rotation_euler=(0, 1.1 if kind == "SUN" else 0, 0)).data
    if kind == "AREA":
        light.size = 1.5
    before = mean(stage, "HALFSPACE")
    light.cycles.max_bounces = bounces
    assert agree(stage)[0] < 0.99 * before[0]


@pytest.mark.parametrize("kind", ["diffuse", "glossy"])
@pytest.mark.parametrize("most", [0, 1, 2])
def test_bounces_of_each_kind_have_a_limit(stage: Any, kind: str, most: int) -> None:
    shine(stage, 1.0)
    room(stage)
    for item in [one for one in stage.objects if one.type == "MESH"]:
        inputs = {"Metallic": 1.0, "Roughness": 0.4} if kind == "glossy" else {}
        item.data.materials[0] = material("Kind", Specular_IOR_Level=0.0, **inputs)
    before = agree(stage, within=0.02)
    for engine in (stage.halfspace, stage.cycles):
        setattr(engine, f"{kind}_bounces", most)
    assert agree(stage, within=0.02)[0] < 0.99 * before[0]


@pytest.mark.parametrize(("count", "most"), [(1, 0), (2, 0), (2, 1), (3, 1), (3, 2)])
def test_refractions_have_a_limit(stage: Any, count: int, most: int) -> None:
    shine(stage, 1.0)
    sheets(count)
    bpy.data.objects["Sheet"].data.materials[0] = atlas.tile_material("Pane", made("BsdfRefraction", IOR=1.0))
    for engine in (stage.halfspace, stage.cycles):
        engine.transmission_bounces = most
    assert (agree(stage)[0] > 0) == (count <= most + 1)


@pytest.mark.parametrize("varying", [False, True])
def test_light_samples_of_the_world(stage: Any, varying: bool) -> None:
    room(stage)
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
def test_the_offset_of_shadow_terminators(stage: Any, offset: float) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=6, ring_count=4, radius=0.9)
    ball = bpy.context.object
    ball.data.polygons.foreach_set("use_smooth", [True] * len(ball.data.polygons))
    ball.data.materials.append(material("Ball", Specular_IOR_Level=0.0))
    lamp("SUN", 3.0, rotation_euler=(1.57, 0, 0.3)).data.angle = 0.0
    before = agree(stage)
    ball.shadow_terminator_geometry_offset = offset
    assert (agree(stage)[0] < 0.99 * before[0]) == (offset == 0)


@pytest.mark.parametrize("roughness", [0.0, 0.05, 0.3])
def test_a_transparent_film_sees_through_glass(stage: Any, roughness: float) -> None:
    shine(stage, 1.0)
    stage.render.film_transparent = True
    ball = cube(size=1.2)
    glass = {"Transmission_Weight": 1.0, "Roughness": roughness, "Base_Color": (0.5, 0.9, 0.9, 1)}
    place("Glass", ball, material("Glass", **glass), rotation_euler=(0.3, 0.2, 0.0))
    before = agree(stage)
    stage.cycles.film_transparent_glass, stage.cycles.film_transparent_roughness = True, 0.1
    found = agree(stage)
    assert (found[3] < 0.95 * before[3]) == (roughness < 0.1)


@pytest.mark.parametrize(
    ("where", "by", "kept"),
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
def test_objects_out_of_view_are_left_out(stage: Any, where: Any, by: dict[str, float], kept: bool, kind: str) -> None:
    floor()
    item = place("Glow", cube(size=0.8), material("Glow", Emission_Strength=20.0), location=where)
    camera = stage.camera.data
    camera.type, camera.angle = kind, 0.3  # both see two units at the floor
    stage.render.use_simplify = True
    for name, margin in by.items():
        setattr(stage.cycles, f"use_{name}_cull", True)
        setattr(stage.cycles, f"{name}_cull_margin", margin)
        setattr(item.cycles, f"use_{name}_cull", True)
    if kind == "PERSP" and where[2] == 1 and by.get("camera") == 0.1:
        item.location.x *= 0.95
    # Cycles leaves nothing out that is behind a parallel camera.
    kept = kept or (kind == "ORTHO" and where[2] > 8 and "camera" in by)
    assert (agree(stage, within=0.03)[0] > 1e-3) == kept


@pytest.mark.parametrize("switch", ["use_motion_blur", "use_deform_motion"])
def test_an_object_may_have_no_motion_blur(stage: Any, switch: str) -> None:
    shine(stage, 0.1)
    item = place("Cube", cube(size=0.6), material("Glow", Emission_Strength=1.0))
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

    def apart() -> float:
        ours, theirs = atlas.pair(stage, 1)
        return float(((ours - theirs) ** 2).mean() ** 0.5 / theirs.std())

    assert apart() < 0.1
    stage.view_layers[0].use_motion_blur = False
    assert apart() < 0.1
    assert blurred[0] > 0


@pytest.mark.parametrize("space", ["TANGENT", "OBJECT", "WORLD"])
def test_a_normal_map_with_the_green_of_directx(stage: Any, space: str) -> None:
    block = place("Block", cube(), material("Block", Specular_IOR_Level=0.0))
    tree = block.data.materials[0].node_tree
    bent = tree.nodes.new("ShaderNodeNormalMap")
    if "convention" not in bent.bl_rna.properties:
        pytest.skip("new in Blender 5")
    bent.space, bent.inputs["Color"].default_value = space, (0.6, 0.8, 0.8, 1)
    tree.links.new(bent.outputs[0], node(tree, "ShaderNodeBsdfPrincipled").inputs["Normal"])
    lamp("SUN", 3.0, rotation_euler=(-0.4, 0.1, 0))
    before = agree(stage)
    bent.convention = "DIRECTX"
    assert abs(agree(stage)[0] / before[0] - 1) > 0.1

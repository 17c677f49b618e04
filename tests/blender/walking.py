# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene that uses every kind of data block, and what a final render of it is handed and notes."""

from collections.abc import Iterator
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest

from addon.blender.read import remarks
from addon.blender.render import engine
from addon.blender.render.requested import render_settings
from addon.core.base.equality import same
from tests.blender.shapes import cube, material, node, with_nodes

Outcome = tuple[Any, list[str]]
"""Input of the native module, and the lines of the notes."""

LIGHTS = ("POINT", "SUN", "SPOT", "AREA")

OWNERS = (
    "Scene",
    "Curves of Scene",
    "RenderSettings",
    "ViewLayer",
    "LayerCollection",
    "Collection",
    "World",
    "Visibility of World",
    "Mist",
    "WorldLighting",
    "Camera",
    "DOF",
    "Object",
    "Material",
    "Mesh",
    "Subdivision",
    "Image",
    "Hair",
    "Points",
    *LIGHTS,
    *(f"Cycles of {name}" for name in ("Scene", "ViewLayer", "World", "Camera", "Object", "Material", "Mesh", *LIGHTS)),
)
"""The names of `owners`."""

TRIED = 6
"""Largest number of other values that are tried."""


def build() -> Any:
    """The scene: it moves, is simplified, and has objects to cull, so that the parts of these have an effect."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon_utils.enable("cycles")
    scene = bpy.context.scene
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    group = bpy.data.collections.new("Group")
    scene.collection.children.link(group)

    def add(name: str, data: Any, *place: float) -> Any:
        item = bpy.data.objects.new(name, data)
        group.objects.link(item)
        item.location = place or (0, 0, 0)
        return item

    scene.world = bpy.data.worlds.new("World")
    camera = bpy.data.cameras.new("Camera")
    camera.dof.use_dof = True
    scene.camera = add("Camera", camera, 0, 0, 8)
    for kind in LIGHTS:
        add(kind, bpy.data.lights.new(kind, kind), 1, 2, 3).data.use_temperature = True
    _solids(add)
    _round(add)
    _settings(scene)
    return scene


def _solids(add: Any) -> None:
    """Meshes: one that moves and subdivides, one outside of the view and one that is culled."""
    skin = material("Skin")
    tree = skin.node_tree
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image = bpy.data.images.new("Picture", 130, 2)
    shader = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    tree.links.new(picture.outputs["Color"], shader.inputs["Base Color"])
    moved = tree.nodes.new("ShaderNodeDisplacement")
    tree.links.new(moved.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Displacement"])
    for name, place in (("Thing", (0, 0, 0)), ("Away", (60, 0, 0)), ("Culled", (0, 6, 0)), ("Far", (0, 0, -90))):
        mesh = cube(size=1.0 if name == "Thing" else 1.5)
        mesh.materials.append(skin)
        add(name, mesh, *place)
    bpy.data.objects["Thing"].rotation_euler = (0.1, 0.2, 0.3)
    # One object moves and changes its shape.
    away = bpy.data.objects["Away"]
    away.shape_key_add(name="Basis")
    key = away.shape_key_add(name="Long")
    key.data[0].co.x *= 3
    for frame in (0, 2):
        away.location.z = key.value = frame / 2
        away.keyframe_insert("location", frame=frame)
        key.keyframe_insert("value", frame=frame)
    bpy.data.objects["Culled"].cycles.use_camera_cull = True
    bpy.data.objects["Far"].cycles.use_distance_cull = True
    bpy.data.objects["Thing"].modifiers.new("Subdivision", "SUBSURF")


def _round(add: Any) -> None:
    """Hair curves and points."""
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([3])
    hair.points.foreach_set("position", np.arange(9, dtype=np.float32))
    add("Hair", hair)
    points = bpy.data.pointclouds.new("Points") if hasattr(bpy.data.pointclouds, "new") else None
    if points is not None:
        add("Points", points)


def _settings(scene: Any) -> None:
    """Switches without which others have no effect."""
    render, cycles = scene.render, scene.cycles
    render.engine = engine.ENGINE
    render.resolution_x = render.resolution_y = 16
    render.use_motion_blur = render.use_simplify = cycles.use_camera_cull = cycles.use_distance_cull = True
    scene.halfspace.use_denoising = cycles.film_transparent_glass = True
    scene.halfspace.motion_steps = 2
    cycles.dicing_rate = cycles.preview_dicing_rate = 0.1  # dices also what few pixels show
    cycles.rolling_shutter_type = "TOP"
    if "feature_set" in cycles.bl_rna.properties:  # before Blender 5.0, for adaptive subdivision
        cycles.feature_set = "EXPERIMENTAL"
    scene.view_layers[0].lightgroups.add(name="Other")
    scene.view_layers[0].use_pass_cryptomatte_object = render.use_border = True
    render.threads_mode, render.border_max_x, render.border_max_y = "FIXED", 0.8, 0.8
    other = bpy.data.worlds.new("Other")
    with_nodes(other)
    node(other.node_tree, "ShaderNodeBackground").inputs["Strength"].default_value = 2.0
    scene.frame_set(1)


def owners(scene: Any) -> dict[str, Any]:
    """The data blocks, and the groups of settings in them, by name; Blender makes meshes of curves, text and others."""
    layer, world, objects = scene.view_layers[0], scene.world, bpy.data.objects
    found = {
        "Scene": scene,
        "Curves of Scene": getattr(scene, "cycles_curves", None),
        "RenderSettings": scene.render,
        "ViewLayer": layer,
        "LayerCollection": layer.layer_collection.children[0],
        "Collection": bpy.data.collections["Group"],
        "World": world,
        "Visibility of World": world.cycles_visibility,
        "Mist": world.mist_settings,
        "WorldLighting": world.light_settings,
        "Camera": scene.camera.data,
        "DOF": scene.camera.data.dof,
        "Object": objects["Thing"],
        "Material": bpy.data.materials["Skin"],
        "Mesh": objects["Thing"].data,
        "Subdivision": objects["Thing"].modifiers[0],
        "Image": bpy.data.images["Picture"],
        "Hair": objects["Hair"].data,
        **{kind: objects[kind].data for kind in LIGHTS},
    }
    if "Points" in objects:
        found["Points"] = objects["Points"].data
    for name in ("Scene", "ViewLayer", "World", "Camera", "Material", "Mesh", *LIGHTS):
        found[f"Cycles of {name}"] = getattr(found[name], "cycles", None)
    found["Cycles of Object"] = objects["Away"].cycles
    return {name: owner for name, owner in found.items() if owner is not None}


def outcome(scene: Any, *, moving: bool) -> Outcome:
    """Input and notes of a final render of the scene; nothing is traced. moving: with the other times at
    which the shutter is open, which take longer.
    """
    found: list[Outcome] = []

    def render(picture: Any) -> None:
        settings = render_settings(picture.engine, picture.depsgraph)
        read = picture._read(settings)
        remarks.remark(picture.scene, picture.depsgraph.view_layer_eval, 1, picture.notes)
        found.append(((settings, read.scene, dict(read.views), read.times), picture.notes.lines()))
        # Freestyle crashes without a picture.
        picture.engine.end_result(picture.engine.begin_result(0, 0, *settings.size))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine._Picture, "render", render)
        if not moving:
            patch.setattr(engine.moving.Times, "look", lambda *_: engine.moving.Moving())
        bpy.ops.render.render(scene=scene.name)
    return found[0] if found else (None, [])


def differs(one: Outcome, other: Outcome) -> str:
    """How a change showed: as honoured, as named, or not at all."""
    if not same(one[0], other[0]):
        return "honoured"
    return "named" if one[1] != other[1] else ""


def values(owner: Any, item: Any) -> Iterator[Any]:
    """Other values of a property, at most TRIED; the first one is the nearest."""
    now = getattr(owner, item.identifier)
    many = getattr(item, "is_array", False)
    if many and item.array_dimensions[1]:  # a matrix follows from other properties
        return
    match item.type:
        case "BOOLEAN":
            yield [not one for one in now] if many else not now
        case "INT" | "FLOAT":
            for other in _numbers(item, (now[0] if many else now)):
                yield [other] * len(now) if many else other
        case "ENUM":
            names = [one.identifier for one in item.enum_items if one.identifier not in ("", now)][:TRIED]
            yield from ({name} for name in names) if item.is_enum_flag else names
        case "STRING":
            yield "Other"
        case "POINTER":
            yield from _blocks(item, now)


def _numbers(item: Any, now: Any) -> Iterator[Any]:
    whole = item.type == "INT"
    low, high = item.hard_min, item.hard_max
    tried = [now + 1, now - 1] if whole else [now * 1.5 + 0.25, now * 0.5]
    for other in (*tried, low, high):
        if low <= other <= high and other != now and abs(other) < 1e6:
            yield other


def _blocks(item: Any, now: Any) -> Iterator[Any]:
    """Other data blocks of the type that the property points to."""
    if now is not None:
        yield None
    for blocks in (
        bpy.data.objects,
        bpy.data.worlds,
        bpy.data.materials,
        bpy.data.images,
        bpy.data.collections,
        bpy.data.meshes,
    ):
        for block in [one for one in blocks if isinstance(one, getattr(bpy.types, item.fixed_type.identifier, ()))]:
            if block != now:
                yield block
                break

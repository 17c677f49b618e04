# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in scene: a still life of tilted, bevelled, mirroring and transparent objects, lit and framed.

Made only with Blender's own primitives and modifiers. About 150,000 triangles, few of them parallel to an axis, which
is where structures with oblique planes differ from a kd-tree.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Vector

Make = Callable[[bmesh.types.BMesh], Any]


def build(scene: Any) -> None:
    """Fill a scene with the still life, its camera, lights and world, for a picture of 960 × 540."""
    _floor(scene)
    _backdrop(scene)
    _monkey(scene)
    _glass(scene)
    _mirror_ball(scene)
    _torus(scene)
    _stairs(scene)
    _beads(scene)
    _lights(scene)
    _world(scene)
    _camera(scene)
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.render.resolution_percentage = 100


def _floor(scene: Any) -> None:
    """A chessboard of two materials, rotated so that its edges are parallel to no axis."""
    board = _object(scene, "Floor", lambda bm: bmesh.ops.create_grid(bm, x_segments=28, y_segments=28, size=14.0))
    board.rotation_euler = (0.0, 0.0, math.radians(31.0))
    board.data.materials.append(_material("Light stone", (0.66, 0.63, 0.58), roughness=0.35))
    board.data.materials.append(_material("Dark stone", (0.20, 0.21, 0.24), roughness=0.22))
    row, column = np.divmod(np.arange(len(board.data.polygons)), 28)
    board.data.polygons.foreach_set("material_index", ((row + column) % 2).astype(np.int32))


def _backdrop(scene: Any) -> None:
    """A large mirror that leans in the background, in a bevelled frame."""
    lean, turn = math.radians(83.0), math.radians(-24.0)
    frame = _object(scene, "Mirror frame", lambda bm: bmesh.ops.create_cube(bm, size=1.0))
    frame.scale = (5.2, 2.9, 0.16)
    frame.location, frame.rotation_euler = (2.35, 4.1, 1.46), (lean, 0.0, turn)
    _bevel(frame, 0.04)
    frame.data.materials.append(_material("Dark wood", (0.09, 0.045, 0.025), roughness=0.4))
    glass = _object(scene, "Mirror", lambda bm: bmesh.ops.create_cube(bm, size=1.0))
    glass.scale = (4.8, 2.5, 0.06)
    normal = Euler(frame.rotation_euler).to_matrix() @ Vector((0.0, 0.0, 1.0))
    glass.location, glass.rotation_euler = Vector(frame.location) + 0.06 * normal, frame.rotation_euler
    glass.data.materials.append(_material("Silver", (0.94, 0.95, 0.96), metallic=1.0, roughness=0.0))


def _monkey(scene: Any) -> None:
    monkey = _object(scene, "Monkey", bmesh.ops.create_monkey, smooth=True)
    _subdivide(monkey, 3)
    monkey.scale = (1.25, 1.25, 1.25)
    monkey.location, monkey.rotation_euler = (-0.35, 0.75, 0.92), _degrees(-27.0, 0.0, 14.0)
    monkey.data.materials.append(_material("Terracotta", (0.66, 0.20, 0.09), roughness=0.45))


def _glass(scene: Any) -> None:
    ball = _object(
        scene,
        "Glass ball",
        lambda bm: bmesh.ops.create_icosphere(bm, subdivisions=6, radius=0.78),
        smooth=True,
    )
    ball.location = (1.75, -1.0, 0.78)
    ball.data.materials.append(_material("Glass", (0.96, 0.99, 0.98), roughness=0.0, transmission=1.0, ior=1.45))


def _mirror_ball(scene: Any) -> None:
    ball = _object(
        scene,
        "Gold ball",
        lambda bm: bmesh.ops.create_uvsphere(bm, u_segments=96, v_segments=48, radius=0.62),
        smooth=True,
    )
    ball.location = (-2.15, -0.75, 0.62)
    ball.data.materials.append(_material("Gold", (1.0, 0.71, 0.29), metallic=1.0, roughness=0.03))


def _torus(scene: Any) -> None:
    """A circle swept around an axis by the Screw modifier, leaning on the floor."""
    ring = _object(scene, "Ring", _upright_circle, smooth=True)
    screw = ring.modifiers.new("Sweep", "SCREW")
    screw.angle, screw.steps, screw.render_steps = 2.0 * math.pi, 128, 128
    screw.use_merge_vertices = True
    screw.use_normal_calculate = True
    ring.location, ring.rotation_euler = (2.72, 0.95, 0.87), _degrees(62.0, 18.0, 30.0)
    ring.data.materials.append(_material("Teal lacquer", (0.02, 0.27, 0.30), roughness=0.12))


def _upright_circle(bm: bmesh.types.BMesh) -> None:
    bmesh.ops.create_circle(bm, cap_ends=False, segments=48, radius=0.22)
    bmesh.ops.rotate(bm, verts=bm.verts, matrix=Euler((math.pi / 2, 0.0, 0.0)).to_matrix())
    bmesh.ops.translate(bm, verts=bm.verts, vec=(0.72, 0.0, 0.0))


def _stairs(scene: Any) -> None:
    """An array of boxes, each rotated a little further than the last."""
    step = bpy.data.objects.new("Stairs step", None)
    scene.collection.objects.link(step)
    step.hide_render = True
    stairs = _object(scene, "Stairs", lambda bm: bmesh.ops.create_cube(bm, size=1.0))
    for vertex in stairs.data.vertices:
        vertex.co = (1.5 * vertex.co.x, 0.42 * vertex.co.y, 0.16 * vertex.co.z)
    stairs.location = (-2.6, 2.9, 0.16)
    stairs.rotation_euler = _degrees(4.0, 3.0, -10.0)
    turn = Euler(_degrees(0.0, 3.0, 15.0)).to_matrix()
    step.rotation_euler = (stairs.rotation_euler.to_matrix() @ turn).to_euler()
    step.location = (-2.58, 2.9, 0.34)
    _bevel(stairs, 0.035)
    array = stairs.modifiers.new("Turn", "ARRAY")
    array.count = 14
    array.use_relative_offset = False
    array.use_object_offset = True
    array.offset_object = step
    stairs.data.materials.append(_material("Ivory", (0.74, 0.67, 0.52), roughness=0.3))


def _beads(scene: Any) -> None:
    """Small balls in the foreground: linked copies of one mesh, so that the picture contains instances."""
    bead = _object(
        scene,
        "Bead",
        lambda bm: bmesh.ops.create_icosphere(bm, subdivisions=4, radius=1.0),
        smooth=True,
    )
    bead.data.materials.append(_material("Porcelain", (0.78, 0.80, 0.84), roughness=0.1))
    colours = {
        "Cobalt": _material("Cobalt", (0.03, 0.09, 0.42), roughness=0.1),
        "Copper": _material("Copper", (0.95, 0.52, 0.37), metallic=1.0, roughness=0.15),
        "Amber": _material("Amber", (1.0, 0.72, 0.30), roughness=0.0, transmission=1.0, ior=1.5),
    }
    places = (
        ("", -0.95, -2.05, 0.17),
        ("Cobalt", -0.45, -1.55, 0.26),
        ("Copper", 0.25, -2.15, 0.20),
        ("Amber", -1.30, -1.60, 0.21),
        ("", 2.75, -1.65, 0.22),
        ("Cobalt", 3.15, -1.05, 0.16),
        ("Copper", -3.05, -1.15, 0.18),
    )
    # Link the material to the object, so that copies of one mesh differ.
    for i, (colour, x, y, radius) in enumerate(places):
        item = bead if i == 0 else bpy.data.objects.new(f"Bead {i}", bead.data)
        if i:
            scene.collection.objects.link(item)
        item.location, item.scale = (x, y, radius), (radius, radius, radius)
        if colour:
            item.material_slots[0].link = "OBJECT"
            item.material_slots[0].material = colours[colour]


def _lights(scene: Any) -> None:
    """A low warm sun from the left for the shadows, a large soft fill, a cool rim from behind, and a lamp."""
    sun = _light(scene, "Sun", "SUN", (-7.0, -1.6, 3.9), (0.0, 0.0, 0.0), energy=6.5, color=(1.0, 0.87, 0.70))
    sun.angle = math.radians(5.0)
    fill = _light(scene, "Fill", "AREA", (4.4, -5.6, 5.0), (0.4, 0.0, 0.6), energy=60.0, color=(0.86, 0.92, 1.0))
    fill.shape, fill.size = "DISK", 3.0
    rim = _light(scene, "Rim", "SPOT", (4.8, 3.2, 5.2), (-0.2, 0.2, 0.7), energy=260.0, color=(0.62, 0.78, 1.0))
    rim.shadow_soft_size, rim.spot_size, rim.spot_blend = 0.8, math.radians(58.0), 0.5
    lamp = _light(scene, "Lamp", "POINT", (-3.5, 1.9, 2.9), (0.0, 0.0, 0.0), energy=55.0, color=(1.0, 0.72, 0.42))
    lamp.shadow_soft_size = 0.4


def _light(
    scene: Any,
    name: str,
    kind: str,
    place: tuple[float, float, float],
    target: tuple[float, float, float],
    *,
    energy: float,
    color: tuple[float, float, float],
) -> Any:
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, color
    item = bpy.data.objects.new(name, data)
    item.location = place
    item.rotation_euler = _towards(place, target)
    scene.collection.objects.link(item)
    return data


def _world(scene: Any) -> None:
    world = bpy.data.worlds.new("Evening")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.20, 0.28, 0.42, 1.0)
    background.inputs["Strength"].default_value = 0.3
    scene.world = world


def _camera(scene: Any) -> None:
    data = bpy.data.cameras.new("Camera")
    data.lens = 42.0
    item = bpy.data.objects.new("Camera", data)
    item.location = (0.55, -9.6, 3.75)
    item.rotation_euler = _towards(item.location, (0.14, 0.1, 1.06))
    scene.collection.objects.link(item)
    scene.camera = item


def _object(scene: Any, name: str, make: Make, *, smooth: bool = False) -> Any:
    """A new mesh object from a primitive."""
    bm = bmesh.new()
    make(bm)
    # Sort the faces: Blender's sphere orders them differently each time, which would change every tree.
    faces = sorted(_turned([vertex.index for vertex in face.verts]) for face in bm.faces)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([vertex.co for vertex in bm.verts], [] if faces else _edges(bm), faces)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), smooth))
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def _turned(corners: list[int]) -> list[int]:
    """The same face, starting at its smallest corner."""
    first = corners.index(min(corners))
    return corners[first:] + corners[:first]


def _edges(bm: bmesh.types.BMesh) -> list[list[int]]:
    return [[vertex.index for vertex in edge.verts] for edge in bm.edges]


def _subdivide(item: Any, levels: int) -> None:
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels


def _bevel(item: Any, width: float) -> None:
    modifier = item.modifiers.new("Bevel", "BEVEL")
    modifier.width, modifier.segments = width, 4
    modifier.limit_method = "NONE"


def _material(
    name: str,
    color: tuple[float, float, float],
    *,
    metallic: float = 0.0,
    roughness: float = 0.5,
    transmission: float = 0.0,
    ior: float = 1.5,
) -> Any:
    """A Principled BSDF with these values, and the same colour in the viewport."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Transmission Weight"].default_value = transmission
    shader.inputs["IOR"].default_value = ior
    material.diffuse_color = (*color, 1.0)
    material.metallic, material.roughness = metallic, roughness
    return material


def _towards(place: Any, target: Any) -> Any:
    return (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()


def _degrees(x: float, y: float, z: float) -> tuple[float, float, float]:
    return (math.radians(x), math.radians(y), math.radians(z))

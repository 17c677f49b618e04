# SPDX-License-Identifier: GPL-3.0-or-later
"""Building blocks of the scenes of `proving`: surfaces, lamps, images, materials."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...blender.samples.camera import see
from ...core.base.arrays import F32, F64
from ...core.scene.workload import View

Color = tuple[float, float, float]

detail = 1.0
"""Scale of the number of triangles of spheres and of the size of panoramas."""


def new_world(scene: Any, color: Color) -> Any:
    """A world of one colour."""
    world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1)
    scene.world = world
    return world


def look(scene: Any, eye: Color, target: Color, field: float) -> None:
    """Place the camera; field: vertical field of view in degrees."""
    view = View(np.array(eye, np.float64), np.array(target, np.float64), np.array((0.0, 0.0, 1.0)), float(field))
    see(scene, view)


def lamp(scene: Any, kind: str, place: Color, target: Color, **values: float) -> Any:
    """A lamp at a place, turned to a target, with these settings."""
    data = bpy.data.lights.new(kind.title(), kind)
    for name, value in values.items():
        setattr(data, name, value)
    item = bpy.data.objects.new(data.name, data)
    item.location = place
    item.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(item)
    return item


def wear(item: Any, material: Any) -> None:
    """Append a material to an object."""
    item.data.materials.append(material)


def polygons(scene: Any, name: str, points: Any, faces: Any, *, smooth: bool = False) -> Any:
    """An object with these points and faces."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, p)) for p in points], [], [tuple(map(int, f)) for f in faces])
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), smooth))
    mesh.update()
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def unwrap(mesh: Any, uv: F64) -> None:
    """Add a UV map. uv: (loops, 2)."""
    layer = mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).reshape(-1))


def plane(scene: Any, half: float) -> Any:
    """A horizontal square around the origin, with a UV map over 0 to 1."""
    item = polygons(
        scene, "Plane", [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [(0, 1, 2, 3)]
    )
    unwrap(item.data, np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))
    return item


def box(scene: Any, place: Color, half: Color) -> Any:
    """A box of six squares with UV maps over 0 to 1."""
    x, y, z = half
    points = [(sx * x, sy * y, sz * z) for sz in (-1, 1) for sy in (-1, 1) for sx in (-1, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    item = polygons(scene, "Box", points, faces)
    unwrap(item.data, np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (6, 1)))
    item.location = place
    return item


def sphere(scene: Any, place: Color, radius: float, *, rings: int = 48) -> Any:
    """A smooth sphere of quads and two triangle fans, with a UV map of longitude and latitude."""
    rings = max(int(rings * detail), 5)
    around = 2 * rings
    # Place the vertices ring by ring between the poles.
    points = [(0.0, 0.0, -radius)]
    for ring in range(1, rings):
        theta = math.pi * ring / rings
        for step in range(around):
            phi = 2 * math.pi * step / around
            points.append(
                (
                    radius * math.sin(theta) * math.cos(phi),
                    radius * math.sin(theta) * math.sin(phi),
                    -radius * math.cos(theta),
                )
            )
    points.append((0.0, 0.0, radius))
    # Connect neighbouring rings with quads, and the poles with triangles.
    faces: list[tuple[int, ...]] = []
    uv: list[tuple[float, float]] = []
    for ring in range(rings):
        for step in range(around):
            left, right = step / around, (step + 1) / around
            low, high = ring / rings, (ring + 1) / rings
            a, b = (1 + (ring - 1) * around + (step + k) % around for k in (0, 1))
            c, d = (1 + ring * around + (step + k) % around for k in (0, 1))
            if ring == 0:
                faces.append((0, d, c))
                uv += [((left + right) / 2, low), (right, high), (left, high)]
            elif ring == rings - 1:
                faces.append((a, b, len(points) - 1))
                uv += [(left, low), (right, low), ((left + right) / 2, high)]
            else:
                faces.append((a, b, d, c))
                uv += [(left, low), (right, low), (right, high), (left, high)]
    item = polygons(scene, "Ball", points, faces, smooth=True)
    unwrap(item.data, np.array(uv))
    item.location = place
    return item


def strands(scene: Any, name: str, placed: Any, thick: float, thin: float, material: Any) -> None:
    """Hair curves through (hairs, points, 3), thinner towards the tips."""
    count, points = placed.shape[:2]
    curves = bpy.data.hair_curves.new(name)
    curves.add_curves([points] * count)
    curves.position_data.foreach_set("vector", np.ascontiguousarray(placed, np.float32).reshape(-1))
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(np.linspace(thick, thin, points), count).astype(np.float32))
    curves.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new(name, curves))


def points(scene: Any, name: str, centres: F64, radii: F64, colours: F64, material: Any) -> None:
    """Points at (n, 3) centres with an attribute "shade", (n, 4), which geometry nodes make of vertices."""
    item = polygons(scene, name, centres, [])
    for label, kind, field, values in (("size", "FLOAT", "value", radii), ("shade", "FLOAT_COLOR", "color", colours)):
        attribute = item.data.attributes.new(label, kind, "POINT")
        attribute.data.foreach_set(field, values.astype(np.float32).reshape(-1))
    wear(item, material)
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    kinds = "NodeGroupInput", "GeometryNodeInputNamedAttribute", "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial"
    begin, size, made, worn, end = (tree.nodes.new(kind) for kind in (*kinds, "NodeGroupOutput"))
    size.data_type, size.inputs["Name"].default_value = "FLOAT", "size"
    worn.inputs["Material"].default_value = material
    for one, other in (
        (begin.outputs[0], made.inputs["Mesh"]),
        (size.outputs["Attribute"], made.inputs["Radius"]),
        (made.outputs[0], worn.inputs["Geometry"]),
        (worn.outputs[0], end.inputs[0]),
    ):
        tree.links.new(one, other)
    item.modifiers.new("Points", "NODES").node_group = tree


def tree_mesh(bark: Any, leaves: Any, levels: int) -> Any:
    """A trunk and cones of leaves, as one mesh."""
    points: list[tuple[float, float, float]] = []
    faces: list[tuple[int, ...]] = []
    slots: list[int] = []

    def cone(low: float, high: float, wide: float, narrow: float, sides: int, slot: int) -> None:
        first = len(points)
        for z, r in ((low, wide), (high, narrow)):
            points.extend(
                (r * math.cos(6.283185 * i / sides), r * math.sin(6.283185 * i / sides), z) for i in range(sides)
            )
        for i in range(sides):
            j = (i + 1) % sides
            faces.append((first + i, first + j, first + sides + j, first + sides + i))
            slots.append(slot)

    cone(0, 0.8, 0.12, 0.1, 7, 0)
    for level in range(levels):
        base = 0.6 + 0.55 * level
        cone(base, base + 0.9, 0.75 * (1 - level / (levels + 1)), 0.02, 14, 1)
    mesh = bpy.data.meshes.new(f"Tree {levels}")
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(bark)
    mesh.materials.append(leaves)
    mesh.polygons.foreach_set("material_index", np.array(slots, np.int32))
    mesh.update()
    return mesh


def new_material(name: str) -> Any:
    """A material with Blender's default nodes."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    return material


def principled_node(material: Any) -> Any:
    """The material's Principled BSDF."""
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")


def principled(name: str, color: Color, **values: Any) -> Any:
    """A material with constant inputs, by name with underscores for spaces."""
    material = new_material(name)
    shader = principled_node(material)
    shader.inputs["Base Color"].default_value = (*color, 1)
    for key, value in values.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return material


def one_shader(name: str, kind: str, **values: Any) -> Any:
    """A material with one shader node of this kind."""
    material = new_material(name)
    tree = material.node_tree
    tree.nodes.remove(principled_node(material))
    shader = tree.nodes.new(f"ShaderNode{kind}")
    for key, value in values.items():
        shader.inputs[key].default_value = value
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def mixed(name: str, factor: float) -> Any:
    """A mix of diffuse and mirror."""
    material = one_shader(name, "MixShader")
    tree = material.node_tree
    mix = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMixShader")
    mix.inputs[0].default_value = factor
    matte, mirror = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
    matte.inputs["Color"].default_value = (0.2, 0.7, 0.3, 1)
    mirror.inputs["Color"].default_value = (0.9, 0.9, 0.9, 1)
    mirror.inputs["Roughness"].default_value = 0.0
    tree.links.new(matte.outputs[0], mix.inputs[1])
    tree.links.new(mirror.outputs[0], mix.inputs[2])
    return material


def picture(name: str, pixels: F32, space: str, *, floats: bool = False) -> Any:
    """A packed image. pixels: (h, w, 4) in the colour space's encoding."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=floats)
    image.colorspace_settings.name = space
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    image.update()
    image.pack()
    return image


def grid(size: int) -> tuple[F64, F64]:
    """Coordinates of pixel centres, 0 to 1, (size, size) each."""
    at = (np.arange(size) + 0.5) / size
    return np.meshgrid(at, at)


def opaque(rgb: F64) -> F32:
    """(h, w, 3) colours with alpha 1."""
    return np.concatenate([rgb, np.ones((*rgb.shape[:2], 1))], axis=2).astype(np.float32)


def tiles_picture(rng: Any) -> Any:
    """Tiles of many colours with dark joints."""
    colors = rng.uniform(0.25, 0.95, (8, 8, 3))
    rgb = colors.repeat(32, axis=0).repeat(32, axis=1)
    x, y = grid(256)
    joint = (np.minimum(x * 8 % 1, y * 8 % 1) < 0.08)[..., None]
    return picture("Tiles", opaque(np.where(joint, 0.15, rgb)), "sRGB")


def spots_picture(rng: Any) -> Any:
    """Smooth spots between 0 and 1."""
    x, y = grid(128)
    values = sum(np.sin(2 * np.pi * (a * x + b * y) + c) for a, b, c in rng.integers(1, 5, (6, 3)))
    values = (values - values.min()) / np.ptp(values)
    return picture("Spots", opaque(np.repeat(values[..., None], 3, axis=2)), "Non-Color")


def bumps_picture() -> Any:
    """A normal map of round bumps."""
    x, y = grid(256)
    dx, dy = (0.35 * np.sin(2 * np.pi * 8 * axis) for axis in (x, y))
    normal = np.stack([dx, dy, np.ones_like(dx)], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return picture("Bumps", opaque(0.5 + 0.5 * normal), "Non-Color")


def panorama_pixels() -> F32:
    """A blue gradient over a brown ground, and a bright disc."""
    height = max(int(256 * detail), 8)
    width = 2 * height
    v = (np.arange(height) + 0.5) / height
    u = (np.arange(width) + 0.5) / width
    up = np.sin(np.pi * (v - 0.5))[:, None, None]
    sky = np.array((0.25, 0.45, 0.9)) * np.clip(up, 0, 1) + np.array((0.7, 0.75, 0.8)) * (1 - np.abs(up))
    rgb = np.where(up > 0, sky, np.array((0.2, 0.16, 0.1))) * np.ones((height, width, 1))
    disc = np.hypot((u[None] - 0.3) * 2, v[:, None] - 0.75) < 0.02
    rgb[disc] = (260, 240, 200)
    return opaque(rgb)


def pictured(name: str, color: Any, rough: Any, bumps: Any, *, scale: float, metallic: bool = False) -> Any:
    """A Principled BSDF with images for colour, roughness, optionally metallic, and the normal."""
    material = principled(name, (0.5, 0.5, 0.5))
    # Map the images by scaled UV coordinates.
    tree, shader = material.node_tree, principled_node(material)
    where, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (scale, scale, 1)
    tree.links.new(where.outputs["UV"], mapping.inputs["Vector"])

    def picture(image: Any) -> Any:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        return node

    # Link colour, roughness through a ramp, and optionally a threshold for metallic.
    tree.links.new(picture(color).outputs["Color"], shader.inputs["Base Color"])
    spots = picture(rough)
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.3, 0.3, 0.3, 1), (0.9, 0.9, 0.9, 1)
    tree.links.new(spots.outputs["Color"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Roughness"])
    if metallic:
        step = tree.nodes.new("ShaderNodeMath")
        step.operation = "GREATER_THAN"
        tree.links.new(spots.outputs["Color"], step.inputs[0])
        tree.links.new(step.outputs[0], shader.inputs["Metallic"])
    # Link the normal map.
    normal = tree.nodes.new("ShaderNodeNormalMap")
    normal.inputs["Strength"].default_value = 0.8
    tree.links.new(picture(bumps).outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], shader.inputs["Normal"])
    return material


def vertex_colors(mesh: Any) -> Any:
    """Add a colour attribute to the mesh, and return a material that shows it."""
    points = np.array([v.co for v in mesh.vertices])
    colors = np.ones((len(points), 4), np.float32)
    colors[:, :3] = 0.5 + 0.5 * np.sin(3 * points + np.array((0, 2, 4)))
    attribute = mesh.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colors.reshape(-1))
    material = principled("Painted", (0.5, 0.5, 0.5), Roughness=0.4)
    tree = material.node_tree
    paint = tree.nodes.new("ShaderNodeVertexColor")
    paint.layer_name = "Paint"
    tree.links.new(paint.outputs["Color"], principled_node(material).inputs["Base Color"])
    return material


def cut_out() -> Any:
    """A leaf whose outline is in the image's alpha."""
    x, y = grid(128)
    inside = np.hypot((x - 0.5) * 1.4, y - 0.5) < 0.35 + 0.1 * np.sin(8 * np.arctan2(y - 0.5, x - 0.5))
    rgb = np.stack([0.2 + 0.3 * x, 0.6 + 0.2 * y, 0.15 + 0 * x], axis=2)
    pixels = opaque(rgb)
    pixels[..., 3] = inside
    material = principled("Leaf", (0.5, 0.5, 0.5), Roughness=0.7)
    tree, shader = material.node_tree, principled_node(material)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture("Leaf", pixels, "sRGB")
    node.extension = "CLIP"
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(node.outputs["Alpha"], shader.inputs["Alpha"])
    return material


def noisy() -> Any:
    """A material coloured by noise."""
    material = principled("Cloud", (0.5, 0.5, 0.5), Roughness=0.8)
    tree, shader = material.node_tree, principled_node(material)
    noise, mix = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeMix")
    where = tree.nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value = 4.0
    mix.data_type = "RGBA"
    mix.inputs[6].default_value, mix.inputs[7].default_value = (0.05, 0.1, 0.4, 1), (1, 0.9, 0.7, 1)
    tree.links.new(where.outputs["Generated"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[2], shader.inputs["Base Color"])
    return material

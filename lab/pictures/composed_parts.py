# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes and materials of the scenes of `composed`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from . import proving_parts as parts
from .proving_parts import Color

AROUND = 48
"""Sides of bodies of revolution."""


def lathe(scene: Any, name: str, profile: Sequence[tuple[float, float]]) -> Any:
    """A body of revolution about the z axis. profile: radius and height of each ring, from the bottom outside to the
    inside; rings of radius 0 close it.
    """
    around = max(int(AROUND * math.sqrt(parts.detail)), 6)
    rings = _rounded(profile) if parts.detail >= 0.5 else list(profile)
    points: list[tuple[float, float, float]] = []
    first: list[tuple[int, int]] = []
    for radius, height in rings:
        count = around if radius > 0 else 1
        first.append((len(points), count))
        for step in range(count):
            angle = math.tau * step / around
            points.append((radius * math.cos(angle), radius * math.sin(angle), height))
    faces = []
    for (low, n), (high, m) in itertools.pairwise(first):
        for step in range(around):
            after = (step + 1) % around
            ring = [low + step % n, low + after % n, high + after % m, high + step % m]
            faces.append(tuple(dict.fromkeys(ring)))
    return parts.polygons(scene, name, points, [face for face in faces if len(face) > 2], smooth=True)


def _rounded(profile: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """A profile whose corners are cut twice (Chaikin), so that smooth normals follow it; its ends stay."""
    rings = list(profile)
    for _ in range(2):
        cut = [rings[0]]
        for (r0, z0), (r1, z1) in itertools.pairwise(rings):
            cut += [(r0 + (r1 - r0) * t, z0 + (z1 - z0) * t) for t in (0.12, 0.88)]
        rings = [*cut, rings[-1]]
    return rings


def torus(scene: Any, name: str, radius: float, thickness: float) -> Any:
    """A ring in the plane of x and z."""
    around, about = (max(int(n * math.sqrt(parts.detail)), 5) for n in (64, 20))
    points = []
    for i in range(around):
        a = math.tau * i / around
        for j in range(about):
            b = math.tau * j / about
            r = radius + thickness * math.cos(b)
            points.append((r * math.cos(a), thickness * math.sin(b), r * math.sin(a)))
    faces = []
    for i in range(around):
        for j in range(about):
            k, m = (i + 1) % around, (j + 1) % about
            faces.append((i * about + j, i * about + m, k * about + m, k * about + j))
    return parts.polygons(scene, name, points, faces, smooth=True)


def backdrop(scene: Any) -> Any:
    """A floor that bends up into a wall."""
    steps = [(-6.0, 0.0), (1.5, 0.0)]
    for step in range(1, 13):
        angle = math.pi / 2 * step / 12
        steps.append((1.5 + 1.6 * math.sin(angle), 1.6 - 1.6 * math.cos(angle)))
    steps.append((3.1, 7.0))
    points = [(x, y, z) for y, z in steps for x in (-8.0, 8.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(steps) - 1)]
    return parts.polygons(scene, "Sweep", points, faces, smooth=True)


def head(scene: Any) -> Any:
    """An egg with brows, sockets, nose, lips, chin and ears, looking along -y."""
    item = parts.sphere(scene, (0, 0, 0), 1.0, rings=96)
    item.name = "Head"
    points = np.empty(len(item.data.vertices) * 3, np.float32)
    item.data.vertices.foreach_get("co", points)
    unit = points.reshape(-1, 3).astype(np.float64)
    x, y, z = unit.T

    def bump(at: Color, width: Color) -> Any:
        far = ((unit - np.array(at)) / np.array(width)) ** 2
        return np.exp(-far.sum(axis=1))

    # An egg: narrow at the chin, long at the back.
    low = np.clip(-z, 0, 1)
    shape = np.stack([x * (0.74 - 0.2 * low), y * np.where(y > 0, 0.98, 0.82 - 0.08 * low), z * 1.02], axis=1)
    front = np.array([0, -1.0, 0])
    for at, width, by in (
        ((0, -1, -0.1), (0.13, 0.5, 0.12), 0.2),  # tip of the nose
        ((0, -1, 0.1), (0.09, 0.5, 0.2), 0.13),
        ((0, -1, -0.44), (0.26, 0.5, 0.055), 0.05),  # lips
        ((0, -1, -0.55), (0.2, 0.5, 0.05), 0.05),
        ((0, -0.9, -0.82), (0.25, 0.4, 0.16), 0.09),  # chin
        ((-0.36, -0.95, 0.32), (0.22, 0.4, 0.07), 0.05),  # brows
        ((0.36, -0.95, 0.32), (0.22, 0.4, 0.07), 0.05),
        ((-0.36, -0.95, 0.13), (0.17, 0.4, 0.12), -0.12),  # sockets
        ((0.36, -0.95, 0.13), (0.17, 0.4, 0.12), -0.12),
        ((-0.5, -0.85, -0.22), (0.25, 0.4, 0.2), 0.03),  # cheeks
        ((0.5, -0.85, -0.22), (0.25, 0.4, 0.2), 0.03),
        ((0, -1, -0.495), (0.2, 0.4, 0.018), -0.03),  # mouth
    ):
        shape += (by * bump(at, width))[:, None] * front
    for side in (-1, 1):
        shape[:, 0] += 0.16 * side * bump((side, 0.05, 0.0), (0.3, 0.13, 0.22))
    item.data.vertices.foreach_set("co", np.ascontiguousarray(shape, np.float32).reshape(-1))
    item.data.update()
    return item


def hair(scene: Any, head_item: Any, count: int) -> Any:
    """Strands on the scalp that fall to the sides."""
    rng = np.random.default_rng(8)
    mesh = head_item.data
    points = np.empty((len(mesh.vertices), 3), np.float32)
    normals = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    mesh.vertices.foreach_get("normal", normals.ravel())
    # The scalp lies above a line from the forehead to the neck.
    scalp = np.flatnonzero(points[:, 2] > 0.45 - 0.55 * np.clip(points[:, 1] + 0.35, 0, 1.3))
    strands = 7 if parts.detail >= 0.5 else 4
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([strands] * count)
    roots = scalp[rng.integers(len(scalp), size=count)]
    at = points[roots] + rng.normal(0, 0.012, (count, 3))
    direction = normals[roots] * 0.35 + np.array([0.25, 0.5, 0.05]) + rng.normal(0, 0.05, (count, 3))
    length = 0.75 * rng.uniform(0.8, 1.15, count)
    placed = np.empty((count, strands, 3), np.float32)
    for step in range(strands):
        placed[:, step] = at
        # Hair falls, and stays outside of the head.
        direction += np.array([0, 0.03, -0.42])
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        at = at + direction * (length / (strands - 1))[:, None]
        around = at / np.array([0.76, 0.99, 1.04])
        inside = np.linalg.norm(around, axis=1, keepdims=True)
        at = np.where(inside < 1.02, at / np.maximum(inside, 1e-3) * 1.03, at)
    curves.position_data.foreach_set("vector", placed.reshape(-1))
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(np.linspace(0.011, 0.003, strands), count).astype(np.float32))
    material = parts.one_shader("Hair", "BsdfHairPrincipled")
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfHairPrincipled")
    shader.parametrization = "MELANIN"
    shader.inputs["Melanin"].default_value, shader.inputs["Melanin Redness"].default_value = 0.62, 0.55
    curves.materials.append(material)
    item = bpy.data.objects.new("Hair", curves)
    scene.collection.objects.link(item)
    return item


def eye() -> Any:
    """White with an iris and a pupil around the pole of the sphere, below a wet coat."""
    material = parts.principled("Eye", (0.9, 0.88, 0.85), Roughness=0.3, Coat_Weight=1, Coat_Roughness=0.0)
    tree, shader = material.node_tree, parts.principled_node(material)
    where, split, ramp = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "ValToRGB"))
    tree.links.new(where.outputs["Generated"], split.inputs[0])
    tree.links.new(split.outputs["Z"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    stops = ramp.color_ramp.elements
    stops[0].position, stops[0].color = 0.9, (0.88, 0.85, 0.82, 1)
    stops[1].position, stops[1].color = 0.985, (0.01, 0.01, 0.01, 1)
    iris = stops.new(0.915)
    iris.color = (0.12, 0.2, 0.18, 1)
    edge = stops.new(0.975)
    edge.color = (0.2, 0.3, 0.22, 1)
    return material


def linear(item: Any) -> None:
    """Make the motion between the keys of an object steady."""
    action = item.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def bumpy(name: str, color: Color, *, scale: float, strength: float, **values: Any) -> Any:
    """A Principled BSDF whose normal and colour vary by noise in object space."""
    material = parts.principled(name, color, **values)
    tree, shader = material.node_tree, parts.principled_node(material)
    where, noise, bump, mix = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexNoise", "Bump", "MixRGB")
    )
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, 3.0
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = strength, 0.5 / scale
    mix.inputs[1].default_value = (*(0.7 * c for c in color), 1)
    mix.inputs[2].default_value = (*(min(1.3 * c, 1) for c in color), 1)
    tree.links.new(where.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(noise.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    return material


def tiles(name: str, color: Color, joint: Color) -> Any:
    """Glazed tiles with sunken joints."""
    material = parts.principled(name, color, Roughness=0.15)
    tree, shader = material.node_tree, parts.principled_node(material)
    where, brick, bump = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexBrick", "Bump"))
    brick.offset = 0.0
    for key, value in (("Scale", 1.0), ("Mortar Size", 0.02), ("Brick Width", 0.5), ("Row Height", 0.5)):
        brick.inputs[key].default_value = value
    brick.inputs["Color1"].default_value = (*color, 1)
    brick.inputs["Color2"].default_value = (*(0.8 * c for c in color), 1)
    brick.inputs["Mortar"].default_value = (*joint, 1)
    bump.invert = True
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.6, 0.03
    tree.links.new(where.outputs["UV"], brick.inputs["Vector"])
    tree.links.new(brick.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(brick.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    return material


def wood(name: str, dark: Color, light: Color, *, scale: float) -> Any:
    """Rings of wood, lacquered."""
    material = parts.principled(name, dark, Roughness=0.38)
    tree, shader = material.node_tree, parts.principled_node(material)
    where, wave, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexWave", "MixRGB"))
    wave.bands_direction = "Y"
    for key, value in (("Scale", scale), ("Distortion", 6.0), ("Detail", 2.0), ("Detail Scale", 1.2)):
        wave.inputs[key].default_value = value
    mix.inputs[1].default_value, mix.inputs[2].default_value = (*dark, 1), (*light, 1)
    tree.links.new(where.outputs["Object"], wave.inputs["Vector"])
    tree.links.new(wave.outputs["Fac"], mix.inputs[0])
    tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
    return material


def medium(name: str, color: Color, *, density: float, anisotropy: float) -> Any:
    """A material that is nothing but a volume that scatters."""
    material = parts.new_material(name)
    tree = material.node_tree
    tree.nodes.remove(parts.principled_node(material))
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Color"].default_value = (*color, 1)
    scatter.inputs["Density"].default_value, scatter.inputs["Anisotropy"].default_value = density, anisotropy
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    return material


def brushed(name: str, color: Color, *, roughness: float, anisotropy: float) -> Any:
    """Metal brushed around the z axis of its object."""
    material = parts.principled(name, color, Metallic=1, Roughness=roughness, Anisotropic=anisotropy)
    tree, shader = material.node_tree, parts.principled_node(material)
    tangent = tree.nodes.new("ShaderNodeTangent")
    tangent.direction_type, tangent.axis = "RADIAL", "Z"
    tree.links.new(tangent.outputs[0], shader.inputs["Tangent"])
    return material


def leaf(color: Color) -> Any:
    """A leaf that light shines through: half translucent, half matte, with a thin gloss."""
    material = parts.one_shader("Leaf", "MixShader")
    tree = material.node_tree
    outer = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMixShader")
    outer.inputs[0].default_value = 0.06
    inner, front, back, gloss = (
        tree.nodes.new(f"ShaderNode{kind}")
        for kind in ("MixShader", "BsdfDiffuse", "BsdfTranslucent", "BsdfAnisotropic")
    )
    front.inputs["Color"].default_value = (*color, 1)
    back.inputs["Color"].default_value = (*(min(1.8 * c, 1) for c in color), 1)
    gloss.inputs["Roughness"].default_value = 0.35
    tree.links.new(front.outputs[0], inner.inputs[1])
    tree.links.new(back.outputs[0], inner.inputs[2])
    tree.links.new(inner.outputs[0], outer.inputs[1])
    tree.links.new(gloss.outputs[0], outer.inputs[2])
    return material


def sapling(bark: Any, leaves: Any, rng: Any) -> Any:
    """A stem with twigs and folded leaves, as one mesh."""
    points: list[Any] = []
    faces: list[tuple[int, ...]] = []
    slots: list[int] = []

    def tube(low: Any, high: Any, wide: float, narrow: float) -> None:
        axis = (high - low) / np.linalg.norm(high - low)
        side = np.cross(axis, [0.3, 0.9, 0.2])
        side /= np.linalg.norm(side)
        other = np.cross(axis, side)
        first = len(points)
        for end, radius in ((low, wide), (high, narrow)):
            for step in range(6):
                angle = math.tau * step / 6
                points.append(end + radius * (math.cos(angle) * side + math.sin(angle) * other))
        for step in range(6):
            after = (step + 1) % 6
            faces.append((first + step, first + after, first + 6 + after, first + 6 + step))
            slots.append(0)

    def blade(root: Any, along: Any, size: float) -> None:
        along = along / np.linalg.norm(along)
        side = np.cross(along, [0.05, 0.1, 1.0])
        side /= np.linalg.norm(side)
        up = np.cross(side, along)
        first = len(points)
        rib = [root, root + 0.5 * size * along, root + size * along - 0.12 * size * up]
        points.extend([*rib, rib[1] + 0.3 * size * (side + 0.35 * up), rib[1] - 0.3 * size * (side - 0.35 * up)])
        faces.extend([(first, first + 3, first + 1), (first + 1, first + 3, first + 2)])
        faces.extend([(first, first + 1, first + 4), (first + 1, first + 2, first + 4)])
        slots.extend([1] * 4)

    height = 2.6
    tube(np.zeros(3), np.array([0.05, 0.02, height]), 0.055, 0.015)
    twigs = max(int(22 * parts.detail), 3)
    for twig in range(twigs):
        z = 0.5 + (height - 0.55) * twig / twigs
        angle = 2.4 * twig + rng.uniform(-0.3, 0.3)
        reach = 0.95 * (1 - 0.62 * z / height)
        low = np.array([0.05 * z / height, 0.02 * z / height, z])
        high = low + np.array([reach * math.cos(angle), reach * math.sin(angle), 0.32 * reach])
        tube(low, high, 0.014, 0.004)
        count = max(int(13 * parts.detail), 2)
        for step in range(count):
            root = low + (high - low) * (0.25 + 0.75 * step / count)
            turn = angle + (0.9 if step % 2 else -0.9) + rng.uniform(-0.4, 0.4)
            blade(root, np.array([math.cos(turn), math.sin(turn), rng.uniform(-0.35, 0.25)]), rng.uniform(0.17, 0.27))
    mesh = bpy.data.meshes.new("Sapling")
    mesh.from_pydata([tuple(map(float, point)) for point in points], [], faces)
    mesh.materials.append(bark)
    mesh.materials.append(leaves)
    mesh.polygons.foreach_set("material_index", np.array(slots, np.int32))
    mesh.update()
    return mesh

# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes and materials of the scenes of `composed`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

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

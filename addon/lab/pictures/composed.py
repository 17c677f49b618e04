# SPDX-License-Identifier: GPL-3.0-or-later
"""Two composed scenes of what the small ones lack: cones of light in a medium, and motion blurred by the shutter."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import bpy

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


def fog(scene: Any) -> None:
    """A street at night: lanterns with cones of light in fog, a wet road, a glowing window, the moon."""
    parts.new_world(scene, (0.012, 0.018, 0.035))
    road = parts.plane(scene, 24)
    parts.wear(road, bumpy("Asphalt", (0.035, 0.037, 0.042), scale=60, strength=0.25, Roughness=0.28))
    glow = parts.one_shader("Lantern", "Emission", Color=(1, 0.7, 0.38, 1), Strength=30)
    iron = parts.principled("Iron", (0.03, 0.03, 0.035), Metallic=1, Roughness=0.45)
    for row in range(4):
        for side in (-1, 1):
            x, y = 2.1 * side, 1.0 + 3.6 * row
            post = lathe(scene, "Post", [(0.12, 0), (0.1, 0.25), (0.05, 0.35), (0.04, 2.6), (0.16, 2.62), (0, 2.75)])
            post.location = (x, y, 0)
            parts.wear(post, iron)
            bulb = parts.sphere(scene, (x - 0.12 * side, y, 2.5), 0.09, rings=12)
            parts.wear(bulb, glow)
            light = parts.lamp(
                scene, "SPOT", (x - 0.12 * side, y, 2.36), (x - 0.6 * side, y - 0.4, 0), energy=2400, spot_size=1.5
            )
            light.data.color, light.data.shadow_soft_size, light.data.spot_blend = (1, 0.66, 0.32), 0.06, 0.5
    house = parts.box(scene, (-4.6, 8.5, 2), (1.6, 4, 2))
    parts.wear(house, bumpy("Plaster", (0.2, 0.17, 0.15), scale=12, strength=0.5, Roughness=0.9))
    pane = parts.polygons(
        scene, "Window", [(-2.99, 6.3, 1.5), (-2.99, 7.3, 1.5), (-2.99, 7.3, 2.7), (-2.99, 6.3, 2.7)], [(0, 1, 2, 3)]
    )
    parts.wear(pane, parts.one_shader("Glow", "Emission", Color=(1, 0.6, 0.25, 1), Strength=3))
    walker = lathe(
        scene,
        "Walker",
        [(0.16, 0), (0.2, 0.6), (0.24, 1.05), (0.12, 1.3), (0.07, 1.34), (0.12, 1.45), (0.1, 1.58), (0, 1.63)],
    )
    walker.location = (0.35, 5.2, 0)
    parts.wear(walker, parts.principled("Coat", (0.02, 0.02, 0.025), Roughness=0.8))
    air = parts.box(scene, (0, 9, 2.9), (9, 14, 3))
    air.name = "Air"
    parts.wear(air, medium("Fog", (0.9, 0.93, 1), density=0.045, anisotropy=0.35))
    moon = parts.lamp(scene, "SUN", (0, 0, 9), (-3, -4, 0), energy=0.35, angle=0.02)
    moon.data.color = (0.6, 0.75, 1)
    parts.look(scene, (0.5, -7.4, 1.5), (0, 5, 1.55), 32)


def wheel(scene: Any) -> None:
    """A spoked wheel that rolls past a fence: turning, moving, and blurred where the shutter is open."""
    parts.new_world(scene, (0.45, 0.6, 0.85))
    ground = parts.plane(scene, 14)
    parts.wear(ground, bumpy("Gravel", (0.34, 0.29, 0.22), scale=9, strength=0.6, Roughness=0.95))
    rubber = parts.principled("Rubber", (0.02, 0.02, 0.022), Roughness=0.6)
    chrome = parts.principled("Chrome", (0.85, 0.86, 0.88), Metallic=1, Roughness=0.12)
    red = parts.principled("Lacquer", (0.6, 0.03, 0.02), Roughness=0.35, Coat_Weight=1, Coat_Roughness=0.04)
    hub = bpy.data.objects.new("Wheel", None)
    scene.collection.objects.link(hub)
    for part, material in (
        (torus(scene, "Tyre", 1.0, 0.11), rubber),
        (torus(scene, "Rim", 0.88, 0.045), chrome),
        (torus(scene, "Hub", 0.12, 0.09), red),
    ):
        parts.wear(part, material)
        part.parent = hub
    for step in range(12):
        angle = math.tau * step / 12
        spoke = parts.box(scene, (0, 0, 0), (0.36, 0.02, 0.02))
        spoke.location = (0.5 * math.cos(angle), 0, 0.5 * math.sin(angle))
        spoke.rotation_euler.y = -angle
        parts.wear(spoke, red if step % 3 == 0 else chrome)
        spoke.parent = hub
    # It rolls: a turn of one radian per unit.
    scene.frame_set(10)
    for frame, x in ((9, -0.25), (11, 0.25)):
        hub.location, hub.rotation_euler = (x, 0, 1.11), (0, x / 1.11, 0)
        hub.keyframe_insert("location", frame=frame)
        hub.keyframe_insert("rotation_euler", frame=frame)
    linear(hub)
    fence = wood("Fence", (0.3, 0.2, 0.12), (0.45, 0.33, 0.2), scale=2.0)
    for number in range(9):
        slat = parts.box(scene, (0.72 * number - 2.9, 1.5, 0.7), (0.22, 0.04, 0.7))
        parts.wear(slat, fence)
    rail = parts.box(scene, (0, 1.58, 1.05), (3.4, 0.04, 0.09))
    parts.wear(rail, fence)
    parts.lamp(scene, "SUN", (0, 0, 5), (2, 3, 0), energy=3.2, angle=0.03)
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter = True, 0.7
    scene.halfspace.motion_steps = 16
    parts.look(scene, (-1.2, -5.6, 1.5), (0, 0, 0.95), 30)


SCENES: dict[str, Callable[[Any], None]] = {"fog": fog, "wheel": wheel}

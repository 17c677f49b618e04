# SPDX-License-Identifier: GPL-3.0-or-later
"""A bare geometry as a renderable Blender scene: one grey surface, a camera, sun, lamp and sky."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...blender.samples import arrays, camera
from ...blender.samples.camera import looking
from . import proving_parts as parts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...core.base.arrays import F64
    from ...core.scene.workload import View, Workload

SUN, SKY = 4.0, (0.35, 0.5, 0.8)
"""Irradiance of the sun in W/m², and radiance of the sky."""

LAMP = 0.35
"""Brightness of the lamp, relative to the sun's 4 W/m², at a tenth of the scene's diagonal."""

LIGHTS = ("sun", "lamp", "sky")
"""Default lights of a geometry. "point" instead of "lamp" is the same lamp without size."""

ALL_LIGHTS = (*LIGHTS, "point", "area", "panorama")
"""All lights. "area" is a square that faces down, in the lamp's place; "panorama" an image with a bright disc in place
of the sky.
"""


def build(scene: Any, workload: Workload, lights: Sequence[str] = LIGHTS) -> None:
    """Fill an empty scene with a workload's triangles, seen by its view, in its own coordinates and up direction."""
    arrays.add(scene, workload)
    _lights(scene, workload.view, workload.diagonal(), lights)


def complete(scene: Any, workload: Workload, *, see: bool, lights: Sequence[str]) -> None:
    """Add what a scene lacks, whose triangles are the workload's: the camera of its view with `see`, and these lights.

    The workload's coordinates are relative to its origin.
    """
    origin = workload.origin()
    view = replace(workload.view, eye=workload.view.eye + origin, target=workload.view.target + origin)
    if see:
        camera.see(scene, view)
    _lights(scene, view, workload.diagonal(), lights)


def _lights(scene: Any, view: View, diagonal: float, chosen: Sequence[str]) -> None:
    """Add those lights that are chosen: a sun high behind the left shoulder, a lamp ahead above the line of sight, a
    blue sky.
    """
    up = np.array(view.up) / np.linalg.norm(view.up)
    forward = np.array(view.target) - view.eye
    forward -= up * (forward @ up)
    forward /= np.linalg.norm(forward) or 1.0
    left = np.cross(up, forward)

    if "sun" in chosen:
        sun = bpy.data.lights.new("Sun", "SUN")
        sun.energy, sun.angle, sun.color = SUN, np.radians(0.53), (1.0, 0.93, 0.82)
        _add(scene, sun, looking(np.zeros(3), -up - 0.25 * left + 0.2 * forward, up + 1e-3 * forward))
    if "lamp" in chosen or "point" in chosen:
        distance = 0.1 * diagonal
        lamp = bpy.data.lights.new("Lamp", "POINT")
        lamp.energy, lamp.color = LAMP * SUN * 4 * np.pi**2 * distance**2, (1.0, 0.62, 0.3)
        lamp.shadow_soft_size = 0.03 * distance if "lamp" in chosen else 0.0
        place = np.array(view.eye) + 2.5 * distance * forward + 0.3 * distance * up - 0.2 * distance * left
        _add(scene, lamp, Matrix.Translation(Vector(place)))
    if "area" in chosen:
        side = 0.1 * diagonal
        area = bpy.data.lights.new("Area", "AREA")
        area.size, area.energy = side, SUN * 4 * np.pi * side**2
        place = np.array(view.eye) + 1.5 * side * forward + side * up
        _add(scene, area, looking(place, place - up, forward))
    if "sky" in chosen:
        _sky(scene)
    if "panorama" in chosen:
        _panorama(scene, up)


def _sky(scene: Any) -> None:
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*SKY, 1.0)
    background.inputs["Strength"].default_value = 1.0
    scene.world = world


def _panorama(scene: Any, up: F64) -> None:
    """An image as background, whose zenith points up."""
    world = parts.new_world(scene, (0, 0, 0))
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    texture, mapping, where = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord")
    )
    texture.image = parts.picture("Panorama", parts.panorama_pixels(), "Linear Rec.709", floats=True)
    mapping.inputs["Rotation"].default_value = Vector(up).rotation_difference(Vector((0, 0, 1))).to_euler()
    tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], background.inputs["Color"])


def _add(scene: Any, light: Any, matrix: Any) -> None:
    item = bpy.data.objects.new(light.name, light)
    item.matrix_world = matrix
    scene.collection.objects.link(item)

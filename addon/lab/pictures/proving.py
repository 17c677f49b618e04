# SPDX-License-Identifier: GPL-3.0-or-later
"""Seven small scenes that together use all features of the renderer, and the composed ones, for comparison with Cycles.

Generated in Blender from numbers alone, always the same; images are packed, so that a saved file is self-contained.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from . import composed
from . import proving_parts as parts


def build(name: str, scene: Any, *, detail: float = 1.0) -> None:
    """Fill the empty scene with one of SCENES; smaller `detail` makes fewer triangles."""
    parts.detail = detail
    SCENES[name](scene)


def _furnace(scene: Any) -> None:
    """Furnace test: white surfaces in a white world are invisible if no energy is lost."""
    parts.new_world(scene, (1, 1, 1))
    kinds: list[dict[str, float]] = [
        {"Metallic": 1},
        {"Metallic": 0},
        {"Transmission Weight": 1},
    ]
    for row, values in enumerate(kinds):
        for column, roughness in enumerate((0.05, 0.4, 1.0)):
            ball = parts.sphere(scene, (2.2 * (column - 1), 0, 2.2 * (row - 1)), 1.0, rings=24)
            parts.wear(ball, parts.principled("White", (1, 1, 1), Roughness=roughness, **values))
    parts.look(scene, (0, -14, 0), (0, 0, 0), 28)


def _cornell(scene: Any) -> None:
    """A closed box lit by an emissive square below its ceiling."""
    parts.new_world(scene, (0, 0, 0))
    white, red, green = (
        parts.one_shader(name, "BsdfDiffuse", Color=(*color, 1))
        for name, color in (
            ("White", (0.73, 0.73, 0.73)),
            ("Red", (0.65, 0.05, 0.05)),
            ("Green", (0.12, 0.45, 0.15)),
        )
    )
    for corners, material in (
        ([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)], white),
        ([(-1, -1, 1), (-1, 1, 1), (1, 1, 1), (1, -1, 1)], white),
        ([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)], white),
        ([(-1, -1, -1), (-1, 1, -1), (-1, 1, 1), (-1, -1, 1)], red),
        ([(1, -1, -1), (1, -1, 1), (1, 1, 1), (1, 1, -1)], green),
        ([(-0.3, -0.3, 0.99), (-0.3, 0.3, 0.99), (0.3, 0.3, 0.99), (0.3, -0.3, 0.99)], None),
    ):
        wall = parts.polygons(scene, "Wall", corners, [(0, 1, 2, 3)])
        parts.wear(wall, material or parts.one_shader("Glow", "Emission", Color=(1, 0.85, 0.6, 1), Strength=14))
    for place, size, turn in (((0.35, -0.35, -0.7), (0.3, 0.3, 0.3), -0.3), ((-0.35, 0.3, -0.4), (0.3, 0.3, 0.6), 0.3)):
        box = parts.box(scene, place, size)
        box.rotation_euler.z = turn
        parts.wear(box, white)
    parts.look(scene, (0, -4.6, 0), (0, 0, 0), 32)


def _spheres(scene: Any) -> None:
    """Glass and metal, smooth and rough, coated and tinted, on a chequered floor below a large lamp."""
    parts.new_world(scene, (0.35, 0.45, 0.6))
    # Link a chequered texture to the floor's colour.
    floor = parts.plane(scene, 8)
    material = parts.principled("Floor", (0.5, 0.5, 0.5), Roughness=0.6)
    tree, shader = material.node_tree, parts.principled_node(material)
    checker, where = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes.new("ShaderNodeTexCoord")
    checker.inputs["Color1"].default_value = (0.7, 0.68, 0.62, 1)
    checker.inputs["Color2"].default_value = (0.12, 0.14, 0.18, 1)
    checker.inputs["Scale"].default_value = 1.0
    tree.links.new(where.outputs["Object"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], shader.inputs["Base Color"])
    parts.wear(floor, material)
    # Place four spheres in the back row and four in front of them.
    row = (
        parts.principled("Mirror", (0.9, 0.9, 0.92), Metallic=1, Roughness=0),
        parts.principled("Gold", (1, 0.71, 0.29), Metallic=1, Roughness=0.35, Specular_Tint=(1, 0.6, 0.4, 1)),
        parts.one_shader("Glass", "BsdfGlass", Color=(0.95, 1, 0.97, 1), Roughness=0, IOR=1.5),
        parts.one_shader("Frosted", "BsdfGlass", Color=(1, 1, 1, 1), Roughness=0.3, IOR=1.4),
    )
    front = (
        parts.principled("Car paint", (0.5, 0.02, 0.02), Roughness=0.5, Coat_Weight=1, Coat_Roughness=0.05),
        parts.one_shader("Satin", "BsdfAnisotropic", Color=(0.3, 0.6, 0.9, 1), Roughness=0.3),
        parts.mixed("Half silvered", 0.5),
        parts.principled("Tinted glass", (0.9, 0.5, 0.2), Transmission_Weight=1, Roughness=0.1, IOR=1.45),
    )
    for i, (behind, before) in enumerate(zip(row, front, strict=True)):
        parts.wear(parts.sphere(scene, (2.1 * i - 3.15, 1, 0.95), 0.95), behind)
        parts.wear(parts.sphere(scene, (1.6 * i - 2.4, -1.2, 0.6), 0.6), before)
    parts.lamp(scene, "AREA", (-3, -3, 5), (0, 0, 0), energy=400, size=2.0)
    parts.look(scene, (0, -9.5, 3.2), (0, -0.2, 0.6), 34)


def _textures(scene: Any) -> None:
    """Images on colour, roughness, metal, opacity and normals; vertex colours; procedural patterns."""
    parts.new_world(scene, (0.8, 0.8, 0.85))
    rng = np.random.default_rng(5)
    tiles, rough, bumps = parts.tiles_picture(rng), parts.spots_picture(rng), parts.bumps_picture()
    ground = parts.plane(scene, 6)
    parts.wear(ground, parts.pictured("Ground", tiles, rough, bumps, scale=3))
    for x, make in ((-2.2, parts.sphere), (0.0, parts.box)):
        item = (
            make(scene, (x, 0.6, 0.95), 0.9)
            if make is parts.sphere
            else parts.box(scene, (x, 0.6, 0.7), (0.7, 0.7, 0.7))
        )
        item.rotation_euler = (0.2, 0.1, 0.5)
        parts.wear(item, parts.pictured("Tiles", tiles, rough, bumps, scale=2, metallic=True))
    colored = parts.sphere(scene, (2.2, 0.6, 0.95), 0.9)
    parts.wear(colored, parts.vertex_colors(colored.data))
    leaf = parts.polygons(
        scene, "Leaf", [(-1.6, -1.4, 0.1), (-0.2, -1.4, 0.1), (-0.2, -1.1, 1.4), (-1.6, -1.1, 1.4)], [(0, 1, 2, 3)]
    )
    parts.unwrap(leaf.data, np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))
    parts.wear(leaf, parts.cut_out())
    cloud = parts.sphere(scene, (1.0, -1.2, 0.6), 0.6)
    parts.wear(cloud, parts.noisy())
    parts.lamp(scene, "SUN", (0, 0, 5), (0.5, 0.8, 0), energy=2.5, angle=0.05)
    parts.look(scene, (0, -8.0, 3.4), (0, 0, 0.5), 36)


def _sky(scene: Any) -> None:
    """A rotated panorama with a small bright sun in it, and a sun lamp."""
    panorama = parts.picture("Panorama", parts.panorama_pixels(), "Linear Rec.709", floats=True)
    # Link the panorama through a rotation to the background.
    world = parts.new_world(scene, (0, 0, 0))
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    texture, mapping, where = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord")
    )
    texture.image = panorama
    mapping.inputs["Rotation"].default_value = (0.1, 0.2, 0.9)
    tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.8
    parts.wear(parts.plane(scene, 6), parts.one_shader("Ground", "BsdfDiffuse", Color=(0.4, 0.4, 0.4, 1)))
    for i, material in enumerate(
        (
            parts.principled("Plastic", (0.1, 0.3, 0.6), Roughness=0.3),
            parts.principled("Chrome", (0.9, 0.9, 0.9), Metallic=1, Roughness=0.08),
            parts.one_shader("Chalk", "BsdfDiffuse", Color=(0.8, 0.8, 0.8, 1)),
        )
    ):
        parts.wear(parts.sphere(scene, (2.2 * (i - 1), 0, 1), 1.0), material)
    parts.lamp(scene, "SUN", (0, 0, 5), (1, 0.6, 0), energy=1.5, angle=0.02)
    parts.look(scene, (0, -9, 3), (0, 0, 0.8), 32)


def _forest(scene: Any) -> None:
    """Trees of two kinds: each mesh once, a thousand instances."""
    parts.new_world(scene, (0.5, 0.65, 0.9))
    parts.wear(parts.plane(scene, 30), parts.one_shader("Earth", "BsdfDiffuse", Color=(0.2, 0.15, 0.08, 1)))
    bark = parts.one_shader("Bark", "BsdfDiffuse", Color=(0.15, 0.08, 0.04, 1))
    leaves = parts.principled("Leaves", (0.06, 0.22, 0.04), Roughness=0.5)
    rng = np.random.default_rng(11)
    kinds = [parts.tree_mesh(bark, leaves, levels) for levels in (3, 5)]
    for _ in range(max(int(1000 * parts.detail**2), 4)):
        item = bpy.data.objects.new("Tree", kinds[int(rng.integers(2))])
        x, y = rng.uniform(-20, 20, 2)
        item.location = (x, y, 0)
        item.rotation_euler = (*rng.uniform(-0.05, 0.05, 2), rng.uniform(0, 6.28))
        item.scale = (*[rng.uniform(0.7, 1.3)] * 2, rng.uniform(0.7, 1.6))
        scene.collection.objects.link(item)
    parts.lamp(scene, "SUN", (0, 0, 30), (12, 8, 0), energy=3, angle=0.02)
    parts.look(scene, (0, -30, 10), (0, -4, 1), 36)


def _hidden(scene: Any) -> None:
    """Boxes, an emissive strip and two lamps, each hidden from some rays, between mirrors and glass."""
    parts.new_world(scene, (0.3, 0.35, 0.4))
    parts.wear(parts.plane(scene, 5), parts.principled("Floor", (0.5, 0.5, 0.5), Roughness=0.25))
    wall = parts.polygons(scene, "Wall", [(-4, 3, 0), (4, 3, 0), (4, 3, 3), (-4, 3, 3)], [(0, 1, 2, 3)])
    parts.wear(wall, parts.one_shader("Mirror", "BsdfAnisotropic", Color=(0.9, 0.9, 0.9, 1), Roughness=0.0))
    pane = parts.polygons(scene, "Pane", [(-3.5, -3, 0), (-2, -3, 0), (-2, -3, 2), (-3.5, -3, 2)], [(0, 1, 2, 3)])
    parts.wear(pane, parts.one_shader("Glass", "BsdfGlass", Color=(1, 1, 1, 1), Roughness=0.0, IOR=1.02))
    for i, ray in enumerate(("camera", "diffuse", "glossy", "transmission", "shadow")):
        box = parts.box(scene, (1.4 * i - 2.8, 0.5, 0.5), (0.4, 0.4, 0.5))
        color = (0.8, 0.1 + 0.15 * i, 0.7 - 0.15 * i, 1)
        parts.wear(box, parts.one_shader(f"Not by {ray} rays", "BsdfDiffuse", Color=color))
        setattr(box, f"visible_{ray}", False)
    strip = parts.polygons(scene, "Strip", [(-1, 1.5, 2), (1, 1.5, 2), (1, 1.8, 2.3), (-1, 1.8, 2.3)], [(0, 1, 2, 3)])
    parts.wear(strip, parts.one_shader("Glow", "Emission", Color=(1, 0.8, 0.5, 1), Strength=6))
    strip.visible_diffuse = False
    area = parts.lamp(scene, "AREA", (2, -1, 3), (0, 0, 0), energy=60, size=0.8)
    area.visible_camera, area.visible_glossy = True, False
    point = parts.lamp(scene, "POINT", (-2, -1, 2.5), (0, 0, 0), energy=60, shadow_soft_size=0.3)
    point.visible_camera, point.visible_diffuse = False, False
    parts.look(scene, (0, -8, 3.2), (0, 0, 0.7), 40)


SCENES: dict[str, Callable[[Any], None]] = {
    "furnace": _furnace,
    "cornell": _cornell,
    "spheres": _spheres,
    "textures": _textures,
    "sky": _sky,
    "forest": _forest,
    "hidden": _hidden,
    **composed.SCENES,
}


LAYER = (
    "The share of light that a rough dielectric layer withholds from the base below it: at 82° (roughness 0.4, index "
    "1.38) 0.207 in Cycles, 0.197 in Halfspace, and 0.196 by integration over all directions without multiple "
    "scattering in the layer; so the base is up to 1.5 % darker in Cycles towards the horizon."
)

DIFFERENCES: dict[str, tuple[str, float]] = {"textures": (LAYER, 8e-3)}
"""Known differences between the two engines, by scene, and the share of a square's brightness that they
may amount to.
"""

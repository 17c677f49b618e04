# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the time and the memory of whole renders: instances with textures, hair, cut-outs, rays of shaders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from . import proving_parts as parts

TREES, TREE = 2000, 50_000
"""Instances of the woods, and triangles of their tree."""

BLADES, HAIRS, CARDS, GRAINS = 100_000, 6000, 4000, 100_000
"""Blades of the meadow, hairs of the fur, leaves of the foliage, and grains of the sand."""

BOXES, BALLS = 60, 30
"""Boxes of the patina, and balls of the wax."""


def build(name: str, scene: Any, *, detail: float = 1.0) -> None:
    """Fill the empty scene with one of SCENES. detail: factor on the numbers of instances, hairs and leaves."""
    parts.new_world(scene, (0.5, 0.6, 0.8))
    parts.lamp(scene, "SUN", (0, 0, 30), (12, 8, 0), energy=3, angle=0.02)
    SCENES[name](scene, detail)


def _woods(scene: Any, detail: float) -> None:
    """Instances of one tree with an image on each leaf, and a hue of its own for each instance."""
    rng = np.random.default_rng(2)
    _ground(scene, 60)
    # Place leaves around a trunk, each a square with the whole image.
    leaves = TREE // 2
    centres = rng.normal(0, 1, (leaves, 3)) * (0.8, 0.8, 1.2) + (0, 0, 3.4)
    mesh = _leaves(scene, "Tree", centres, 0.05, rng)
    parts.wear(mesh, _leafy(rng))
    scene.collection.objects.unlink(mesh)
    for place in rng.uniform(-50, 50, (max(int(TREES * detail), 2), 2)):
        item = bpy.data.objects.new("Tree", mesh.data)
        item.location = (*place, 0)
        item.rotation_euler.z = rng.uniform(0, 6.28)
        item.scale = [rng.uniform(0.7, 1.4)] * 3
        scene.collection.objects.link(item)
    parts.look(scene, (0, -70, 25), (0, -10, 1), 36)


def _meadow(scene: Any, detail: float) -> None:
    """Blades of grass as hair curves, and a ball among them."""
    rng = np.random.default_rng(3)
    _ground(scene, 8)
    count = max(int(BLADES * detail), 2)
    roots = np.column_stack([rng.uniform(-6, 6, (count, 2)), np.zeros(count)])
    heights, leans = rng.uniform(0.15, 0.4, count), rng.normal(0, 0.12, (count, 2))
    along = np.linspace(0, 1, 5)[None, :, None]
    bent = np.column_stack([leans, heights])[:, None] * np.concatenate([along**2, along**2, along], axis=2)
    blade = parts.principled("Blade", (0.1, 0.35, 0.05), Roughness=0.6)
    parts.strands(scene, "Grass", roots[:, None] + bent, 0.006, 0.001, blade)
    parts.wear(parts.sphere(scene, (0, 0, 0.6), 0.6), parts.principled("Ball", (0.6, 0.2, 0.1), Roughness=0.3))
    parts.look(scene, (0, -9, 2.4), (0, 0, 0.3), 40)


def _fur(scene: Any, detail: float) -> None:
    """A ball with hair."""
    rng = np.random.default_rng(4)
    _ground(scene, 8)
    count = max(int(HAIRS * detail), 2)
    roots = rng.normal(0, 1, (count, 3))
    roots /= np.linalg.norm(roots, axis=1, keepdims=True)
    along = np.linspace(1, 1.5, 9)[None, :, None]
    curled = roots[:, None] * along + np.cumsum(rng.normal(0, 0.01, (count, 9, 3)), axis=1) + (0, 0, 1.6)
    hair = parts.principled("Hair", (0.3, 0.16, 0.06), Roughness=0.5)
    parts.strands(scene, "Fur", curled, 0.005, 0.001, hair)
    parts.wear(parts.sphere(scene, (0, 0, 1.6), 1.0), parts.principled("Skin", (0.5, 0.35, 0.3), Roughness=0.5))
    parts.look(scene, (0, -8, 2.4), (0, 0, 1.5), 34)


def _foliage(scene: Any, detail: float) -> None:
    """Leaves whose outlines are in the alpha of an image."""
    rng = np.random.default_rng(5)
    _ground(scene, 8)
    count = max(int(CARDS * detail), 2)
    centres = rng.normal((0, 0, 2.5), 1, (count, 3))
    parts.wear(_leaves(scene, "Leaves", centres, 0.15, rng), parts.cut_out())
    parts.look(scene, (0, -9, 3.0), (0, 0, 2.2), 40)


def _patina(scene: Any, detail: float) -> None:
    """Boxes and a ball whose edges are rounded and whose hollows are dark."""
    rng = np.random.default_rng(6)
    _ground(scene, 8)
    worn = _worn()
    for place in rng.uniform((-3, -3, 0.2), (3, 3, 1.2), (max(int(BOXES * detail), 2), 3)):
        parts.wear(parts.box(scene, tuple(place), tuple(rng.uniform(0.1, 0.5, 3))), worn)
    parts.wear(parts.sphere(scene, (0, 0, 1.6), 0.9), worn)
    parts.look(scene, (0, -9, 4.0), (0, 0, 0.8), 40)


def _wax(scene: Any, detail: float) -> None:
    """Balls below whose surface light scatters."""
    rng = np.random.default_rng(7)
    _ground(scene, 8)
    values = {"Subsurface_Weight": 1.0, "Subsurface_Radius": (0.3, 0.15, 0.08), "Subsurface_Scale": 1.0}
    wax = parts.principled("Wax", (0.8, 0.55, 0.4), Roughness=0.4, **values)
    for x, y, radius in rng.uniform((-3, -3, 0.2), (3, 3, 0.7), (max(int(BALLS * detail), 2), 3)):
        parts.wear(parts.sphere(scene, (x, y, radius), radius), wax)
    parts.look(scene, (0, -9, 4.0), (0, 0, 0.5), 40)


def _sand(scene: Any, detail: float) -> None:
    """Points, each with a colour of its own."""
    rng = np.random.default_rng(8)
    _ground(scene, 8)
    count = max(int(GRAINS * detail), 2)
    grain = parts.principled("Grain", (0.6, 0.5, 0.35), Roughness=0.7)
    shade = grain.node_tree.nodes.new("ShaderNodeAttribute")
    shade.attribute_name = "shade"
    grain.node_tree.links.new(shade.outputs["Color"], parts.principled_node(grain).inputs["Base Color"])
    centres = rng.normal((0, 0, 1.6), (1.6, 1.6, 0.5), (count, 3))
    colours = np.column_stack([rng.uniform(0.2, 0.9, (count, 3)), np.ones(count)])
    parts.points(scene, "Sand", centres, rng.uniform(0.01, 0.04, count), colours, grain)
    parts.look(scene, (0, -9, 3.0), (0, 0, 1.3), 40)


def _worn() -> Any:
    """A material that looks at what lies around its points: Ambient Occlusion, Bevel and Pointiness."""
    material = parts.principled("Worn", (0.6, 0.45, 0.3), Roughness=0.5)
    tree, shader = material.node_tree, parts.principled_node(material)
    hollow, edge, form, mix = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("AmbientOcclusion", "Bevel", "NewGeometry", "Mix")
    )
    hollow.inputs["Distance"].default_value, edge.inputs["Radius"].default_value = 0.6, 0.06
    # Darken the hollows, and brighten what is pointed.
    mix.data_type = "RGBA"
    mix.inputs[7].default_value = (0.9, 0.8, 0.6, 1)
    tree.links.new(hollow.outputs["Color"], mix.inputs[6])
    tree.links.new(form.outputs["Pointiness"], mix.inputs[0])
    tree.links.new(mix.outputs[2], shader.inputs["Base Color"])
    tree.links.new(edge.outputs["Normal"], shader.inputs["Normal"])
    return material


def _leaves(scene: Any, name: str, centres: Any, size: float, rng: Any) -> Any:
    """Parallelograms around these (n, 3) centres, turned at random, each with a whole image."""
    count = len(centres)
    u, v = (rng.normal(0, size, (count, 3)) for _ in range(2))
    corners = np.stack([centres - u - v, centres + u - v, centres + u + v, centres - u + v], axis=1)
    item = parts.polygons(scene, name, corners.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4))
    parts.unwrap(item.data, np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (count, 1)))
    return item


def _ground(scene: Any, half: float) -> None:
    """A floor with an image."""
    plane = parts.plane(scene, half)
    material = parts.principled("Ground", (0.3, 0.3, 0.3), Roughness=0.8)
    _colour(material, parts.tiles_picture(np.random.default_rng(1)))
    parts.wear(plane, material)


def _leafy(rng: Any) -> Any:
    """An image whose hue differs between objects."""
    material = parts.principled("Leaf", (0.2, 0.4, 0.1), Roughness=0.6)
    _colour(material, parts.tiles_picture(rng))
    tree, shader = material.node_tree, parts.principled_node(material)
    turned, number = tree.nodes.new("ShaderNodeHueSaturation"), tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(shader.inputs["Base Color"].links[0].from_socket, turned.inputs["Color"])
    tree.links.new(number.outputs["Random"], turned.inputs["Hue"])
    tree.links.new(turned.outputs["Color"], shader.inputs["Base Color"])
    return material


def _colour(material: Any, image: Any) -> None:
    """Link an image to the material's colour."""
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.links.new(texture.outputs["Color"], parts.principled_node(material).inputs["Base Color"])


SCENES: dict[str, Callable[[Any, float], None]] = {
    "woods": _woods,
    "meadow": _meadow,
    "fur": _fur,
    "foliage": _foliage,
    "patina": _patina,
    "wax": _wax,
    "sand": _sand,
}

# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees, saplings and ferns for the forest of `composed`."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ...core.base.arrays import F64
from . import proving_parts as parts
from .proving_parts import Color


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


class Plant:
    """A mesh of wood, which is the first material, and of leaves, the second one."""

    def __init__(self) -> None:
        self.points: list[F64] = []
        self.faces: list[tuple[int, ...]] = []
        self.slots: list[int] = []

    def tube(self, low: F64, high: F64, wide: float, narrow: float, sides: int = 6) -> None:
        """Add a piece of wood that becomes thinner."""
        axis = (high - low) / np.linalg.norm(high - low)
        side = np.cross(axis, [0.3, 0.9, 0.2])
        side /= np.linalg.norm(side)
        other = np.cross(axis, side)
        first = len(self.points)
        for end, radius in ((low, wide), (high, narrow)):
            for step in range(sides):
                angle = math.tau * step / sides
                self.points.append(end + radius * (math.cos(angle) * side + math.sin(angle) * other))
        for step in range(sides):
            after = (step + 1) % sides
            self.faces.append((first + step, first + after, first + sides + after, first + sides + step))
            self.slots.append(0)

    def blade(self, root: F64, along: F64, size: float, breadth: float = 0.3) -> None:
        """Add a folded leaf."""
        along = along / np.linalg.norm(along)
        side = np.cross(along, [0.05, 0.1, 1.0])
        side /= np.linalg.norm(side)
        up = np.cross(side, along)
        first = len(self.points)
        rib = [root, root + 0.5 * size * along, root + size * along - 0.12 * size * up]
        rise = 0.35 * up
        self.points.extend([*rib, rib[1] + breadth * size * (side + rise), rib[1] - breadth * size * (side - rise)])
        self.faces.extend([(first, first + 3, first + 1), (first + 1, first + 3, first + 2)])
        self.faces.extend([(first, first + 1, first + 4), (first + 1, first + 2, first + 4)])
        self.slots.extend([1] * 4)

    def mesh(self, name: str, wood: Any, leaves: Any) -> Any:
        """The mesh with its materials."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(map(float, point)) for point in self.points], [], self.faces)
        mesh.materials.append(wood)
        mesh.materials.append(leaves)
        mesh.polygons.foreach_set("material_index", np.array(self.slots, np.int32))
        mesh.update()
        return mesh


def sapling(wood: Any, leaves: Any, rng: Any) -> Any:
    """A stem with twigs and leaves, 2.6 units high."""
    plant = Plant()
    height = 2.6
    plant.tube(np.zeros(3), np.array([0.05, 0.02, height]), 0.035, 0.012)
    twigs = max(int(22 * parts.detail), 3)
    for twig in range(twigs):
        z = 0.5 + (height - 0.55) * twig / twigs
        angle = 2.4 * twig + rng.uniform(-0.3, 0.3)
        reach = 0.95 * (1 - 0.62 * z / height)
        low = np.array([0.05 * z / height, 0.02 * z / height, z])
        high = low + np.array([reach * math.cos(angle), reach * math.sin(angle), 0.32 * reach])
        plant.tube(low, high, 0.014, 0.004)
        _leafy(plant, rng, low, high, max(int(13 * parts.detail), 2), (0.17, 0.27))
    return plant.mesh("Sapling", wood, leaves)


def tree(wood: Any, leaves: Any, rng: Any) -> Any:
    """A tall tree with a bent trunk and a crown that begins above the camera, about 9 units high."""
    plant = Plant()
    sides = max(int(14 * parts.detail), 5)
    # Stack the trunk, wider at the roots.
    at = np.zeros(3)
    stem = [at]
    radii = [0.24, 0.16, 0.14, 0.12, 0.1, 0.09, 0.07, 0.04]
    for _ in radii[1:]:
        at = at + np.array([*rng.normal(0, 0.1, 2), 1.3])
        stem.append(at)
    stem[1] = stem[0] + 0.35 * (stem[1] - stem[0])
    for low, high, wide, narrow in zip(stem, stem[1:], radii, radii[1:], strict=False):
        plant.tube(low, high, wide, narrow, sides)
    boughs = max(int(26 * parts.detail), 2)
    for bough in range(boughs):
        share = bough / boughs
        level = 2.4 + (len(stem) - 3.5) * share
        low = stem[int(level)] + (level % 1) * (stem[int(level) + 1] - stem[int(level)])
        angle = 2.4 * bough + rng.uniform(-0.4, 0.4)
        reach = 2.2 * (1 - 0.6 * share) * rng.uniform(0.75, 1.1)
        high = low + reach * np.array([math.cos(angle), math.sin(angle), 0.3 + 0.4 * share])
        plant.tube(low, high, 0.045, 0.012)
        # Twigs on both sides of a bough bear the leaves.
        for twig in range(max(int(7 * parts.detail), 1)):
            root = low + (high - low) * (0.3 + 0.1 * twig)
            turn = angle + (1.0 if twig % 2 else -1.0) + rng.uniform(-0.3, 0.3)
            tip = root + 0.75 * np.array([math.cos(turn), math.sin(turn), rng.uniform(-0.25, 0.3)])
            plant.tube(root, tip, 0.01, 0.003, 4)
            _leafy(plant, rng, root, tip, max(int(9 * parts.detail), 1), (0.16, 0.26))
    return plant.mesh("Tree", wood, leaves)


def _leafy(plant: Plant, rng: Any, low: F64, high: F64, count: int, sizes: tuple[float, float]) -> None:
    """Put leaves on both sides of a twig."""
    angle = math.atan2(*(high - low)[1::-1])
    for step in range(count):
        root = low + (high - low) * (0.2 + 0.8 * step / count)
        turn = angle + (0.9 if step % 2 else -0.9) + rng.uniform(-0.4, 0.4)
        along = np.array([math.cos(turn), math.sin(turn), rng.uniform(-0.45, 0.2)])
        plant.blade(root, along, rng.uniform(*sizes))


def fern(stalk: Any, leaves: Any, rng: Any) -> Any:
    """A rosette of fronds that arch to the floor, 0.6 units high."""
    plant = Plant()
    fronds = max(int(11 * parts.detail), 2)
    for frond in range(fronds):
        angle = math.tau * frond / fronds + rng.uniform(-0.2, 0.2)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        reach = rng.uniform(0.55, 0.85)
        steps = max(int(16 * parts.detail), 2)
        arch = [
            out * reach * t + np.array([0, 0, reach * (1.55 * t - 1.35 * t * t)])
            for t in np.linspace(0.0, 1.0, steps + 1)
        ]
        for step in range(steps):
            low, high = arch[step], arch[step + 1]
            plant.tube(low, high, 0.006, 0.005, 3)
            size = 0.26 * reach * math.sin(math.pi * (0.08 + 0.92 * (step + 0.5) / steps)) ** 0.7
            across = np.array([-out[1], out[0], 0.0])
            for sign in (-1, 1):
                plant.blade(high, sign * across + 0.5 * (high - low) / np.linalg.norm(high - low), size, 0.13)
    return plant.mesh("Fern", stalk, leaves)


def plant_all(scene: Any, name: str, meshes: list[Any], places: list[tuple[float, float, float]], rng: Any) -> None:
    """Place instances of the meshes in turn. places: x, y and scale of each; the first ones at low detail."""
    for number, (x, y, scale) in enumerate(places[: max(round(len(places) * parts.detail), 2)]):
        item = bpy.data.objects.new(name, meshes[number % len(meshes)])
        item.location, item.rotation_euler = (x, y, 0), (0, 0, rng.uniform(0, math.tau))
        item.scale = (scale, scale, scale * rng.uniform(0.9, 1.15))
        scene.collection.objects.link(item)

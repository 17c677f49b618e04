# SPDX-License-Identifier: GPL-3.0-or-later
"""A head with lids, ears, brows and hair, for the portrait of `composed`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.base.arrays import F64
from . import proving_parts as parts
from .proving_parts import Color

OUTLINE = np.array(
    (
        (-1.03, 0.03, -0.56, -0.44),
        (-0.98, 0.2, -0.75, -0.26),
        (-0.86, 0.33, -0.82, 0.0),
        (-0.7, 0.455, -0.81, 0.28),
        (-0.5, 0.545, -0.82, 0.6),
        (-0.3, 0.6, -0.83, 0.8),
        (-0.1, 0.64, -0.83, 0.9),
        (0.1, 0.67, -0.845, 0.95),
        (0.3, 0.7, -0.875, 0.97),
        (0.5, 0.7, -0.87, 0.95),
        (0.7, 0.62, -0.77, 0.85),
        (0.9, 0.42, -0.51, 0.58),
        (1.05, 0.03, -0.05, 0.03),
    )
)
"""Height, half width, front and back of level sections of the skull, from the chin to the crown."""

NOSE = np.array(((-0.44, 0.0), (-0.385, 0.05), (-0.34, 0.2), (-0.28, 0.265), (-0.1, 0.15), (0.1, 0.06), (0.22, 0.0)))
"""Height, and how far the nose stands out there."""

FEATURES: tuple[tuple[float, float, float, float, float], ...] = (
    (0.265, 0.06, 0.15, 0.1, -0.13),  # sockets
    (0.3, 0.235, 0.2, 0.06, 0.045),  # brows
    (0.0, 0.22, 0.1, 0.1, 0.025),
    (0.085, -0.335, 0.05, 0.05, 0.085),  # nostrils
    (0.43, -0.14, 0.18, 0.17, 0.045),  # cheeks
    (0.06, -0.505, 0.1, 0.035, 0.06),  # lips
    (0.0, -0.62, 0.13, 0.042, 0.07),
    (0.0, -0.56, 0.19, 0.014, -0.05),  # mouth
    (0.21, -0.555, 0.05, 0.05, -0.025),
    (0.0, -0.715, 0.16, 0.04, -0.03),
    (0.0, -0.87, 0.15, 0.11, 0.06),  # chin
)
"""Bumps of the face, on both sides alike: place to the side, height, both widths, and how far they stand out."""

EYE: Color = (0.265, -0.69, 0.06)
"""The place of the left eye; its radius is EYEBALL."""

EYEBALL = 0.118

SHELL: Color = (0.735, 0.99, 1.08)
"""Half axes of the ellipsoid outside of which the hair falls."""


def _smooth(heights: F64, table: F64) -> F64:
    """The columns of a table of knots at these heights, with rounded corners; (heights, columns)."""
    offsets = np.linspace(-0.09, 0.09, 13)
    weights = np.exp(-((offsets / 0.05) ** 2))
    found = [
        sum(w * np.interp(heights + d, table[:, 0], column) for d, w in zip(offsets, weights, strict=True))
        for column in table[:, 1:].T
    ]
    smooth: F64 = np.stack(found, axis=1) / weights.sum()
    return smooth


def _face(x: F64, z: F64) -> F64:
    """How far the face stands out at places in front of it."""
    out: F64 = np.interp(z, NOSE[:, 0], NOSE[:, 1]) * np.exp(-((x / np.interp(z, [-0.35, 0.15], [0.095, 0.06])) ** 2))
    for side, height, wide, tall, by in FEATURES:
        for sign in (-1, 1) if side else (1,):
            out += by * np.exp(-(((x - sign * side) / wide) ** 2) - ((z - height) / tall) ** 2)
    return out


def head(scene: Any, skin: Any) -> Any:
    """A head that looks along -y, with ears and lids, whose colours are in the attribute *Flush*."""
    item = parts.sphere(scene, (0, 0, 0), 1.0, rings=150)
    item.name = "Head"
    points = np.empty(len(item.data.vertices) * 3, np.float32)
    item.data.vertices.foreach_get("co", points)
    x, y, z = points.reshape(-1, 3).astype(np.float64).T
    # Put each vertex on the section of its height.
    height = np.where(z < 0, 1.03, 1.05) * z
    wide, front, back = _smooth(height, OUTLINE).T
    across = np.hypot(x, y)
    sine, cosine = x / np.maximum(across, 1e-9), -y / np.maximum(across, 1e-9)
    shape = np.stack([wide * sine, (front + back) / 2 - (back - front) / 2 * cosine, height], axis=1)
    # Let the features stand out in front, less towards the sides.
    before = np.clip((cosine - 0.15) / 0.5, 0, 1)
    shape[:, 1] -= _face(shape[:, 0], height) * before**2 * (3 - 2 * before)
    item.data.vertices.foreach_set("co", np.ascontiguousarray(shape, np.float32).reshape(-1))
    item.data.update()
    _flush(item.data, shape)
    parts.wear(item, skin)
    for sign in (-1, 1):
        _ear(scene, skin, sign)
        for upper in (True, False):
            _lid(scene, skin, sign, upper)
    return item


def _flush(mesh: Any, shape: F64) -> None:
    """Add the attribute *Flush*: how red the skin is, 1 at the lips."""
    x, _, z = shape.T
    lips = np.exp(-((x / 0.2) ** 4) - ((z + 0.565) / 0.085) ** 4) * (shape[:, 1] < -0.6)
    cheeks = np.exp(-(((np.abs(x) - 0.42) / 0.2) ** 2) - ((z + 0.22) / 0.18) ** 2) * (shape[:, 1] < 0)
    nose = np.exp(-((x / 0.12) ** 2) - ((z + 0.32) / 0.1) ** 2) * (shape[:, 1] < -0.6)
    attribute = mesh.attributes.new("Flush", "FLOAT", "POINT")
    flush = np.clip(np.maximum(lips, 0.3 * cheeks + 0.25 * nose), 0, 1)
    attribute.data.foreach_set("value", flush.astype(np.float32))


def skin() -> Any:
    """Skin below which light scatters, redder by the attribute *Flush*, with pores."""
    material = parts.principled(
        "Skin", (0.78, 0.5, 0.38), Roughness=0.42, Subsurface_Weight=0.85, Subsurface_Scale=0.07, Coat_Weight=0.1
    )
    tree, shader = material.node_tree, parts.principled_node(material)
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.35, 0.18)
    shader.inputs["Coat Roughness"].default_value = 0.3
    flush, mix, where, noise, bump = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "MixRGB", "TexCoord", "TexNoise", "Bump")
    )
    flush.attribute_name = "Flush"
    mix.inputs[1].default_value, mix.inputs[2].default_value = (0.78, 0.5, 0.38, 1), (0.62, 0.2, 0.17, 1)
    noise.inputs["Scale"].default_value = 28.0
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.12, 0.03
    tree.links.new(flush.outputs["Fac"], mix.inputs[0])
    tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
    tree.links.new(where.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    return material


def _ear(scene: Any, skin: Any, sign: int) -> None:
    """An ear with a hollow."""
    ear = parts.sphere(scene, (0.655 * sign, 0.1, -0.03), 1.0, rings=36)
    ear.name = "Ear"
    points = np.empty(len(ear.data.vertices) * 3, np.float32)
    ear.data.vertices.foreach_get("co", points)
    unit = points.reshape(-1, 3).astype(np.float64)
    y, z = unit[:, 1], unit[:, 2]
    hollow = np.exp(-((y / 0.45) ** 2) - ((z - 0.1) / 0.55) ** 2) * (sign * unit[:, 0] > 0)
    shape = np.stack([0.075 * unit[:, 0] - 0.1 * sign * hollow, (0.13 + 0.03 * z) * y, 0.24 * z], axis=1)
    ear.data.vertices.foreach_set("co", np.ascontiguousarray(shape, np.float32).reshape(-1))
    ear.data.update()
    ear.rotation_euler = (0.15, 0, -0.45 * sign)
    parts.wear(ear, skin)


def _lid(scene: Any, skin: Any, sign: int, upper: bool) -> None:
    """An eyelid: a closed shell around a part of the eyeball, whose edge is an arc from corner to corner."""
    across, along = (max(int(n * parts.detail), 3) for n in (32, 16))
    side = np.linspace(-1.45, 1.45, across + 1)
    edge = np.cos(side) * (0.26 if upper else -0.25) - 0.02
    end = 1.5 if upper else -1.5
    points: list[tuple[float, ...]] = []
    for radius in (EYEBALL + 0.024, EYEBALL + 0.003):
        for turn, first in zip(side, edge, strict=True):
            for step in range(along + 1):
                tilt = first + (end - first) * step / along
                level = radius * math.cos(turn)
                points.append(
                    (
                        sign * EYE[0] + radius * math.sin(turn),
                        EYE[1] - level * math.cos(tilt),
                        EYE[2] + level * math.sin(tilt),
                    )
                )
    row, layer = along + 1, (across + 1) * (along + 1)
    faces: list[Sequence[int]] = []
    for i in range(across):
        for j in range(along):
            c = i * row + j
            faces.append((c, c + row, c + row + 1, c + 1))
            faces.append((layer + c, layer + c + 1, layer + c + row + 1, layer + c + row))
        c, d = i * row, i * row + along
        faces += [(c, layer + c, layer + c + row, c + row), (d, d + row, layer + d + row, layer + d)]
    for j in range(along):
        c, d = j, across * row + j
        faces += [(c, c + 1, layer + c + 1, layer + c), (d, layer + d, layer + d + 1, d + 1)]
    lid = parts.polygons(scene, "Lid", points, [face if upper else face[::-1] for face in faces], smooth=True)
    parts.wear(lid, skin)


def eyes(scene: Any) -> None:
    """Two wet eyes that look into the camera."""
    material = _iris()
    for sign in (-1, 1):
        eye = parts.sphere(scene, (sign * EYE[0], EYE[1], EYE[2]), EYEBALL, rings=32)
        eye.rotation_euler = (math.pi / 2 - 0.02, 0, -0.24)
        parts.wear(eye, material)


def _iris() -> Any:
    """White with an iris and a pupil around the pole of the sphere, below a wet coat."""
    material = parts.principled("Eye", (0.9, 0.88, 0.85), Roughness=0.3, Coat_Weight=1, Coat_Roughness=0.0)
    tree, shader = material.node_tree, parts.principled_node(material)
    where, split, ramp = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "ValToRGB"))
    tree.links.new(where.outputs["Generated"], split.inputs[0])
    tree.links.new(split.outputs["Z"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    stops = ramp.color_ramp.elements
    stops[0].position, stops[0].color = 0.9, (0.8, 0.76, 0.73, 1)
    stops[1].position, stops[1].color = 0.982, (0.01, 0.01, 0.01, 1)
    for position, color in ((0.91, (0.05, 0.09, 0.1, 1)), (0.94, (0.12, 0.22, 0.22, 1)), (0.972, (0.22, 0.3, 0.22, 1))):
        stops.new(position).color = color
    return material


def hair(scene: Any, head_item: Any, count: int) -> None:
    """Combed strands on the scalp that fall to both sides of a parting, and brows."""
    rng = np.random.default_rng(8)
    mesh = head_item.data
    points = np.empty((len(mesh.vertices), 3), np.float32)
    normals = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    mesh.vertices.foreach_get("normal", normals.ravel())
    # The scalp lies above a line from the forehead past the ears to the neck.
    line = np.interp(points[:, 1], [-0.8, -0.45, -0.15, 0.2, 0.5, 0.9], [0.66, 0.6, 0.25, 0.12, -0.5, -0.62])
    scalp = np.flatnonzero(points[:, 2] > line)
    # Choose roots by area: the vertices of a sphere crowd at its poles.
    area = np.maximum(1 - (points[scalp, 2] / 1.06) ** 2, 0) ** 0.5
    roots = rng.choice(scalp, size=count, p=area / area.sum())
    at = points[roots] + rng.normal(0, 0.012, (count, 3))
    # Locks share a direction; from the parting the hair goes to the sides and backwards.
    lock = rng.integers(60, size=count) + 60 * (np.round(at[:, 0] * 5) + 9).astype(int)
    shared = np.random.default_rng(3).normal(0, 1, (60 * 20, 3))[lock]
    side = np.tanh((at[:, 0] + 0.22) * 6)
    direction = normals[roots] * 0.22 + np.stack([0.6 * side, np.full(count, 0.2), np.zeros(count)], axis=1)
    direction += 0.06 * shared + rng.normal(0, 0.025, (count, 3))
    strands = 9 if parts.detail >= 0.5 else 4
    length = 1.0 * rng.uniform(0.8, 1.12, count) * (1 + 0.1 * shared[:, 2])
    placed = np.empty((count, strands, 3), np.float32)
    for step in range(strands):
        placed[:, step] = at
        # Hair falls, curls inwards at the tips, and stays outside of the head.
        inwards = -np.sign(at[:, 0]) * 0.16 * (step > 0.6 * strands)
        direction += np.stack([inwards, np.full(count, 0.02), np.full(count, -0.5)], axis=1)
        direction += 0.03 * shared
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        at = at + direction * (length / (strands - 1))[:, None]
        inside = np.linalg.norm(at / np.array(SHELL), axis=1, keepdims=True)
        layer = 1.0 + 0.05 * rng.random((count, 1))
        at = np.where((inside < layer) & (at[:, 2:] > -0.45), at / np.maximum(inside, 1e-3) * layer, at)
    parts.strands(scene, "Hair", placed, 0.0065, 0.0015, _keratin(0.72, 0.45))
    _brows(scene, rng, max(count // 40, 2))


def _brows(scene: Any, rng: Any, count: int) -> None:
    """Short hair above the eyes."""
    placed = np.empty((2 * count, 3, 3), np.float32)
    for number, sign in enumerate((-1, 1)):
        t = rng.random(count)
        x = 0.11 + 0.33 * t
        z = 0.255 + 0.05 * np.sin(2.4 * t) + rng.normal(0, 0.014, count)
        front = _smooth(z, OUTLINE)[:, 1]
        wide = _smooth(z, OUTLINE)[:, 0]
        back = _smooth(z, OUTLINE)[:, 2]
        y = (front + back) / 2 - (back - front) / 2 * np.sqrt(np.maximum(1 - (x / wide) ** 2, 0)) - _face(x, z) + 0.004
        root = np.stack([sign * x, y, z], axis=1)
        for step in range(3):
            bent = np.stack([sign * (0.55 + t), -0.35 + 0.5 * t, 0.5 - 0.9 * t], axis=1)
            placed[number * count : (number + 1) * count, step] = root + 0.045 * step * bent
    parts.strands(scene, "Brows", placed, 0.006, 0.002, _keratin(0.8, 0.4))


def _keratin(melanin: float, redness: float) -> Any:
    """Hair of this melanin."""
    material = parts.one_shader("Hair", "BsdfHairPrincipled")
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfHairPrincipled")
    shader.parametrization = "MELANIN"
    shader.inputs["Melanin"].default_value, shader.inputs["Melanin Redness"].default_value = melanin, redness
    return material

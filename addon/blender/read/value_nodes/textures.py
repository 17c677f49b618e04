# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the procedural texture nodes of shader trees, see `value_nodes`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..nodes import Place
    from ..values import Values

DIMENSIONS = {"1D": 1, "2D": 2, "3D": 3, "4D": 4}


def _position(values: Values, node: Place, dimensions: str) -> tuple[Operand, Operand]:
    """The Vector and W inputs of a texture; 0 where its dimensions do not use one."""
    vector = 0.0 if dimensions == "1D" else values.vector(node, "generated")
    w = values.input(node, "W") if dimensions in ("1D", "4D") else 0.0
    return vector, w


def _inputs(values: Values, node: Place, names: dict[str, float]) -> list[Operand]:
    """These inputs; where this version of Blender, or this kind of texture, has none, the given value."""
    return [values.input(node, name, absent) for name, absent in names.items()]


def _checker(values: Values, node: Place) -> Operand:
    args = [values.vector(node, "generated"), *(values.input(node, name) for name in ("Color1", "Color2", "Scale"))]
    return values.step("checker", *args, color=node.socket.name == "Color")


def _gradient(values: Values, node: Place) -> Operand:
    return values.step("gradient", values.vector(node, "generated"), kind=node.node.gradient_type)


def _noise(values: Values, node: Place) -> Operand:
    item = node.node
    names = {
        "Scale": 5.0,
        "Detail": 2.0,
        "Roughness": 0.5,
        "Lacunarity": 2.0,
        "Offset": 0.0,
        "Gain": 1.0,
        "Distortion": 0.0,
    }
    return values.step(
        "noise",
        *_position(values, node, item.noise_dimensions),
        *_inputs(values, node, names),
        kind=item.noise_type,
        dimensions=DIMENSIONS[item.noise_dimensions],
        color=node.socket.name == "Color",
        normalize=item.normalize,
    )


def _white_noise(values: Values, node: Place) -> Operand:
    item = node.node
    return values.step(
        "white_noise",
        *_position(values, node, item.noise_dimensions),
        dimensions=DIMENSIONS[item.noise_dimensions],
        color=node.socket.name == "Color",
    )


def _voronoi(values: Values, node: Place) -> Operand:
    item = node.node
    names = {
        "Scale": 5.0,
        "Detail": 0.0,
        "Roughness": 0.5,
        "Lacunarity": 2.0,
        "Smoothness": 1.0,
        "Exponent": 0.5,
        "Randomness": 1.0,
    }
    return values.step(
        "voronoi",
        *_position(values, node, item.voronoi_dimensions),
        *_inputs(values, node, names),
        dimensions=DIMENSIONS[item.voronoi_dimensions],
        feature=item.feature,
        metric=item.distance,
        normalize=item.normalize,
        output=node.socket.name,
        earlier=bpy.app.version < (5, 0),  # whose cells have other points
    )


def _gabor(values: Values, node: Place) -> Operand:
    solid = node.node.gabor_type == "3D"
    names = {"Scale": 5.0, "Frequency": 2.0, "Anisotropy": 1.0}
    # Two inputs have the name Orientation: an angle and a direction.
    orientation = next(item for item in node.node.inputs if item.identifier == f"Orientation {'3D' if solid else '2D'}")
    return values.step(
        "gabor",
        values.vector(node, "generated"),
        *_inputs(values, node, names),
        values.value(node.beside(orientation)),
        dimensions=3 if solid else 2,
        output=node.socket.name,
    )


def _wave(values: Values, node: Place) -> Operand:
    item = node.node
    direction = item.bands_direction if item.wave_type == "BANDS" else item.rings_direction
    names = {
        "Scale": 5.0,
        "Distortion": 0.0,
        "Detail": 2.0,
        "Detail Scale": 1.0,
        "Detail Roughness": 0.5,
        "Phase Offset": 0.0,
    }
    return values.step(
        "wave",
        values.vector(node, "generated"),
        *_inputs(values, node, names),
        kind=f"{item.wave_type} {direction}",
        profile=item.wave_profile,
    )


def _magic(values: Values, node: Place) -> Operand:
    names = {"Scale": 5.0, "Distortion": 1.0}
    color = values.step(
        "magic",
        values.vector(node, "generated"),
        *_inputs(values, node, names),
        depth=node.node.turbulence_depth,
    )
    return color if node.socket.name == "Color" else values.step("mean", color)


def _brick(values: Values, node: Place) -> Operand:
    item = node.node
    names = {
        "Color1": 0.8,
        "Color2": 0.2,
        "Mortar": 0.0,
        "Scale": 5.0,
        "Mortar Size": 0.02,
        "Mortar Smooth": 0.1,
        "Bias": 0.0,
        "Brick Width": 0.5,
        "Row Height": 0.25,
    }
    return values.step(
        "brick",
        values.vector(node, "generated"),
        *_inputs(values, node, names),
        offset=float(item.offset),
        offset_frequency=item.offset_frequency,
        squash=float(item.squash),
        squash_frequency=item.squash_frequency,
        color=node.socket.name == "Color",
    )


def _radial_tiling(values: Values, node: Place) -> Operand:
    inputs = (values.input(node, name) for name in ("Vector", "Sides", "Roundness"))
    return values.step("radial_tiling", *inputs, output=node.socket.name, normalize=node.node.normalize)


TEXTURES: dict[str, Callable[[Values, Place], Any]] = {
    "ShaderNodeRadialTiling": _radial_tiling,
    "ShaderNodeTexBrick": _brick,
    "ShaderNodeTexChecker": _checker,
    "ShaderNodeTexGabor": _gabor,
    "ShaderNodeTexGradient": _gradient,
    "ShaderNodeTexMagic": _magic,
    "ShaderNodeTexNoise": _noise,
    "ShaderNodeTexVoronoi": _voronoi,
    "ShaderNodeTexWave": _wave,
    "ShaderNodeTexWhiteNoise": _white_noise,
}
"""Procedural textures by the type of their node, in the form of `value_nodes.NODES`."""

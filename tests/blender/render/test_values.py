# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes of numbers, vectors, colours, patterns and textures compared with Cycles, tile by tile."""

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import bpy
import numpy as np
import pytest

from tests.blender import atlas
from tests.blender.atlas import add, made, number, place, placed, shown

Makers = Iterator[tuple[str, atlas.Maker]]

OLD = bpy.app.version < (5, 0)
FACTOR = "Fac" if OLD else "Factor"
"""Blender 4.5 calls some factors Fac."""

DIMENSIONS = ("1D", "2D", "3D", "4D")


def coordinate(channel: int = 0, where: atlas.Maker = placed(2.0)) -> atlas.Maker:  # noqa: B008
    """A number that runs through about -2 to 2 over a tile."""
    return made("SeparateXYZ", where, output=channel)


TINT = made("VectorMath", placed(1.0), operation="FRACTION")
"""A colour whose channels run through 0 to 1."""


def choices(kind: str, name: str) -> list[str]:
    """The values of a choice of a node."""
    return [item.identifier for item in getattr(bpy.types, f"ShaderNode{kind}").bl_rna.properties[name].enum_items]


def math_nodes() -> Makers:
    for operation, clamp in product(choices("Math", "operation"), (False, True)):
        value = made("Math", coordinate(0), coordinate(1), 0.7, operation=operation, use_clamp=clamp)
        # Values beyond 0..1 are visible, too, and those of tangents and exponents are bounded.
        bounded = made("Clamp", value, Min=-2.0, Max=2.0)
        yield f"{operation} {clamp}", made("Math", bounded, 0.2, 0.5, operation="MULTIPLY_ADD")


def blends() -> Makers:
    color = (0.7, 0.3, 0.5, 1.0)
    for kind in choices("MixRGB", "blend_type"):
        yield f"legacy {kind}", made("MixRGB", 0.8, TINT, color, blend_type=kind)
        inputs = (0.8, *[None] * 5, TINT, color)
        yield kind, made("Mix", *inputs, data_type="RGBA", blend_type=kind, output=2)


def plain_colors() -> Makers:
    yield "invert", made("Invert", Color=TINT, **{FACTOR: 0.7})
    yield "gamma", made("Gamma", Color=TINT, Gamma=2.2)
    yield "contrast", made("BrightContrast", Color=TINT, Contrast=0.4, **{"Bright" if OLD else "Brightness": 0.1})
    yield "hue", made("HueSaturation", Color=TINT, Hue=0.7, Saturation=1.4, Value=0.8)
    yield "luminance", made("RGBToBW", TINT)
    for mode in ("EASE", "LINEAR", "B_SPLINE", "CONSTANT"):

        def ramp(tree: Any, mode: str = mode) -> Any:
            node = add(tree, "ValToRGB", coordinate())
            node.color_ramp.interpolation = mode
            node.color_ramp.elements.new(0.4).color = (0.9, 0.2, 0.4, 1.0)
            return node.outputs[0]

        yield f"ramp {mode}", ramp
    yield "colour", made("RGB")
    yield "number", number(0.3)


def plain_patterns() -> Makers:
    for output in ("Color", FACTOR):
        checker = made("TexChecker", placed(1.0), Scale=2.0, Color1=(0.8, 0.3, 0.1, 1), output=output)
        yield f"checker {output}", checker
    for kind in choices("TexGradient", "gradient_type"):
        yield kind, made("TexGradient", placed(1.0), gradient_type=kind)
    for kind, number_of in (("LayerWeight", 0), ("LayerWeight", 1), ("Fresnel", 0)):
        yield f"{kind} {number_of}", made(kind, output=number_of)
    for bounds in ("MINMAX", "RANGE"):
        yield f"clamp {bounds}", made("Clamp", coordinate(), clamp_type=bounds, Min=0.8, Max=0.2)
    yield "combine", made("CombineXYZ", coordinate(), 0.3)


@pytest.mark.parametrize("family", [math_nodes, blends, plain_colors, plain_patterns])
def test_plain_nodes_are_those_of_cycles(scene: Any, family: Any) -> None:
    makers = dict(family())
    atlas.flat(scene, makers)
    atlas.assert_alike(scene, makers)


def textured(kind: str, output: str, **settings: Any) -> atlas.Maker:
    """A texture at turned object coordinates; its W input is the first of them."""

    def make(tree: Any) -> Any:
        texture, where = add(tree, f"Tex{kind}", **settings), place(tree)
        if "Vector" in texture.inputs:
            tree.links.new(where, texture.inputs["Vector"])
        if "W" in texture.inputs:
            tree.links.new(coordinate(0, lambda _: where)(tree), texture.inputs["W"])
        return texture.outputs[output]

    return make


def noises() -> Makers:
    for dimensions, output in product(DIMENSIONS, (FACTOR, "Color")):
        settings = {"noise_dimensions": dimensions, "Detail": 2.5, "Distortion": 0.4}
        yield f"{dimensions} {output}", textured("Noise", output, **settings)
    for kind in ("MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN"):
        more = {} if kind == "MULTIFRACTAL" else {"Offset": 0.4}
        more |= {"Gain": 1.7} if kind.startswith(("HYBRID", "RIDGED")) else {}
        yield kind, textured("Noise", "Color", noise_type=kind, Detail=3.3, Roughness=0.6, Lacunarity=2.2, **more)
    yield "unbounded", textured("Noise", "Color", normalize=False, Scale=2.0)


def cells() -> Makers:
    for dimensions in DIMENSIONS:
        common = {"voronoi_dimensions": dimensions, "Scale": 2.0, "Randomness": 0.8}
        outputs = ("Distance", "Color", "W" if dimensions == "1D" else "Position")
        for feature, output in product(("F1", "F2", "SMOOTH_F1"), outputs):
            yield f"{dimensions} {feature} {output}", textured("Voronoi", output, feature=feature, **common)
        yield f"{dimensions} edge", textured("Voronoi", "Distance", feature="DISTANCE_TO_EDGE", **common)
        yield f"{dimensions} radius", textured("Voronoi", "Radius", feature="N_SPHERE_RADIUS", **common)
    for metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
        yield metric, textured("Voronoi", "Distance", distance=metric, Scale=2.0)
    octaves = {"Detail": 1.6, "Roughness": 0.4, "Lacunarity": 2.3, "normalize": True, "Scale": 1.5}
    for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"):
        yield f"{feature} octaves", textured("Voronoi", "Distance", feature=feature, **octaves)


def patterns() -> Makers:
    for direction in ("X", "Y", "Z", "DIAGONAL"):
        yield f"bands {direction}", textured("Wave", "Color", bands_direction=direction, Scale=0.7)
    for direction in ("X", "Y", "Z", "SPHERICAL"):
        rings = {"wave_type": "RINGS", "rings_direction": direction, "wave_profile": "SAW"}
        yield f"rings {direction}", textured("Wave", "Color", Scale=0.7, **rings)
    yield "distorted", textured("Wave", "Color", wave_profile="TRI", Scale=0.5, Distortion=3.0, Phase_Offset=0.6)
    for depth in (0, 2, 5, 10):
        yield f"magic {depth}", textured("Magic", "Color", turbulence_depth=depth, Scale=1.0, Distortion=1.2)
    for output in ("Color", FACTOR):
        walls = {"Mortar_Size": 0.08, "Color1": (0.8, 0.3, 0.1, 1), "Color2": (0.1, 0, 1, 1)}
        yield f"bricks {output}", textured("Brick", output, Scale=1.0, **walls)
    yield "uneven bricks", textured("Brick", "Color", Scale=1.0, squash=0.6, squash_frequency=3, offset_frequency=2)


def waves_in_windows() -> Makers:
    for kind, output, spread in product(("2D", "3D"), ("Value", "Phase", "Intensity"), (1.0, 0.4)):
        common = {"gabor_type": kind, "Scale": 0.5, "Frequency": 1.5, "Anisotropy": spread}
        yield f"{kind} {output} {spread}", textured("Gabor", output, **common)


def edges() -> Makers:
    for size, pixels in ((0.2, False), (3.0, True), (0.0, False)):
        yield f"{size} {pixels}", made("Wireframe", use_pixel_size=pixels, Size=size)


def whites() -> Makers:
    squares = made("VectorMath", placed(4.0), operation="FLOOR")
    for dimensions, output in product(DIMENSIONS, ("Value", "Color")):
        inputs = {} if dimensions == "1D" else {"Vector": squares}
        inputs |= {"W": coordinate(0, squares)} if dimensions in ("1D", "4D") else {}
        white = made("TexWhiteNoise", noise_dimensions=dimensions, output=output, **inputs)
        yield f"{dimensions} {output}", white


def radials() -> Makers:
    outputs = ("Segment Coordinates", "Segment ID", "Segment Width", "Segment Rotation")
    for output, sides, roundness, unit in product(outputs, (5.0, 3.4, 2.0, 6.7), (0.0, 0.4, 1.0), (False, True)):
        if (sides == 2.0 and roundness == 0.4) or (unit and output != "Segment Coordinates"):
            continue  # Blender's polygon of two sides has no rounded corners
        settings = {"normalize": unit, "Sides": sides, "Roundness": roundness, "Vector": placed(1.0)}
        yield f"{output} {sides} {roundness} {unit}", atlas.read("RadialTiling", output, 0.2, **settings)


@pytest.mark.parametrize("family", [noises, cells, patterns, waves_in_windows, edges, whites, radials])
def test_textures_are_those_of_cycles(scene: Any, family: Any) -> None:
    if family is radials and OLD:
        pytest.skip("Blender 4.5 has no Radial Tiling")
    makers = dict(family())
    atlas.flat(scene, makers)
    atlas.assert_alike(scene, makers)


def vector_math() -> Makers:
    for operation in ("FACEFORWARD", "POWER", "SIGN", "ROUND", "WRAP", "SNAP", "REFRACT", "REFLECT"):
        # Blender 4.5 does not round vectors.
        if operation in choices("VectorMath", "operation"):
            other = (0.6, 2.0, 0.4) if operation == "POWER" else (0.6, -0.7, 0.4)
            node = made("VectorMath", placed(2.0), other, (-0.9, -0.5, 0.1), 0.7, operation=operation)
            yield operation, shown(node)


def rotations() -> Makers:
    for kind, invert in product(("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"), (False, True)):
        values = {"Center": (0.3, -0.2, 0.1)}
        values |= {"Rotation": (0.7, 0.4, 1.9)} if kind == "EULER_XYZ" else {"Angle": 0.8}
        values |= {"Axis": (1.0, 2.0, -0.5)} if kind == "AXIS_ANGLE" else {}
        turned = made("VectorRotate", placed(2.0), rotation_type=kind, invert=invert, **values)
        yield f"{kind} {invert}", shown(turned)
    yield "no axis", shown(made("VectorRotate", placed(2.0), Axis=(0.0, 0.0, 0.0), Angle=0.8))


def ranges() -> Makers:
    for kind, clamp in product(("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"), (False, True)):
        common = {"interpolation_type": kind, "clamp": clamp}

        def vectors(tree: Any, common: dict[str, Any] = common) -> Any:
            node = add(tree, "MapRange", data_type="FLOAT_VECTOR", Vector=placed(2.0), **common)
            ends = [(-0.7, 0.5, 0.2), (0.6, -0.4, 0.9), (0.1, 0.9, 0.3), (0.9, 0.2, 0.8), (3.0, 2.0, 5.0)]
            sockets = [socket for socket in node.inputs if socket.identifier.endswith("FLOAT3")]
            for socket, value in zip(sockets, ends, strict=True):
                socket.default_value = value
            return node.outputs["Vector"]

        yield f"vector {kind} {clamp}", vectors
        ends = {"From Min": -0.4, "From Max": 0.5, "To Min": 0.9, "To Max": 0.2}
        yield f"{kind} {clamp}", made("MapRange", Value=placed(2.0), **ends, **common, output="Result")


def curves() -> Makers:
    sources = (("VectorCurve", "Vector"), ("RGBCurve", "Color"), ("FloatCurve", "Value"))
    for (kind, source), extend in product(sources, ("HORIZONTAL", "EXTRAPOLATED")):

        def make(tree: Any, kind: str = kind, source: str = source, extend: str = extend) -> Any:
            node = add(tree, kind, 0.8, **{source: placed(2.0)})
            node.mapping.extend = extend
            for curve in node.mapping.curves:
                curve.points.new(0.3, 0.7)
            node.mapping.update()
            return node.outputs[0]

        yield f"{kind} {extend}", shown(make)


def colors() -> Makers:
    bounded = shown(placed(1.5), 0.3, 0.5)
    for mode in ("RGB", "HSV", "HSL"):
        for output in range(3):
            yield f"separate {mode} {output}", made("SeparateColor", bounded, mode=mode, output=output)
        yield f"combine {mode}", made("CombineColor", *(coordinate(i, bounded) for i in range(3)), mode=mode)
    for clamp in (False, True):

        def uneven(tree: Any, clamp: bool = clamp) -> Any:
            node = add(tree, "Mix", data_type="VECTOR", factor_mode="NON_UNIFORM", clamp_factor=clamp)
            sockets = {socket.identifier: socket for socket in node.inputs}
            tree.links.new(place(tree, 2.0), sockets["Factor_Vector"])
            sockets["A_Vector"].default_value, sockets["B_Vector"].default_value = (0.1, 0.9, 0.4), (0.8, 0.2, 0.6)
            return next(socket for socket in node.outputs if socket.type == "VECTOR")

        yield f"uneven mix {clamp}", shown(uneven)


def mappings() -> Makers:
    values = {"Location": (0.3, -0.2, 0.5), "Rotation": (0.4, 0.9, -0.3), "Scale": (0.7, 1.4, 2.1)}
    waves = made("VectorMath", placed(0.2), operation="SCALE")
    inputs = {name: made("VectorMath", value, waves, operation="ADD") for name, value in values.items()}
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        own = {name: value for name, value in inputs.items() if name != "Location" or kind in ("POINT", "TEXTURE")}
        yield kind, shown(made("Mapping", placed(2.0), vector_type=kind, **own), 0.2)


def drawn_normals() -> Makers:
    for output in ("Normal", "Dot"):

        def make(tree: Any, output: str = output) -> Any:
            node = add(tree, "Normal", placed(2.0))
            node.outputs[0].default_value = (0.6, -0.48, 0.64)
            return node.outputs[output]

        yield output, shown(make)


@pytest.mark.parametrize("family", [vector_math, rotations, mappings, ranges, curves, colors, drawn_normals])
def test_values_are_those_of_cycles(scene: Any, family: Any) -> None:
    makers = dict(family())
    atlas.flat(scene, makers)
    atlas.assert_alike(scene, makers)


def test_squeezed_values_are_a_logistic_curve(scene: Any) -> None:
    """Cycles leaves the node out; EEVEE computes 1 / (1 + e^-((value - centre) width))."""
    if not hasattr(bpy.types, "ShaderNodeSqueeze"):
        pytest.skip("this Blender has no such node")
    settings = [(0.3, 2.0, 0.1), (-4.0, 1.5, 0.5), (3e38, 1.0, 0.0), (-3e38, 1.0, 0.0)]
    makers = {str(one): made("Squeeze", Value=one[0], Width=one[1], Center=one[2]) for one in settings}
    atlas.flat(scene, makers)
    atlas.configure(scene, 4, 0)
    found = atlas.rendered(scene, makers, "HALFSPACE")
    for value, width, centre in settings:
        wanted = 1 / (1 + math.exp(min(max((centre - value) * width, -80.0), 80.0)))
        assert np.abs(found[str((value, width, centre))] - wanted).max() < 1e-5


def test_colours_of_light_are_those_of_cycles(scene: Any) -> None:
    kelvins = (500.0, 900.0, 1500.0, 2800.0, 4500.0, 6500.0, 9000.0, 20000.0)
    makers = {f"{kelvin} K": made("Blackbody", Temperature=kelvin) for kelvin in kelvins}
    makers |= {
        f"{nm} nm": made("Wavelength", Wavelength=nm) for nm in (300.0, 400.0, 452.0, 517.0, 560.0, 603.0, 660.0)
    }
    atlas.flat(scene, makers)
    atlas.assert_alike(scene, makers, samples=4)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Value nodes beside Cycles, tile by tile."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import atlas
import bpy
import numpy as np
import pytest
from atlas import add, place
from shapes import grid

from addon.blender.session import reports

SAMPLES = 64


def chained(kind: str, output: str | int = 0, source: str | int = 0, **settings: Any) -> atlas.Maker:
    """A node whose input `source` is turned object coordinates, most of them negative somewhere."""

    def make(tree: Any) -> Any:
        node = add(tree, kind, **settings)
        tree.links.new(place(tree, 2.0), node.inputs[source])
        return node.outputs[output]

    return make


def shown(maker: Callable[[Any], Any], factor: float = 0.5, shift: float = 0.5) -> atlas.Maker:
    """A vector or number whose negative values are visible, too."""

    def make(tree: Any) -> Any:
        node = add(tree, "VectorMath", operation="MULTIPLY_ADD")
        tree.links.new(maker(tree), node.inputs[0])
        node.inputs[1].default_value, node.inputs[2].default_value = (factor,) * 3, (shift,) * 3
        return node.outputs[0]

    return make


def vector_math() -> Iterator[tuple[str, atlas.Maker]]:
    known = bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items
    for operation in ("FACEFORWARD", "POWER", "SIGN", "ROUND", "WRAP", "SNAP", "REFRACT", "REFLECT"):
        # Blender 4.5 does not round vectors.
        if operation not in known:
            continue

        def make(tree: Any, operation: str = operation) -> Any:
            node = add(tree, "VectorMath", operation=operation)
            tree.links.new(place(tree, 2.0), node.inputs[0])
            node.inputs[1].default_value = (0.6, 2.0, 0.4) if operation == "POWER" else (0.6, -0.7, 0.4)
            node.inputs[2].default_value = (-0.9, -0.5, 0.1)
            if "Scale" in node.inputs:
                node.inputs["Scale"].default_value = 0.7
            return node.outputs[0]

        yield operation, shown(make)


def rotations() -> Iterator[tuple[str, atlas.Maker]]:
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        for invert in (False, True):
            values = {"Center": (0.3, -0.2, 0.1)}
            values |= {"Rotation": (0.7, 0.4, 1.9)} if kind == "EULER_XYZ" else {"Angle": 0.8}
            values |= {"Axis": (1.0, 2.0, -0.5)} if kind == "AXIS_ANGLE" else {}
            yield f"{kind} {invert}", shown(chained("VectorRotate", rotation_type=kind, invert=invert, **values))
    yield "no axis", shown(chained("VectorRotate", Axis=(0.0, 0.0, 0.0), Angle=0.8))


def ranges() -> Iterator[tuple[str, atlas.Maker]]:
    for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        for clamp in (False, True):
            common = {"interpolation_type": kind, "clamp": clamp}

            def vectors(tree: Any, common: dict[str, Any] = common) -> Any:
                node = add(tree, "MapRange", data_type="FLOAT_VECTOR", **common)
                tree.links.new(place(tree, 2.0), node.inputs["Vector"])
                ends = [(-0.7, 0.5, 0.2), (0.6, -0.4, 0.9), (0.1, 0.9, 0.3), (0.9, 0.2, 0.8), (3.0, 2.0, 5.0)]
                sockets = [socket for socket in node.inputs if socket.identifier.endswith("FLOAT3")]
                for socket, value in zip(sockets, ends, strict=True):
                    socket.default_value = value
                return node.outputs["Vector"]

            yield f"vector {kind} {clamp}", vectors

            def numbers(tree: Any, common: dict[str, Any] = common) -> Any:
                node = add(tree, "MapRange", **common)
                tree.links.new(place(tree, 2.0), node.inputs["Value"])
                for name, value in {"From Min": -0.4, "From Max": 0.5, "To Min": 0.9, "To Max": 0.2}.items():
                    node.inputs[name].default_value = value
                return node.outputs["Result"]

            yield f"{kind} {clamp}", numbers


def curves() -> Iterator[tuple[str, atlas.Maker]]:
    for kind, source in (("VectorCurve", "Vector"), ("RGBCurve", "Color"), ("FloatCurve", "Value")):
        for extend in ("HORIZONTAL", "EXTRAPOLATED"):

            def make(tree: Any, kind: str = kind, source: str = source, extend: str = extend) -> Any:
                node = add(tree, kind)
                mapping = node.mapping
                mapping.extend = extend
                for curve in mapping.curves:
                    curve.points.new(0.3, 0.7)
                mapping.update()
                node.inputs[0].default_value = 0.8
                tree.links.new(place(tree, 2.0), node.inputs[source])
                return node.outputs[0]

            yield f"{kind} {extend}", shown(make)


def colors() -> Iterator[tuple[str, atlas.Maker]]:
    for mode in ("RGB", "HSV", "HSL"):
        for output in range(3):

            def apart(tree: Any, mode: str = mode, output: int = output) -> Any:
                node = add(tree, "SeparateColor", mode=mode)
                tree.links.new(shown(lambda tree: place(tree, 1.5), 0.3, 0.5)(tree), node.inputs[0])
                return node.outputs[output]

            yield f"separate {mode} {output}", apart

        def together(tree: Any, mode: str = mode) -> Any:
            xyz, node = add(tree, "SeparateXYZ"), add(tree, "CombineColor", mode=mode)
            tree.links.new(shown(lambda tree: place(tree, 1.5), 0.3, 0.5)(tree), xyz.inputs[0])
            for a, b in zip(xyz.outputs, node.inputs, strict=True):
                tree.links.new(a, b)
            return node.outputs[0]

        yield f"combine {mode}", together
    for clamp in (False, True):

        def uneven(tree: Any, clamp: bool = clamp) -> Any:
            node = add(tree, "Mix", data_type="VECTOR", factor_mode="NON_UNIFORM", clamp_factor=clamp)
            sockets = {socket.identifier: socket for socket in node.inputs}
            tree.links.new(place(tree, 2.0), sockets["Factor_Vector"])
            sockets["A_Vector"].default_value, sockets["B_Vector"].default_value = (0.1, 0.9, 0.4), (0.8, 0.2, 0.6)
            return next(socket for socket in node.outputs if socket.type == "VECTOR")

        yield f"uneven mix {clamp}", shown(uneven)


def flat(scene: Any, makers: dict[str, atlas.Maker]) -> None:
    """A sheet of squares."""
    atlas.sheet(scene, makers, grid(1))
    for item in scene.objects:
        if item.type == "MESH":
            item.scale = (0.5, 0.5, 1.0)


def mappings() -> Iterator[tuple[str, atlas.Maker]]:
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):

        def make(tree: Any, kind: str = kind) -> Any:
            node, inputs = add(tree, "Mapping", vector_type=kind), {}
            values = {"Location": (0.3, -0.2, 0.5), "Rotation": (0.4, 0.9, -0.3), "Scale": (0.7, 1.4, 2.1)}
            for name, value in values.items():
                if name not in node.inputs:
                    continue
                inputs[name] = add(tree, "VectorMath", operation="ADD")
                inputs[name].inputs[0].default_value = value
                waves = add(tree, "VectorMath", operation="SCALE")
                tree.links.new(place(tree, 0.2), waves.inputs[0])
                tree.links.new(waves.outputs[0], inputs[name].inputs[1])
                tree.links.new(inputs[name].outputs[0], node.inputs[name])
            tree.links.new(place(tree, 2.0), node.inputs["Vector"])
            return node.outputs[0]

        yield kind, shown(make, 0.2)


def drawn_normals() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("Normal", "Dot"):

        def make(tree: Any, output: str = output) -> Any:
            node = add(tree, "Normal")
            node.outputs[0].default_value = (0.6, -0.48, 0.64)
            tree.links.new(place(tree, 2.0), node.inputs[0])
            return node.outputs[output]

        yield output, shown(make)


def spectra() -> Iterator[tuple[str, atlas.Maker]]:
    for kelvin in (500.0, 900.0, 1500.0, 2800.0, 4500.0, 6500.0, 9000.0, 20000.0):
        yield f"{kelvin} K", lambda tree, kelvin=kelvin: add(tree, "Blackbody", Temperature=kelvin).outputs[0]
    for nm in (300.0, 400.0, 452.0, 517.0, 560.0, 603.0, 660.0):
        yield f"{nm} nm", lambda tree, nm=nm: add(tree, "Wavelength", Wavelength=nm).outputs[0]


@pytest.mark.parametrize("family", [vector_math, rotations, mappings, ranges, curves, colors, drawn_normals])
def test_values_are_those_of_cycles(scene: Any, family: Any) -> None:
    makers = dict(family())
    flat(scene, makers)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings


def test_squeezed_values_are_a_logistic_curve(scene: Any) -> None:
    """Cycles leaves the node out; EEVEE computes 1 / (1 + e^-((value - centre) width))."""
    if not hasattr(bpy.types, "ShaderNodeSqueeze"):
        pytest.skip("this Blender has no such node")
    settings = [(0.3, 2.0, 0.1), (-4.0, 1.5, 0.5), (3e38, 1.0, 0.0), (-3e38, 1.0, 0.0)]
    makers = {
        str(values): lambda tree, values=values: add(
            tree, "Squeeze", Value=values[0], Width=values[1], Center=values[2]
        ).outputs[0]
        for values in settings
    }
    flat(scene, makers)
    atlas.configure(scene, 4, 0)
    found = atlas.rendered(scene, makers, "HALFSPACE")
    for value, width, centre in settings:
        wanted = 1 / (1 + math.exp(min(max((centre - value) * width, -80.0), 80.0)))
        assert np.abs(found[str((value, width, centre))] - wanted).max() < 1e-5


def test_colours_of_light_are_those_of_cycles(scene: Any) -> None:
    makers = dict(spectra())
    flat(scene, makers)
    ours, theirs = atlas.both(scene, makers, samples=4, bounces=0)
    assert not atlas.differences(ours, theirs, mean=0.01)

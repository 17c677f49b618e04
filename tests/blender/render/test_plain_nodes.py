# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain nodes of numbers, colours, patterns and images beside Cycles, tile by tile."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import atlas
import bpy
import numpy as np
import pytest
from atlas import add, place
from shapes import grid

from addon.blender.session import reports

SAMPLES = 64

OLD = bpy.app.version < (5, 0)
"""Blender 4.5 calls some factors Fac."""


def coordinate(tree: Any, channel: int = 0) -> Any:
    """A number that runs through about -2 to 2 over a tile."""
    apart = add(tree, "SeparateXYZ")
    tree.links.new(place(tree, 2.0), apart.inputs[0])
    return apart.outputs[channel]


def tint(tree: Any) -> Any:
    """A colour whose channels run through 0 to 1."""
    node = add(tree, "VectorMath", operation="FRACTION")
    tree.links.new(place(tree, 1.0), node.inputs[0])
    return node.outputs[0]


def math_nodes() -> Iterator[tuple[str, atlas.Maker]]:
    for item in bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items:
        for clamp in (False, True):

            def make(tree: Any, operation: str = item.identifier, clamp: bool = clamp) -> Any:
                node = add(tree, "Math", operation=operation, use_clamp=clamp)
                tree.links.new(coordinate(tree, 0), node.inputs[0])
                tree.links.new(coordinate(tree, 1), node.inputs[1])
                node.inputs[2].default_value = 0.7
                # Values beyond 0..1 are visible, too, and those of tangents and exponents are bounded.
                bounded = add(tree, "Clamp", Min=-2.0, Max=2.0)
                tree.links.new(node.outputs[0], bounded.inputs["Value"])
                scaled = add(tree, "Math", operation="MULTIPLY_ADD")
                tree.links.new(bounded.outputs[0], scaled.inputs[0])
                scaled.inputs[1].default_value, scaled.inputs[2].default_value = 0.2, 0.5
                return scaled.outputs[0]

            yield f"{item.identifier} {clamp}", make


def blends() -> Iterator[tuple[str, atlas.Maker]]:
    for item in bpy.types.ShaderNodeMixRGB.bl_rna.properties["blend_type"].enum_items:

        def old(tree: Any, kind: str = item.identifier) -> Any:
            node = add(tree, "MixRGB", blend_type=kind)
            node.inputs[0].default_value = 0.8
            tree.links.new(tint(tree), node.inputs[1])
            node.inputs[2].default_value = (0.7, 0.3, 0.5, 1.0)
            return node.outputs[0]

        def new(tree: Any, kind: str = item.identifier) -> Any:
            node = add(tree, "Mix", data_type="RGBA", blend_type=kind)
            node.inputs[0].default_value = 0.8
            tree.links.new(tint(tree), node.inputs[6])
            node.inputs[7].default_value = (0.7, 0.3, 0.5, 1.0)
            return node.outputs[2]

        yield f"legacy {item.identifier}", old
        yield item.identifier, new


def colors() -> Iterator[tuple[str, atlas.Maker]]:
    def changed(kind: str, **settings: Any) -> atlas.Maker:
        def make(tree: Any) -> Any:
            node = add(tree, kind, **settings)
            tree.links.new(tint(tree), node.inputs["Color"])
            return node.outputs[0]

        return make

    yield "invert", changed("Invert", **{"Fac" if OLD else "Factor": 0.7})
    yield "gamma", changed("Gamma", Gamma=2.2)
    yield "contrast", changed("BrightContrast", **{"Bright" if OLD else "Brightness": 0.1, "Contrast": 0.4})
    yield "hue", changed("HueSaturation", Hue=0.7, Saturation=1.4, Value=0.8)
    yield "luminance", changed("RGBToBW")
    for mode in ("EASE", "LINEAR", "B_SPLINE", "CONSTANT"):

        def ramp(tree: Any, mode: str = mode) -> Any:
            node = add(tree, "ValToRGB")
            node.color_ramp.interpolation = mode
            node.color_ramp.elements.new(0.4).color = (0.9, 0.2, 0.4, 1.0)
            tree.links.new(coordinate(tree), node.inputs[0])
            return node.outputs[0]

        yield f"ramp {mode}", ramp
    yield "colour", lambda tree: add(tree, "RGB").outputs[0]

    def number(tree: Any) -> Any:
        node = add(tree, "Value")
        node.outputs[0].default_value = 0.3
        return node.outputs[0]

    yield "number", number


def patterns() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("Color", "Fac" if OLD else "Factor"):

        def checker(tree: Any, output: str = output) -> Any:
            node = add(tree, "TexChecker", Scale=2.0, Color1=(0.8, 0.3, 0.1, 1))
            tree.links.new(place(tree, 1.0), node.inputs["Vector"])
            return node.outputs[output]

        yield f"checker {output}", checker
    for item in bpy.types.ShaderNodeTexGradient.bl_rna.properties["gradient_type"].enum_items:

        def gradient(tree: Any, kind: str = item.identifier) -> Any:
            node = add(tree, "TexGradient", gradient_type=kind)
            tree.links.new(place(tree, 1.0), node.inputs["Vector"])
            return node.outputs[0]

        yield item.identifier, gradient
    for kind, output in (("LayerWeight", 0), ("LayerWeight", 1), ("Fresnel", 0)):
        yield f"{kind} {output}", lambda tree, kind=kind, output=output: add(tree, kind).outputs[output]
    for bounds in ("MINMAX", "RANGE"):

        def clamp(tree: Any, bounds: str = bounds) -> Any:
            node = add(tree, "Clamp", clamp_type=bounds, Min=0.8, Max=0.2)
            tree.links.new(coordinate(tree), node.inputs["Value"])
            return node.outputs[0]

        yield f"clamp {bounds}", clamp

    def together(tree: Any) -> Any:
        node = add(tree, "CombineXYZ", Y=0.3)
        tree.links.new(coordinate(tree), node.inputs["X"])
        return node.outputs[0]

    yield "combine", together


def images() -> Iterator[tuple[str, atlas.Maker]]:
    image = bpy.data.images.new("Noise", 8, 8, float_buffer=True)
    pixels = np.random.default_rng(1).random((8, 8, 4), np.float32)
    pixels[..., 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.colorspace_settings.name = "Non-Color"
    for mode in ("Linear", "Closest"):
        for extension in ("REPEAT", "EXTEND", "CLIP", "MIRROR"):

            def make(tree: Any, mode: str = mode, extension: str = extension) -> Any:
                node = add(tree, "TexImage", interpolation=mode, extension=extension)
                node.image = image
                tree.links.new(place(tree, 1.0), node.inputs["Vector"])
                return node.outputs["Color"]

            yield f"{mode} {extension}", make

    def around(tree: Any) -> Any:
        node = add(tree, "TexEnvironment")
        node.image = image
        tree.links.new(place(tree, 1.0), node.inputs["Vector"])
        return node.outputs["Color"]

    yield "panorama", around


@pytest.mark.parametrize("family", [math_nodes, blends, colors, patterns, images])
def test_plain_nodes_are_those_of_cycles(scene: Any, family: Any) -> None:
    makers = dict(family())
    atlas.sheet(scene, makers, grid(1))
    for item in scene.objects:
        if item.type == "MESH":
            item.scale = (0.5, 0.5, 1.0)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings

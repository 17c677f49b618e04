# SPDX-License-Identifier: GPL-3.0-or-later
"""Procedural textures beside Cycles, tile by tile."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import atlas
import bpy
import pytest
from atlas import add, place
from shapes import grid

SAMPLES = 64


def textured(kind: str, output: str, **settings: Any) -> atlas.Maker:
    """A texture at turned object coordinates; its W input is the first of them."""

    def make(tree: Any) -> Any:
        texture = add(tree, f"Tex{kind}", **settings)
        where = place(tree)
        if "Vector" in texture.inputs:
            tree.links.new(where, texture.inputs["Vector"])
        if "W" in texture.inputs:
            apart = add(tree, "SeparateXYZ")
            tree.links.new(where, apart.inputs[0])
            tree.links.new(apart.outputs[0], texture.inputs["W"])
        return texture.outputs[output]

    return make


def noises() -> Iterator[tuple[str, atlas.Maker]]:
    for dimensions in ("1D", "2D", "3D", "4D"):
        for output in ("Fac" if bpy.app.version < (5, 0) else "Factor", "Color"):
            yield (
                f"{dimensions} {output}",
                textured("Noise", output, noise_dimensions=dimensions, Detail=2.5, Distortion=0.4),
            )
    for kind in ("MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN"):
        more = {} if kind == "MULTIFRACTAL" else {"Offset": 0.4}
        more |= {"Gain": 1.7} if kind.startswith(("HYBRID", "RIDGED")) else {}
        yield kind, textured("Noise", "Color", noise_type=kind, Detail=3.3, Roughness=0.6, Lacunarity=2.2, **more)
    yield "unbounded", textured("Noise", "Color", normalize=False, Scale=2.0)


def cells() -> Iterator[tuple[str, atlas.Maker]]:
    for dimensions in ("1D", "2D", "3D", "4D"):
        common = {"voronoi_dimensions": dimensions, "Scale": 2.0, "Randomness": 0.8}
        for feature in ("F1", "F2", "SMOOTH_F1"):
            for output in ("Distance", "Color", "W" if dimensions == "1D" else "Position"):
                yield f"{dimensions} {feature} {output}", textured("Voronoi", output, feature=feature, **common)
        yield f"{dimensions} edge", textured("Voronoi", "Distance", feature="DISTANCE_TO_EDGE", **common)
        yield f"{dimensions} radius", textured("Voronoi", "Radius", feature="N_SPHERE_RADIUS", **common)
    for metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
        yield metric, textured("Voronoi", "Distance", distance=metric, Scale=2.0)
    octaves = {"Detail": 1.6, "Roughness": 0.4, "Lacunarity": 2.3, "normalize": True, "Scale": 1.5}
    for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"):
        yield f"{feature} octaves", textured("Voronoi", "Distance", feature=feature, **octaves)


def patterns() -> Iterator[tuple[str, atlas.Maker]]:
    for direction in ("X", "Y", "Z", "DIAGONAL"):
        yield f"bands {direction}", textured("Wave", "Color", bands_direction=direction, Scale=0.7)
    for direction in ("X", "Y", "Z", "SPHERICAL"):
        yield (
            f"rings {direction}",
            textured("Wave", "Color", wave_type="RINGS", rings_direction=direction, Scale=0.7, wave_profile="SAW"),
        )
    yield "distorted", textured("Wave", "Color", wave_profile="TRI", Scale=0.5, Distortion=3.0, Phase_Offset=0.6)
    for depth in (0, 2, 5, 10):
        yield f"magic {depth}", textured("Magic", "Color", turbulence_depth=depth, Scale=1.0, Distortion=1.2)
    for output in ("Color", "Fac" if bpy.app.version < (5, 0) else "Factor"):
        yield (
            f"bricks {output}",
            textured("Brick", output, Scale=1.0, Mortar_Size=0.08, Color1=(0.8, 0.3, 0.1, 1), Color2=(0.1, 0, 1, 1)),
        )
    yield "uneven bricks", textured("Brick", "Color", Scale=1.0, squash=0.6, squash_frequency=3, offset_frequency=2)


def waves_in_windows() -> Iterator[tuple[str, atlas.Maker]]:
    for kind in ("2D", "3D"):
        for output in ("Value", "Phase", "Intensity"):
            for spread in (1.0, 0.4):
                common = {"gabor_type": kind, "Scale": 0.5, "Frequency": 1.5, "Anisotropy": spread}
                yield f"{kind} {output} {spread}", textured("Gabor", output, **common)


def edges() -> Iterator[tuple[str, atlas.Maker]]:
    for size, pixels in ((0.2, False), (3.0, True), (0.0, False)):

        def make(tree: Any, size: float = size, pixels: bool = pixels) -> Any:
            return add(tree, "Wireframe", use_pixel_size=pixels, Size=size).outputs[0]

        yield f"{size} {pixels}", make


def whites() -> Iterator[tuple[str, atlas.Maker]]:
    def squares(dimensions: str, output: str) -> atlas.Maker:
        def make(tree: Any) -> Any:
            texture = add(tree, "TexWhiteNoise", noise_dimensions=dimensions)
            whole = add(tree, "VectorMath", operation="FLOOR")
            tree.links.new(place(tree, 4.0), whole.inputs[0])
            if "Vector" in texture.inputs and dimensions != "1D":
                tree.links.new(whole.outputs[0], texture.inputs["Vector"])
            if dimensions in ("1D", "4D"):
                apart = add(tree, "SeparateXYZ")
                tree.links.new(whole.outputs[0], apart.inputs[0])
                tree.links.new(apart.outputs[0], texture.inputs["W"])
            return texture.outputs[output]

        return make

    for dimensions in ("1D", "2D", "3D", "4D"):
        for output in ("Value", "Color"):
            yield f"{dimensions} {output}", squares(dimensions, output)


def radials() -> Iterator[tuple[str, atlas.Maker]]:
    for output in ("Segment Coordinates", "Segment ID", "Segment Width", "Segment Rotation"):
        for sides in (5.0, 3.4, 2.0, 6.7):
            for roundness in (0.0, 0.4, 1.0):
                for normalize in (False, True):
                    if (sides == 2.0 and roundness == 0.4) or (normalize and output != "Segment Coordinates"):
                        continue  # Blender's polygon of two sides has no rounded corners

                    def make(
                        tree: Any,
                        output: str = output,
                        settings: tuple[float, float] = (sides, roundness),
                        normalize: bool = normalize,
                    ) -> Any:
                        tiling = add(tree, "RadialTiling", normalize=normalize)
                        tiling.inputs["Sides"].default_value, tiling.inputs["Roundness"].default_value = settings
                        tree.links.new(place(tree, 1.0), tiling.inputs["Vector"])
                        shown = add(tree, "VectorMath", operation="MULTIPLY_ADD")
                        tree.links.new(tiling.outputs[output], shown.inputs[0])
                        shown.inputs[1].default_value, shown.inputs[2].default_value = (0.2,) * 3, (0.5,) * 3
                        return shown.outputs[0]

                    yield f"{output} {sides} {roundness} {normalize}", make


@pytest.mark.parametrize("family", [noises, cells, patterns, waves_in_windows, edges, whites, radials])
def test_textures_are_those_of_cycles(scene: Any, family: Any) -> None:
    if family is radials and bpy.app.version < (5, 0):
        pytest.skip("Blender 4.5 has no Radial Tiling")
    makers = dict(family())
    atlas.sheet(scene, makers, grid(1))
    for item in scene.objects:
        if item.type == "MESH":
            item.scale = (0.5, 0.5, 1.0)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)

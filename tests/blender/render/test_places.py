# SPDX-License-Identifier: GPL-3.0-or-later
"""Value nodes that read object, camera and path, beside Cycles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import atlas
import bpy
import pytest
from atlas import add
from shapes import ball, grid

from addon.blender.session import reports

SAMPLES = 64


def shown(tree: Any, output: Any, factor: float = 0.5, shift: float = 0.5) -> Any:
    """A vector or number whose negative values are visible, too."""
    node = add(tree, "VectorMath", operation="MULTIPLY_ADD")
    tree.links.new(output, node.inputs[0])
    node.inputs[1].default_value, node.inputs[2].default_value = (factor,) * 3, (shift,) * 3
    return node.outputs[0]


def read(kind: str, output: str, factor: float = 0.5, shift: float = 0.5, **settings: Any) -> atlas.Maker:
    return lambda tree: shown(tree, add(tree, kind, **settings).outputs[output], factor, shift)


def places() -> Iterator[tuple[str, atlas.Maker]]:
    yield "location", read("ObjectInfo", "Location", 0.1)
    for output in ("Color", "Alpha", "Random"):
        yield output, read("ObjectInfo", output)
    for output in ("Object Index", "Material Index"):
        yield output, read("ObjectInfo", output, 0.05)
    yield "view vector", read("CameraData", "View Vector")
    yield "view depth", read("CameraData", "View Z Depth", 0.05, 0.0)
    yield "view distance", read("CameraData", "View Distance", 0.05, 0.0)
    yield "camera", read("TexCoord", "Camera", 0.1)
    yield "window", read("TexCoord", "Window")
    yield "tangent", read("NewGeometry", "Tangent")
    yield "parametric", read("NewGeometry", "Parametric")
    for kind in ("OBJECT", "INSTANCER"):
        for output in ("Color", "Vector", "Alpha"):
            yield f"{kind} {output}", read("Attribute", output, attribute_type=kind, attribute_name="tint")
    yield "own property", read("Attribute", "Vector", attribute_type="OBJECT", attribute_name="location", factor=0.1)
    yield "no property", read("Attribute", "Vector", attribute_type="OBJECT", attribute_name="nothing")
    yield "view layer", read("Attribute", "Color", attribute_type="VIEW_LAYER", attribute_name="mood")
    for kind in ("POINT", "VECTOR", "NORMAL"):
        for there, back in (("WORLD", "OBJECT"), ("OBJECT", "WORLD"), ("WORLD", "CAMERA"), ("CAMERA", "OBJECT")):
            yield (
                f"{kind} {there} {back}",
                read(
                    "VectorTransform",
                    "Vector",
                    0.1,
                    vector_type=kind,
                    convert_from=there,
                    convert_to=back,
                    Vector=(0.6, 0.3, -0.8),
                ),
            )


def another(scene: Any) -> Callable[[Any], Any]:
    """Coordinates of another object."""
    item = bpy.data.objects.new("Other", None)
    item.location, item.rotation_euler, item.scale = (0.3, 1.2, -0.4), (0.4, 0.5, 0.6), (1.5, 2.0, 0.7)
    scene.collection.objects.link(item)
    return lambda tree: shown(tree, add(tree, "TexCoord", object=item).outputs["Object"], 0.1)


@pytest.mark.parametrize("lens", ["ORTHO", "PERSP"])
def test_coordinates_are_those_of_cycles(scene: Any, lens: str) -> None:
    makers = {**dict(places()), "another object": another(scene)}
    bpy.context.view_layer["mood"] = (0.2, 0.5, 0.9)
    atlas.sheet(scene, makers, grid(1))
    # Turn all tiles a little, and give each object values of its own.
    for k, item in enumerate(item for item in scene.objects if item.type == "MESH"):
        item.scale, item.rotation_euler = (0.5, 0.5, 1.3), (0.3, -0.2, 0.1)
        item.color, item.pass_index = (0.1 * (k % 9), 0.4, 0.9, 0.3), k % 7
        item["tint"] = (0.3, 0.05 * (k % 5), 0.8, 0.4)
        item.material_slots[0].material.pass_index = k % 5
    camera = scene.camera
    if lens == "PERSP":
        camera.data.type, camera.data.angle = "PERSP", 2 * math.atan(camera.data.ortho_scale / 20)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings


def test_tangents_are_those_of_cycles(scene: Any) -> None:
    makers = {axis: read("Tangent", "Tangent", direction_type="RADIAL", axis=axis) for axis in "XYZ"}
    makers |= {"pointiness": read("NewGeometry", "Pointiness", 3.0, -1.0)}
    makers |= {"map": read("Tangent", "Tangent", direction_type="UV_MAP"), "geometry": read("NewGeometry", "Tangent")}
    atlas.sheet(scene, makers, ball())
    for item in scene.objects:
        if item.type == "MESH":
            item.rotation_euler, item.scale = (0.3, -0.4, 0.1), (1.0, 0.8, 0.9)
    ours, theirs = atlas.both(scene, makers, samples=SAMPLES, bounces=0)
    assert not atlas.differences(ours, theirs)


def absurd(output: Callable[[Any], Any]) -> atlas.Maker:
    """Emission of a value that may be anything."""
    return lambda tree: shown(tree, output(tree))


def test_absurd_values_give_a_picture(scene: Any) -> None:
    flat = bpy.data.objects.new("Flat", None)
    flat.scale = (0.0, 1.0, 1.0)
    scene.collection.objects.link(flat)
    makers = {
        "other": absurd(lambda tree: add(tree, "TexCoord", object=flat).outputs["Object"]),
        "text": absurd(
            lambda tree: add(tree, "Attribute", attribute_type="OBJECT", attribute_name="words").outputs["Color"]
        ),
        "nothing": absurd(
            lambda tree: add(tree, "Attribute", attribute_type="VIEW_LAYER", attribute_name="").outputs["Color"]
        ),
        "infinite": absurd(
            lambda tree: add(tree, "Attribute", attribute_type="OBJECT", attribute_name="huge").outputs["Color"]
        ),
    }
    for value in (math.nan, math.inf, -math.inf, 3e38, -3e38):
        makers |= {
            f"K {value}": absurd(lambda tree, x=value: add(tree, "Blackbody", Temperature=x).outputs[0]),
            f"nm {value}": absurd(lambda tree, x=value: add(tree, "Wavelength", Wavelength=x).outputs[0]),
            f"turn {value}": absurd(
                lambda tree, x=value: add(tree, "VectorRotate", Angle=x, Axis=(x, x, 0)).outputs[0]
            ),
            f"steps {value}": absurd(
                lambda tree, x=value: add(tree, "MapRange", interpolation_type="STEPPED", Steps=x, Value=x).outputs[0]
            ),
        }
    atlas.sheet(scene, makers, grid(1))
    for item in scene.objects:
        if item.type == "MESH":
            item["words"], item["huge"], item.scale = "red", [math.inf, math.nan, 1e300], (0.5, 0.5, 1.0)
    atlas.configure(scene, 1, 0)
    found = atlas.rendered(scene, makers, "HALFSPACE")
    assert {name for name, tile in found.items() if not (tile == tile).all() or abs(tile).max() > 1e38} == set()
    report = reports.last(scene)
    assert report is not None
    assert any("object without size" in line for line in report.warnings)
    assert any("not finite" in line for line in report.warnings)


def bowl(output: str, kind: str, **settings: Any) -> atlas.Maker:
    """A shader that scatters, and glows by a property of the path."""

    def make(tree: Any) -> Any:
        mix = add(tree, "MixShader")
        mix.inputs[0].default_value = 0.5
        glow = add(tree, "Emission")
        tree.links.new(shown(tree, add(tree, "LightPath").outputs[output], 0.4, 0.1), glow.inputs["Color"])
        tree.links.new(glow.outputs[0], mix.inputs[1])
        tree.links.new(add(tree, f"Bsdf{kind}", **settings).outputs[0], mix.inputs[2])
        return mix.outputs[0]

    return make


def portal(color: tuple[float, ...], shift: tuple[float, ...], direction: tuple[float, ...]) -> atlas.Maker:
    """A half transparent portal to a place beside the surface."""

    def make(tree: Any) -> Any:
        mix = add(tree, "MixShader")
        mix.inputs[0].default_value = 0.7
        elsewhere = add(tree, "VectorMath", operation="ADD")
        tree.links.new(add(tree, "NewGeometry").outputs["Position"], elsewhere.inputs[0])
        elsewhere.inputs[1].default_value = shift
        node = add(tree, "BsdfRayPortal", Color=(*color, 1.0), Direction=direction)
        tree.links.new(elsewhere.outputs[0], node.inputs["Position"])
        tree.links.new(add(tree, "BsdfDiffuse").outputs[0], mix.inputs[1])
        tree.links.new(node.outputs[0], mix.inputs[2])
        return mix.outputs[0]

    return make


def seen_portals(tree: Any) -> Any:
    """Emission that shows the number of portals on the way; before Blender 5.0, that of all surfaces passed."""
    outputs = add(tree, "LightPath").outputs
    return shown(tree, outputs["Portal Depth" if "Portal Depth" in outputs else "Transparent Depth"], 0.4, 0.2)


def test_portals_are_those_of_cycles(scene: Any) -> None:
    makers = {
        "down": portal((0.9, 0.6, 0.3), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)),
        "aside": portal((1.0, 1.0, 1.0), (0.2, 0.1, -0.5), (0.3, 0.2, -1.0)),
        "up": portal((0.5, 0.9, 1.0), (0.0, 0.0, 0.5), (0.0, 0.5, 1.0)),
        "here": portal((0.8, 0.8, 0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        "absurd": portal((2.0, 1.0, 0.5), (3e38, 0.0, 0.0), (0.0, 0.0, 0.0)),
    }
    atlas.sheet(scene, makers, grid(1))
    for item in [item for item in scene.objects if item.type == "MESH"]:
        item.scale = (0.5, 0.5, 1.0)
    floor = bpy.data.objects.new("Floor", grid(1))
    floor.location, floor.scale = (1.5, 1.0, -2.0), (4.0, 4.0, 1.0)
    floor.data.materials.append(atlas.tile_material("Floor", seen_portals))
    scene.collection.objects.link(floor)
    world = scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler = (0.3, 0.2, 0.0)
    scene.collection.objects.link(sun)
    ours, theirs = atlas.both(scene, makers, samples=256, bounces=2)
    assert not atlas.differences(ours, theirs, alike=None)


def test_properties_of_paths_are_those_of_cycles(scene: Any) -> None:
    makers = {
        f"{output} {kind}": bowl(output, kind, **settings)
        for output in ("Ray Length", "Ray Depth", "Diffuse Depth", "Glossy Depth", "Transparent Depth")
        for kind, settings in (("Diffuse", {}), ("Glossy", {"Roughness": 0.0}), ("Transparent", {}))
    } | {
        f"{output} {kind}": bowl(output, kind, **settings)
        for output in ("Is Diffuse Ray", "Is Glossy Ray", "Is Reflection Ray", "Is Transmission Ray")
        for kind, settings in (("Diffuse", {}), ("Translucent", {}), ("Refraction", {"Roughness": 0.5}))
    }
    makers |= {
        f"Is Singular Ray {roughness}": bowl("Is Singular Ray", "Glossy", Roughness=roughness)
        for roughness in (0.0, 0.4)
    }
    atlas.sheet(scene, makers, ball())
    for item in scene.objects:
        if item.type == "MESH":
            item.rotation_euler = (math.pi, 0, 0)
    ours, theirs = atlas.both(scene, makers, samples=256, bounces=3)
    # *Is Diffuse Ray* behind a translucent surface: 1.40 to 1.55 % brighter than Cycles at 4096 samples.
    assert not atlas.differences(ours, theirs, mean=0.02)

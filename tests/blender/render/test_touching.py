# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that lie on each other or closely before another, and scenes of any size and order of objects."""

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.exr_files import colours, render
from tests.blender.shapes import cube, grid, lamp, material, node, place, read, world

WHITE = (0.8, 0.8, 0.8, 1.0)


@pytest.fixture(autouse=True)
def _plain(scene: Any) -> None:
    """A small picture under sun and sky."""
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x, scene.render.resolution_y = 48, 36
    scene.halfspace.samples, scene.halfspace.max_bounces = 64, 4
    scene.halfspace.use_adaptive, scene.halfspace.use_denoising = False, False
    world(0.4, 0.4, 0.4)
    lamp("SUN", 3.0, "Sun", angle=0.0, rotation_euler=(0.6, 0.3, 0.2))


def look(origin: tuple[float, ...], target: tuple[float, ...]) -> None:
    data = bpy.data.cameras.new("Camera")
    far = math.dist(origin, target)
    data.clip_start, data.clip_end = 1e-3 * far, 1e3 * far
    # Blender takes short directions for none.
    turn = ((Vector(target) - Vector(origin)) / far).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = place("Camera", data, location=origin, rotation_euler=turn)


def picture(scene: Any, folder: Path) -> np.ndarray[Any, Any]:
    return np.asarray(colours(render(scene, folder)))


def clear_scene() -> None:
    for item in list(bpy.data.objects):
        if item.type in ("MESH", "CAMERA"):
            bpy.data.objects.remove(item)


def floor() -> None:
    place("Floor", grid(1), material("Grey", Base_Color=WHITE), scale=(6, 6, 1), location=(0, 0, -1))


def blocks(scene: Any, folder: Path, spans: list[tuple[float, float]]) -> float:
    """The mean of boxes over these parts of the x axis, over a floor."""
    clear_scene()
    look((4, -5, 3.5), (0, 0, 0))
    floor()
    for number, (low, high) in enumerate(spans):
        scale = (high - low, 1.2, 1.2)
        fog = atlas.tile_material("Fog", made("VolumeAbsorption", Density=1.0))
        tree = fog.node_tree
        output = node(tree, "ShaderNodeOutputMaterial")
        tree.links.new(node(tree, "ShaderNodeVolumeAbsorption").outputs[0], output.inputs["Volume"])
        tree.links.remove(output.inputs["Surface"].links[0])
        place(f"Box {number}", cube(size=1.0), fog, location=((low + high) / 2, 0, 0), scale=scale)
    return float(picture(scene, folder).mean())


def test_volumes_that_touch_are_as_one(scene: Any, tmp_path: Path) -> None:
    one = blocks(scene, tmp_path, [(-1.2, 1.2)])
    cases = ([(-1.2, 0), (0, 1.2)], [(0, 1.2), (-1.2, 0)], [(-1.2, -0.6), (-0.6, 0), (0, 0.6), (0.6, 1.2)])
    for spans in cases:
        assert blocks(scene, tmp_path, spans) == pytest.approx(one, rel=3e-3), spans


@pytest.mark.parametrize("gap", [0.0, 1e-5])
def test_glass_on_a_floor_in_any_order(scene: Any, tmp_path: Path, gap: float) -> None:
    def made(order: tuple[str, ...], gap: float) -> np.ndarray[Any, Any]:
        clear_scene()
        look((4, -5, 3.5), (0, 0, 0))
        glass, where = material("Glass", Transmission_Weight=1.0, Roughness=0.0), (0, 0, -0.25 + gap)
        things = {"Floor": floor, "Block": lambda: place("Block", cube(size=1.5), glass, location=where)}
        for name in order:
            things[name]()
        return picture(scene, tmp_path)

    first, second = made(("Floor", "Block"), gap), made(("Block", "Floor"), gap)
    assert np.array_equal(first, second)
    assert first.mean() == pytest.approx(made(("Floor", "Block"), 1e-3).mean(), rel=0.01)


@pytest.mark.parametrize(("offset", "gap"), [(10.0, 1e-4), (100.0, 1e-3), (1000.0, 1e-2), (300.0, 4e-3)])
def test_a_clear_sheet_closely_before_a_wall_is_invisible(
    scene: Any, tmp_path: Path, offset: float, gap: float
) -> None:
    def made(*, sheet: bool) -> np.ndarray[Any, Any]:
        clear_scene()
        at, upright = (offset, offset, offset), (math.pi / 2, 0, 0)
        look((offset, offset - 6, offset), at)
        place("Wall", grid(1), material("Red", Base_Color=(0.8, 0.2, 0.1, 1)), location=at, rotation_euler=upright)
        place("Other", grid(1), location=tuple(-x for x in at))
        if sheet:
            before = (offset, offset - gap, offset)
            place("Sheet", grid(1), material("Clear", Alpha=0.0), location=before, rotation_euler=upright)
        return picture(scene, tmp_path)

    scene.halfspace.samples = 4
    scene.objects["Sun"].rotation_euler = (math.pi / 2 - 0.3, 0, 0.2)
    assert made(sheet=True).mean() == pytest.approx(made(sheet=False).mean(), rel=0.01)


@pytest.mark.parametrize("scale", [1e-6, 1e-4, 1e5])
def test_pictures_without_a_length_do_not_depend_on_the_scale(scene: Any, tmp_path: Path, scale: float) -> None:
    def made(scale: float) -> np.ndarray[Any, Any]:
        clear_scene()
        look((4 * scale, -5 * scale, 3.5 * scale), (0, 0, 0))
        grey = material("Grey", Base_Color=WHITE)
        place("Floor", grid(1), grey, scale=(6 * scale, 6 * scale, scale), location=(0, 0, -scale))
        place("Ball", cube(smooth=True), material("Glossy", Roughness=0.2), scale=(scale,) * 3)
        return picture(scene, tmp_path)

    one, other = (made(s).reshape(6, 6, 8, 6, 3).mean(axis=(1, 3)) for s in (1.0, scale))
    assert np.abs(other / one - 1).max() < 0.03


def test_triangles_do_not_come_in_the_order_of_objects(scene: Any) -> None:
    def vertices(names: str) -> np.ndarray[Any, Any]:
        clear_scene()
        mesh = cube()
        for name in names:
            # Instances of one mesh, and a mesh of its own.
            place(name, cube() if name == "C" else mesh, location=("ABCD".index(name), 0, 0))
        found, _ = read()
        return np.asarray(found.geometry.vertices[found.geometry.triangles])

    first = vertices("ABCD")
    for names in ("DCBA", "BDAC"):
        assert np.array_equal(vertices(names), first)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes without what they need: an error in one line or a picture, and Blender goes on."""

from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender.shapes import cube, material, place, world

SIZE = 8
"""Pixels along a side of a baked picture."""


@pytest.fixture(name="box")
def a_box(scene: Any) -> Any:
    """A cube in a grey world, with an image to bake into."""
    scene.render.engine = ENGINE
    scene.halfspace.samples, scene.halfspace.max_bounces = 2, 1
    world()
    paint = material("Paint")
    texture = paint.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("Target", SIZE, SIZE, float_buffer=True)
    paint.node_tree.nodes.active = texture
    item = place("Box", cube("Box"), paint)
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    return item


def bake() -> Any:
    """The result of Blender's operator. Raises RuntimeError with its message."""
    return bpy.ops.object.bake(type="COMBINED", margin=0)


def baked() -> Any:
    """The pixels of the target after a bake, (n, 4)."""
    assert bake() == {"FINISHED"}
    return np.array(bpy.data.images["Target"].pixels[:]).reshape(-1, 4)


@pytest.mark.parametrize("what", ["no map", "no image", "no pixels", "no material"])
def test_without_a_target_nothing_is_baked_and_the_next_bake_works(box: Any, what: str, tmp_path: Any) -> None:
    paint = box.material_slots[0].material
    texture = paint.node_tree.nodes.active
    image = texture.image
    match what:
        case "no map":
            name = box.data.uv_layers[0].name
            box.data.uv_layers.remove(box.data.uv_layers[0])
        case "no image":
            texture.image = None
        case "no pixels":
            texture.image = bpy.data.images.new("Nothing", 1, 1)
            texture.image.source, texture.image.filepath = "FILE", str(tmp_path / "missing.png")
        case "no material":
            box.material_slots[0].material = None
    # Blender's operator refuses, before or after it calls the engine.
    message = ""
    try:
        assert bake() == {"CANCELLED"}
    except RuntimeError as error:
        message = str(error).strip()
    assert len(message.splitlines()) <= 2
    assert "Traceback" not in message
    # The engine is not left with an open result.
    if what == "no map":
        box.data.uv_layers.new(name=name)
    box.material_slots[0].material, texture.image = paint, image
    pixels = baked()
    assert np.isfinite(pixels).all()
    assert pixels[:, :3].max() > 0.01


@pytest.mark.parametrize("size", [(1, 1), (1, 64), (3, 2)])
def test_tiny_images_are_baked(box: Any, size: tuple[int, int]) -> None:
    bpy.data.images["Target"].scale(*size)
    assert np.isfinite(baked()).all()


def test_triangles_without_area_in_the_map_stay_black(box: Any) -> None:
    for corner in box.data.uv_layers[0].data:
        corner.uv = (0.5, 0.5)
    pixels = baked()
    assert np.isfinite(pixels).all()
    assert (pixels[:, :3] == 0).mean() > 0.9


@pytest.mark.parametrize("odd", [float("nan"), float("inf"), 1e30])
def test_maps_that_are_not_finite_give_a_picture(box: Any, odd: float) -> None:
    box.data.uv_layers[0].data[0].uv = (odd, 0.5)
    assert np.isfinite(baked()).all()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of view layers are applied, and unsupported ones are reported."""

from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.blender.read import visibility
from addon.blender.read.linking import Linking
from addon.core.base.notes import Notes
from tests.blender import atlas
from tests.blender.exr_files import exr
from tests.blender.shapes import cube, look, material, place, read, world


@pytest.fixture
def layer(scene: Any) -> Any:
    """The view layer of a scene with a red cube in a collection of its own, a bare cube, and a green world."""
    apart = bpy.data.collections.new("Apart")
    scene.collection.children.link(apart)
    red = place("Cube", cube(), material("Red"))
    apart.objects.link(red)
    scene.collection.objects.unlink(red)
    place("Bare", cube("Bare"), location=(4, 0, 0))
    world(0, 1, 0)
    bpy.context.view_layer.update()
    return bpy.context.view_layer


def apart(layer: Any) -> Any:
    return layer.layer_collection.children["Apart"]


def test_a_material_override_is_all_that_is_seen(layer: Any) -> None:
    layer.material_override = material("Clay")
    found, notes = read()
    assert {found.materials[i].name for i in found.geometry.material_index} == {"Clay"}
    assert notes == []


def test_a_world_override_is_the_world(layer: Any, scene: Any) -> None:
    if not hasattr(layer, "world_override"):
        pytest.skip("this Blender has no worlds of view layers")
    green = scene.world
    world(0, 0, 1)
    layer.world_override, scene.world = scene.world, green
    assert read()[0].world.color == (0, 0, 1)
    layer.world_override = None
    assert read()[0].world.color == (0, 1, 0)


def test_without_sky_the_background_is_black_and_without_solids_there_are_no_surfaces(layer: Any) -> None:
    layer.use_sky = False
    assert read()[0].world.color == (0, 0, 0)
    layer.use_sky, layer.use_solid = True, False
    found, _ = read()
    assert len(found.geometry.triangles) == 0
    assert found.world.color == (0, 1, 0)


def test_a_collection_seen_only_indirectly_is_hidden_from_the_camera(layer: Any) -> None:
    apart(layer).indirect_only = True
    found, notes = read()
    assert {(m.name, m.hidden_from) for m in found.materials[1:]} == {("Red", ("camera",))}
    assert notes == []


def test_a_collection_that_is_a_holdout_makes_holes_of_its_objects(layer: Any) -> None:
    apart(layer).holdout = True
    found, notes = read()
    assert {m.name: m.hole for m in found.materials[1:]}["Red"]
    assert notes == []


def test_an_instance_follows_the_collection_of_its_instancer(layer: Any, scene: Any) -> None:
    inside = bpy.data.collections.new("Inside")
    inside.objects.link(bpy.data.objects.new("Part", cube("Part")))
    holder = bpy.data.objects.new("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", inside
    apart_collection = bpy.data.collections["Apart"]
    apart_collection.objects.link(holder)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.data.objects.remove(bpy.data.objects["Bare"])
    apart(layer).indirect_only = True
    assert [m.hidden_from for m in read()[0].materials[1:]] == [("camera",)]


def test_lamps_that_are_no_shadow_catchers_are_reported_where_there_are_any(layer: Any, add: Any) -> None:
    lamp = add("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    add("Other", bpy.data.lights.new("Other", "POINT"))
    lamp.is_shadow_catcher = False
    assert read()[1] == []
    bpy.data.objects["Bare"].is_shadow_catcher = True
    found, notes = read()
    assert notes == ["Not a shadow catcher, but shines on shadow catchers alone, too: Lamp"]
    assert [material.catcher for material in found.materials].count(True) == 1


def test_passes_that_are_not_rendered_are_reported(layer: Any, scene: Any, tmp_path: Path) -> None:
    look((8, 8))
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", 1
    layer.use_pass_z = layer.use_pass_ambient_occlusion = layer.use_pass_shadow = True
    exr(scene, tmp_path / "picture.exr")
    lines = [line for line in atlas.warnings(scene) if line.startswith("The pass ")]
    assert [line.split(" is not")[0] for line in lines] == ["The pass Shadow", "The pass Ambient Occlusion"]
    assert all(line.endswith(f": {layer.name}") for line in lines)


def test_objects_of_equal_name_from_two_files_keep_their_numbers(scene: Any, add: Any, tmp_path: Path) -> None:
    library = tmp_path / "parts.blend"
    away = bpy.data.objects.new("Same", cube("Away"))
    away.pass_index = 3
    bpy.data.libraries.write(str(library), {away})
    bpy.data.objects.remove(away)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["Same"]
    scene.collection.objects.link(wanted.objects[0])
    here = add("Same", cube("Here"), location=(4, 0, 0), pass_index=7)
    assert here.name == wanted.objects[0].name
    here.shadow_terminator_shading_offset = 0.5
    found, notes = read()
    arrays = found.numbers.arrays(found.geometry.runs())
    assert sorted(arrays["object"]) == [3, 7]
    assert len(notes) == 1
    assert notes[0].endswith(": Same")


def test_collections_come_in_their_order(scene: Any) -> None:
    for name in "AB":
        outer = bpy.data.collections.new(name)
        scene.collection.children.link(outer)
        for i in range(2):
            outer.children.link(bpy.data.collections.new(f"{name}{i}"))
    first = bpy.context.view_layer.layer_collection
    first.children["B"].children["B0"].exclude = True
    assert [one.name for one in visibility._collections(first)][1:] == ["A", "A0", "A1", "B", "B1"]


def test_collections_may_lie_within_each_other_more_deeply_than_calls(scene: Any) -> None:
    def marked() -> bool:
        linking = Linking(bpy.context.evaluated_depsgraph_get(), Notes())
        return visibility.Visibility(bpy.context.view_layer, linking)._marked

    inner = scene.collection
    for _ in range(1100):
        new = bpy.data.collections.new("Within")
        inner.children.link(new)
        inner = new
    assert not marked()
    last = bpy.context.view_layer.layer_collection
    while last.children:
        (last,) = last.children
    last.holdout = True
    assert marked()

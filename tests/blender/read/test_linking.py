# SPDX-License-Identifier: GPL-3.0-or-later
"""The collections of linked lights become numbered sets."""

from typing import Any

import bpy

from addon.blender.read import linking
from tests.blender.shapes import cube, material, read


def lamp(add: Any, name: str = "Lamp") -> Any:
    return add(name, bpy.data.lights.new(name, "POINT"))


def bits(scene: Any) -> dict[str, tuple[int, int]]:
    """The sets of the material of each object, by the object's name."""
    geometry = scene.geometry
    found = {}
    for source in geometry.sources:
        material = scene.materials[geometry.material_index[source.start]]
        found |= dict.fromkeys(source.names, (material.receives, material.blocks))
    return found


def test_objects_have_a_bit_for_each_collection_that_they_are_in(add: Any) -> None:
    mesh = cube()
    items = {name: add(name, mesh) for name in "ABC"}
    collections = {}
    for name, members in {"First": "AB", "Second": "C", "Nested": ""}.items():
        collections[name] = bpy.data.collections.new(name)
        for member in members:
            collections[name].objects.link(items[member])
    collections["Nested"].children.link(collections["First"])
    lamp(add, "Plain")
    one, two, three = (lamp(add, name) for name in ("One", "Two", "Three"))
    one.light_linking.receiver_collection = collections["First"]
    two.light_linking.receiver_collection = collections["Second"]
    two.light_linking.blocker_collection = collections["First"]
    three.light_linking.receiver_collection = collections["Nested"]
    scene, notes = read()
    assert not notes
    sets = {light.name: (light.receivers, light.blockers) for light in scene.lights}
    assert sets["Plain"] == (0, 0)
    assert len({sets[name][0] for name in ("One", "Two", "Three")} | {0}) == 4
    seen = bits(scene)
    for item in "ABC":
        receives, blocks = seen[item]
        assert receives & 1
        assert {name for name, (number, _) in sets.items() if receives >> number & 1} == (
            {"Plain", "Two"} if item == "C" else {"Plain", "One", "Three"}
        )
        assert bool(blocks >> sets["Two"][1] & 1) == (item != "C")


def test_excluded_objects_are_all_that_a_light_misses(add: Any) -> None:
    mesh = cube()
    first = add("A", mesh)
    add("B", mesh)
    collection = bpy.data.collections.new("Apart")
    collection.objects.link(first)
    collection.collection_objects[0].light_linking.link_state = "EXCLUDE"
    lamp(add).light_linking.receiver_collection = collection
    seen = bits(read()[0])
    assert seen["A"][0] == 1
    assert seen["B"][0] == 3


def test_an_empty_collection_links_all(add: Any) -> None:
    add("A", cube())
    lamp(add).light_linking.receiver_collection = bpy.data.collections.new("Empty")
    assert bits(read()[0])["A"][0] == 3


def test_more_collections_than_sets_are_listed(add: Any) -> None:
    add("A", cube())
    for k in range(linking.MOST_SETS):
        lamp(add, f"Lamp {k}").light_linking.receiver_collection = bpy.data.collections.new(f"Set {k}")
    scene, notes = read()
    assert max(light.receivers for light in scene.lights) == linking.MOST_SETS - 1
    assert len(notes) == 1
    assert "light linking" in notes[0]


def test_glowing_objects_have_the_sets_of_their_collections(add: Any) -> None:
    mesh = cube()
    mesh.materials.append(material("Glow", Emission_Strength=1.0))
    item, plain = add("Glow", mesh), add("Plain", mesh)
    collection = bpy.data.collections.new("Apart")
    collection.objects.link(plain)
    item.light_linking.receiver_collection = item.light_linking.blocker_collection = collection
    scene, notes = read()
    assert not notes
    glow, other = (
        scene.materials[scene.geometry.material_index[source.start]]
        for name in ("Glow", "Plain")
        for source in scene.geometry.sources
        if name in source.names
    )
    assert (glow.receivers, glow.blockers, other.receivers, other.blockers) == (1, 1, 0, 0)
    assert (glow.receives, glow.blocks, other.receives, other.blocks) == (1, 1, 3, 3)

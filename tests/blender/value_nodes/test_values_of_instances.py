# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that instances have from their instancers, compared with Cycles."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
import pytest

from tests.blender import atlas
from tests.blender.atlas import read
from tests.blender.shapes import grid, look


def fan(makers: Sequence[atlas.Maker]) -> Any:
    """A row of squares, one for each maker, around the origin."""
    mesh = bpy.data.meshes.new("Fan")
    width = 1 / len(makers)
    corners = [(k * width - 0.5, y, 0.0) for k in range(len(makers) + 1) for y in (-0.2, 0.2)]
    mesh.from_pydata(corners, [], [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(len(makers))])
    for make in makers:
        mesh.materials.append(atlas.tile_material("Shown", make))
    mesh.polygons.foreach_set("material_index", range(len(makers)))
    return mesh


@pytest.fixture
def stage(scene: Any) -> Any:
    """A camera above the origin."""
    atlas.with_cycles(scene)
    look((96, 96), (0, 0, 10), type="ORTHO", ortho_scale=6)
    return scene


def compared(scene: Any) -> None:
    """Both engines show the same."""
    atlas.configure(scene, 64, 0)
    atlas.remember_nodes()
    ours, theirs = atlas.pair(scene)
    assert theirs.std() > 0.05
    assert not atlas.differences({"all": ours}, {"all": theirs})
    apart = np.abs(ours - theirs).max(axis=2) > 0.1
    assert apart.mean() < 0.01, "apart from edges, all pixels agree"


def test_particles_are_those_of_cycles(stage: Any, add: Any) -> None:
    names = {"Index": 0.1, "Random": 0.5, "Age": 0.02, "Lifetime": 0.005, "Location": 0.1, "Size": 1.0}
    makers = [read("ParticleInfo", name, factor) for name, factor in names.items()]
    makers += [read("ParticleInfo", name, 0.2) for name in ("Velocity", "Angular Velocity")]
    shown = add("Shown", fan(makers), location=(0, -2.7, 0))
    emitter = add("Emitter", grid(3))
    emitter.scale = (1.2, 1.2, 1)
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    emitter.show_instancer_for_render = False
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 9, -20, 0, 60
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", shown, 0.9
    settings.lifetime_random = settings.size_random = 0.5
    settings.normal_factor, settings.effector_weights.gravity, settings.emit_from = 0.05, 0.0, "VERT"
    settings.use_rotations, settings.angular_velocity_mode = False, "GLOBAL_X"
    stage.frame_set(4)
    compared(stage)


def scatter(shown: Any) -> Any:
    """Geometry nodes that put an instance on each vertex, with an attribute of its own."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    place, info = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeObjectInfo")
    store, position = tree.nodes.new("GeometryNodeStoreNamedAttribute"), tree.nodes.new("GeometryNodeInputPosition")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = shown, True
    store.data_type, store.domain, store.inputs["Name"].default_value = "FLOAT_VECTOR", "INSTANCE", "tint"
    value = next(socket for socket in store.inputs if socket.name == "Value" and socket.enabled)
    for output, end in (
        (first.outputs[0], place.inputs["Points"]),
        (info.outputs["Geometry"], place.inputs["Instance"]),
        (place.outputs[0], store.inputs["Geometry"]),
        (position.outputs[0], value),
        (store.outputs[0], last.inputs[0]),
    ):
        tree.links.new(output, end)
    return tree


def duplicates(shown: Any, add: Any) -> None:
    for k, (x, y) in enumerate(((-1.2, -1), (0.3, -0.2), (1.1, 1.2), (-1, 1.4))):
        other = add("Copy", shown.data, location=(x, y, 0), rotation_euler=(0, 0, 0.4 * k))
        other.color, other.pass_index, other["own"] = (0.2 * k, 0.5, 1 - 0.2 * k, 0.3 * k), k, (0.1, 0.2 * k, 0.7)


def by_mesh(shown: Any, add: Any, kind: str) -> None:
    parent = add("Parent", grid(2), location=(0.2, 0.4, 0), scale=(1.4, 1.1, 1))
    parent.instance_type, parent.show_instancer_for_render, parent["tint"] = kind, False, (0.1, 0.6, 0.7)
    parent.color, parent.pass_index = (0.9, 0.1, 0.2, 0.4), 5
    child = add("Child", shown.data, scale=(0.7, 0.7, 1))
    child.parent, child["own"], child.color, child.pass_index = parent, (0.9, 0.2, 0.4), (0.3, 0.8, 0.5, 0.6), 3


def collection(add: Any, *items: Any, places: tuple[float, float] = (-0.9, 1.3)) -> Any:
    """A collection of these objects and, by two empties that stand for it, the instances of it."""
    group = bpy.data.collections.new("Group")
    for item in items:
        for old in list(item.users_collection):
            old.objects.unlink(item)
        group.objects.link(item)
    for k, y in enumerate(places):
        empty = add("Instancer", None, location=(0.3, y, 0), rotation_euler=(0, 0, 0.5 * k))
        empty.instance_type, empty.instance_collection, empty["tint"] = "COLLECTION", group, (0.7, 0.2 * k, 0.3)
        empty.color, empty.pass_index = (0.2, 0.3 + 0.5 * k, 0.6, 0.9), 2 + k
    return group


def by_collection(shown: Any, add: Any) -> None:
    collection(add, add("Member", shown.data, location=(-0.9, 0.2, 0)), add("Other", shown.data, location=(0.8, 0, 0)))


def by_nodes(shown: Any, add: Any) -> None:
    scattered = add("Scattered", grid(2), location=(0.2, 0.4, 0), scale=(1.5, 1.3, 1))
    scattered["tint"] = (0.9, 0.9, 0.1)
    scattered.color, scattered.pass_index = (0.4, 0.3, 0.9, 0.2), 6
    scattered.modifiers.new("Scatter", "NODES").node_group = scatter(shown)


def by_particles(shown: Any, add: Any) -> None:
    emitter = add("Emitter", grid(2), location=(0.2, 0.4, 0), scale=(1.3, 1.2, 1))
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    emitter.show_instancer_for_render, emitter["tint"] = False, (0.2, 0.5, 0.6)
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 4, 1, 1, 60
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", shown, 0.8
    settings.normal_factor, settings.effector_weights.gravity, settings.emit_from = 0.0, 0.0, "VERT"
    settings.physics_type = "NO"


def by_nested_collections(shown: Any, add: Any) -> None:
    inner = add("Member", shown.data, location=(-0.5, 0.1, 0), scale=(0.6, 0.6, 1))
    collection(add, inner)
    # No instance lies on another, of which each engine shows one.
    outer = [item for item in bpy.context.scene.objects if item.instance_type == "COLLECTION"]
    collection(add, *outer, places=(-1.2, 1.5))


def nodes_in_a_collection(shown: Any, add: Any) -> None:
    hidden, scattered = (
        add("Hidden", shown.data),
        add("Scattered", grid(2), location=(0.2, 0.1, 0), scale=(0.6, 0.5, 1)),
    )
    hidden.hide_render, scattered["tint"] = True, (0.9, 0.9, 0.1)
    scattered.color, scattered.pass_index = (0.4, 0.3, 0.9, 0.2), 6
    scattered.modifiers.new("Scatter", "NODES").node_group = scatter(shown)
    collection(add, hidden, scattered)


WAYS = {
    "linked duplicates": duplicates,
    "vertices": lambda shown, add: by_mesh(shown, add, "VERTS"),
    "faces": lambda shown, add: by_mesh(shown, add, "FACES"),
    "collections": by_collection,
    "geometry nodes": by_nodes,
    "particles": by_particles,
    "nested collections": by_nested_collections,
    "geometry nodes in a collection": nodes_in_a_collection,
}
"""All ways to make instances of an object, next to that object itself."""


@pytest.mark.parametrize("way", WAYS)
def test_values_of_every_kind_of_instance_are_those_of_cycles(way: str, stage: Any, add: Any) -> None:
    """Random is a share of the largest number for all of them, never negative."""
    makers = [
        read("ObjectInfo", "Random", 1.0),
        read("ObjectInfo", "Color"),
        read("ObjectInfo", "Alpha"),
        read("ObjectInfo", "Object Index", 0.1),
        read("ObjectInfo", "Material Index", 0.2),
        read("ObjectInfo", "Location", 0.2),
        read("Attribute", "Vector", attribute_type="INSTANCER", attribute_name="tint"),
        read("Attribute", "Vector", attribute_type="OBJECT", attribute_name="own"),
        read("Attribute", "Vector", attribute_type="GEOMETRY", attribute_name="own"),
        read("TexCoord", "Generated", from_instancer=True),
        read("TexCoord", "UV", from_instancer=True),
    ]
    mesh = fan(makers)
    values = mesh.attributes.new("own", "FLOAT_VECTOR", "POINT")
    values.data.foreach_set("vector", np.linspace(-1, 1, 3 * len(mesh.vertices), dtype=np.float32))
    for index, material in enumerate(mesh.materials):
        material.pass_index = index % 4
    shown = add("Shown", mesh, location=(0, -2.7, 0))
    shown["own"], shown.color, shown.pass_index = (0.3, 0.8, 0.1), (0.6, 0.1, 0.4, 0.5), 4
    WAYS[way](shown, add)
    compared(stage)


def test_attributes_and_places_of_instances_are_those_of_cycles(stage: Any, add: Any) -> None:
    makers = [
        read("Attribute", "Color", attribute_type="INSTANCER", attribute_name="tint"),
        read("Attribute", "Vector", attribute_type="INSTANCER", attribute_name="own"),
        read("TexCoord", "Generated", from_instancer=True),
        read("TexCoord", "UV", from_instancer=True),
    ]
    shown = add("Shown", fan(makers), location=(0, -2.7, 0))
    shown["own"] = (0.3, 0.8, 0.1)
    # Geometry nodes put an instance on each vertex, with an attribute of its own.
    scattered = add("Scattered", grid(1), location=(0.2, 0.8, 0))
    scattered.modifiers.new("Scatter", "NODES").node_group = scatter(shown)
    # Another object has an instance on each vertex of a parent.
    parent = add("Parent", grid(1), location=(0, -1.2, 0), scale=(0.6, 0.3, 1))
    parent.instance_type, parent.show_instancer_for_render = "VERTS", False
    child = add("Child", shown.data)
    child.parent, child["own"], parent["tint"] = parent, (0.9, 0.2, 0.4), (0.1, 0.6, 0.7)
    compared(stage)

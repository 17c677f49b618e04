# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that instances have from their instancers, beside Cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add
from shapes import grid

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE


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


def read(kind: str, output: str, factor: float = 0.5, **settings: Any) -> atlas.Maker:
    """A value of a node, negative ones visible, too."""

    def make(tree: Any) -> Any:
        node = add(tree, "VectorMath", operation="MULTIPLY_ADD")
        tree.links.new(add(tree, kind, **settings).outputs[output], node.inputs[0])
        node.inputs[1].default_value, node.inputs[2].default_value = (factor,) * 3, (0.5,) * 3
        return node.outputs[0]

    return make


@pytest.fixture
def stage(scene: Any) -> Any:
    """A camera above the origin."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    data = bpy.data.cameras.new("Above")
    data.type, data.ortho_scale = "ORTHO", 6
    scene.camera = bpy.data.objects.new("Above", data)
    scene.camera.location = (0, 0, 10)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.render.resolution_percentage = 100
    return scene


def compared(scene: Any) -> None:
    """Both engines show the same."""
    atlas.configure(scene, 64, 0)
    atlas.remember_nodes()
    found = []
    for engine in (ENGINE, "CYCLES"):
        scene.render.engine = engine
        found.append(pictures.render(scene)[..., :3])
    ours, theirs = found
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
    with bpy.context.temp_override(object=emitter, active_object=emitter):
        bpy.ops.object.particle_system_add()
    emitter.show_instancer_for_render = False
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 9, -20, 0, 60
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", shown, 0.9
    settings.lifetime_random = settings.size_random = 0.5
    settings.normal_factor, settings.effector_weights.gravity, settings.emit_from = 0.05, 0.0, "VERT"
    settings.use_rotations, settings.angular_velocity_mode = False, "GLOBAL_X"
    stage.frame_set(4)
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
    scattered = add("Scattered", grid(1), location=(0.2, 0.8, 0))
    scattered.modifiers.new("Scatter", "NODES").node_group = tree
    # Another object has an instance on each vertex of a parent.
    parent = add("Parent", grid(1), location=(0, -1.2, 0), scale=(0.6, 0.3, 1))
    parent.instance_type, parent.show_instancer_for_render = "VERTS", False
    child = add("Child", shown.data)
    child.parent, child["own"], parent["tint"] = parent, (0.9, 0.2, 0.4), (0.1, 0.6, 0.7)
    compared(stage)

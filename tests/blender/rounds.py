# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, particle hair and point clouds for tests."""

from typing import Any

import bpy
import numpy as np

from addon.blender.read import extract
from addon.core.base.notes import Notes


def found() -> tuple[extract.Found, list[str]]:
    """The scene as read, and the remarks."""
    notes = Notes()
    read = extract.find(bpy.context.evaluated_depsgraph_get(), notes)
    return read, notes.lines()


def hair(points: Any, radii: Any = 0.02, name: str = "Curls") -> Any:
    """A hair curves data block with the same number of points, (k, n, 3), in each curve."""
    points = np.asarray(points, np.float32)
    curves = bpy.data.hair_curves.new(name)
    curves.add_curves([points.shape[1]] * len(points))
    curves.position_data.foreach_set("vector", points.reshape(-1))
    values = np.broadcast_to(np.asarray(radii, np.float32), points.shape[:2]).reshape(-1)
    curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", np.ascontiguousarray(values))
    return curves


def locks(count: int, *, bend: float = 0.1, seed: int = 1) -> Any:
    """Random curves of five points over a square of five units, (count, 5, 3)."""
    rng = np.random.default_rng(seed)
    begin = rng.uniform(-2.5, 2.5, (count, 1, 3)) * (1, 1, 0.3)
    step = rng.normal(size=(count, 1, 3)) * 0.3 + rng.normal(size=(count, 5, 3)) * bend
    return begin + np.cumsum(step, axis=1)


def _unplaced(count: int, name: str) -> Any:
    """A point cloud of this many points."""
    if hasattr(bpy.types.PointCloud, "resize"):
        dust = bpy.data.pointclouds.new(name)
        dust.resize(count)
        return dust
    # Before Blender 5.0 vertices become points by an operator.
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    with bpy.context.temp_override(active_object=item, object=item, selected_objects=[item]):
        item.select_set(True)
        bpy.ops.object.convert(target="POINTCLOUD")
    dust = item.data
    bpy.data.objects.remove(item)
    return dust


def cloud(points: Any, radii: Any = 0.1, name: str = "Dust") -> Any:
    """A point cloud."""
    points = np.asarray(points, np.float32)
    dust = _unplaced(len(points), name)
    if "position" not in dust.attributes:
        dust.attributes.new("position", "FLOAT_VECTOR", "POINT")
    dust.attributes["position"].data.foreach_set("vector", points.reshape(-1))
    values = np.ascontiguousarray(np.broadcast_to(np.asarray(radii, np.float32), len(points)))
    dust.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", values)
    return dust


def pointed(item: Any, radius: float) -> None:
    """Replace a mesh object's vertices by points, by geometry nodes."""
    tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    begin, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points = tree.nodes.new("GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = radius
    tree.links.new(begin.outputs[0], points.inputs["Mesh"])
    tree.links.new(points.outputs[0], end.inputs[0])
    item.modifiers.new("Points", "NODES").node_group = tree


def fur(item: Any, count: int, **settings: Any) -> Any:
    """Give a mesh object particle hair, with these settings."""
    modifier = item.modifiers.new("Fur", "PARTICLE_SYSTEM")
    particles = modifier.particle_system.settings
    particles.type, particles.count = "HAIR", count
    for key, value in settings.items():
        setattr(particles, key, value)
    return particles


def camera(scene: Any, distance: float = 10.0, width: int = 96) -> None:
    """A camera above the origin, and a square picture."""
    scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    scene.camera.location = (0, 0, distance)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x = scene.render.resolution_y = width
    scene.render.resolution_percentage = 100

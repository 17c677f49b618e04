# SPDX-License-Identifier: GPL-3.0-or-later
"""Small Blender data for tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bmesh
import bpy
import numpy as np

from addon.blender.read import extract
from addon.core.base.notes import Notes
from addon.core.scene.scene import Geometry, Scene


def triangle(name: str = "Triangle", *, at: float = 0.0, smooth: bool = False) -> Any:
    """A right-angled triangle in z = 0, facing +z."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(at, 0, 0), (at + 1, 0, 0), (at, 1, 0)], [], [(0, 1, 2)])
    mesh.polygons.foreach_set("use_smooth", [smooth])
    return mesh


@contextmanager
def _shaping(mesh: Any, *, smooth: bool, uvs: bool = False) -> Iterator[Any]:
    """A BMesh that becomes this mesh."""
    bm = bmesh.new()
    if uvs:
        bm.loops.layers.uv.new("UVMap")
    yield bm
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))


def sphere(segments: int, radius: float = 1.0, *, smooth: bool = True, half: bool = False) -> Any:
    """A closed sphere of twice as many segments as rings. half: with UVs, open below, so that light enters it."""
    mesh = bpy.data.meshes.new("Ball")
    with _shaping(mesh, smooth=smooth, uvs=half) as bm:
        bmesh.ops.create_uvsphere(bm, u_segments=segments, v_segments=segments // 2, radius=radius, calc_uvs=half)
        if half:
            bmesh.ops.delete(bm, geom=[v for v in bm.verts if v.co.z < -0.2], context="VERTS")
    return mesh


def ball() -> Any:
    """A smooth open sphere of 0.9 units."""
    return sphere(48, 0.45, half=True)


def cube(name: str = "Cube", size: float = 2.0, *, smooth: bool = False) -> Any:
    mesh = bpy.data.meshes.new(name)
    with _shaping(mesh, smooth=smooth, uvs=True) as bm:
        bmesh.ops.create_cube(bm, size=size, calc_uvs=True)
    return mesh


def grid(segments: int, name: str = "Grid", *, smooth: bool = True) -> Any:
    """segments² quads over 2 × 2 units."""
    mesh = bpy.data.meshes.new(name)
    with _shaping(mesh, smooth=smooth) as bm:
        bmesh.ops.create_grid(bm, x_segments=segments, y_segments=segments, size=1.0)
    return mesh


def place(name: str, data: Any, *materials: Any, **properties: Any) -> Any:
    """A new object of the open scene. materials: those that its data gets."""
    for one in materials:
        data.materials.append(one)
    item = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(item)
    for key, value in properties.items():
        setattr(item, key, value)
    return item


def lamp(kind: str, energy: float | None = None, name: str = "Lamp", **settings: Any) -> Any:
    """A new light of the open scene, with these settings of its data or of its object. energy: Blender's if None."""
    data = bpy.data.lights.new(name, kind)
    item = place(name, data)
    for key, value in {"energy": data.energy if energy is None else energy, **settings}.items():
        setattr(data if hasattr(data, key) else item, key, value)
    return item


def world(*color: float) -> Any:
    """Give the open scene a new world, of this colour; its background node."""
    made = bpy.context.scene.world = bpy.data.worlds.new("World")
    with_nodes(made)
    background = node(made.node_tree, "ShaderNodeBackground")
    if color:
        background.inputs["Color"].default_value = (*color, 1)
    return background


def look(size: tuple[int, int], location: tuple[float, ...] = (0, 0, 0), tilt: float = 0.0, **settings: Any) -> Any:
    """Give the open scene a camera and the size of its picture. tilt: from looking down. settings: of its data."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    for key, value in settings.items():
        setattr(data, key, value)
    scene.camera = place("Camera", data, location=location, rotation_euler=(tilt, 0, 0))
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100
    return scene.camera


def material(name: str, **inputs: Any) -> Any:
    """A material with a Principled BSDF whose inputs, underscores for blanks, have these values."""
    new = bpy.data.materials.new(name)
    with_nodes(new)
    shader = node(new.node_tree, "ShaderNodeBsdfPrincipled")
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return new


def with_nodes(block: Any) -> None:
    """Give a material, world or light its node tree; since 5.0 the first two have it from the start."""
    if block.node_tree is None:
        block.use_nodes = True


def node(tree: Any, kind: str) -> Any:
    return next(n for n in tree.nodes if n.bl_idname == kind)


def reopened(path: Path) -> Any:
    """The scene of the open file, saved here and loaded again."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def read(*, uvs: bool = False) -> tuple[Scene, list[str]]:
    """The scene in arrays, and the remarks."""
    notes = Notes()
    scene = extract.extract(bpy.context.evaluated_depsgraph_get(), notes, uvs=uvs)
    return scene, notes.lines()


def world_corners(geometry: Geometry) -> np.ndarray[Any, Any]:
    """The corners of all triangles in the world, (m, 3, 3)."""
    return geometry.vertices[geometry.triangles] + geometry.origin


def normals(corners: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The unit normals of (m, 3, 3) triangles."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)

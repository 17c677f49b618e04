# SPDX-License-Identifier: GPL-3.0-or-later
"""Small Blender data for tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bmesh
import bpy
import numpy as np

from addon.blender.read import extract
from addon.core.base.notes import Notes

if TYPE_CHECKING:
    from addon.core.scene.scene import Geometry, Scene


def triangle(name: str = "Triangle", *, at: float = 0.0, smooth: bool = False) -> Any:
    """A right-angled triangle in z = 0, facing +z."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(at, 0, 0), (at + 1, 0, 0), (at, 1, 0)], [], [(0, 1, 2)])
    mesh.polygons.foreach_set("use_smooth", [smooth])
    return mesh


def ball() -> Any:
    """A smooth open sphere of 0.9 units: its lower half is missing, so that light enters it."""
    bm = bmesh.new()
    bm.loops.layers.uv.new("UVMap")
    bmesh.ops.create_uvsphere(bm, u_segments=48, v_segments=24, radius=0.45, calc_uvs=True)
    bmesh.ops.delete(bm, geom=[v for v in bm.verts if v.co.z < -0.2], context="VERTS")
    mesh = bpy.data.meshes.new("Ball")
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh


def cube(name: str = "Cube", size: float = 2.0, *, smooth: bool = False) -> Any:
    bm = bmesh.new()
    bm.loops.layers.uv.new("UVMap")
    bmesh.ops.create_cube(bm, size=size, calc_uvs=True)
    mesh = bpy.data.meshes.new(name)
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    return mesh


def grid(segments: int, name: str = "Grid", *, smooth: bool = True) -> Any:
    """segments² quads over 2 × 2 units."""
    bm = bmesh.new()
    bmesh.ops.create_grid(bm, x_segments=segments, y_segments=segments, size=1.0)
    mesh = bpy.data.meshes.new(name)
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), smooth))
    return mesh


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

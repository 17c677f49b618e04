# SPDX-License-Identifier: GPL-3.0-or-later
"""Displacement of vertices by materials, when a scene is read."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.rounds import found
from tests.blender.shapes import cube, grid, node, place


def displacing(make: atlas.Maker, method: str = "DISPLACEMENT", name: str = "Displaced") -> Any:
    """A diffuse material with what `make` returns as its displacement."""
    block = atlas.tile_material(name, made("BsdfDiffuse"))
    tree = block.node_tree
    tree.links.new(make(tree), node(tree, "ShaderNodeOutputMaterial").inputs["Displacement"])
    block.displacement_method = method
    return block


def raised(space: str = "OBJECT", height: float = 0.7, scale: float = 2.0) -> atlas.Maker:
    """A displacement by (height - 0.2) * scale along the normal."""
    return made("Displacement", space=space, Height=height, Midlevel=0.2, Scale=scale)


sloped = made("Displacement", Height=made("SeparateXYZ", made("TexCoord", output="Object")), Midlevel=0.0, Scale=0.5)
"""A displacement by half of the object's x coordinate."""


def world_of(read: Any, number: int = 0) -> Any:
    """The vertices of a placement's first instance in the world."""
    placement = read.placements[number]
    matrix = placement.matrices[0]
    return placement.mesh.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.parametrize(("space", "rise"), [("OBJECT", 3.0), ("WORLD", 1.0)])
def test_vertices_move_along_their_normals(space: str, rise: float) -> None:
    mesh = grid(4)
    place("Net", mesh, displacing(raised(space)), location=(100, 0, 5), scale=(1, 1, 3))
    read, notes = found()
    assert not notes
    assert np.allclose(world_of(read)[:, 2], 5 + rise, atol=1e-5)
    assert np.allclose(read.placements[0].mesh.positions[:, :2], [v.co[:2] for v in mesh.vertices], atol=1e-5)


def test_turned_and_mirrored_objects_are_displaced_outwards() -> None:
    for k, turn in enumerate(((0, 0, 0), (1, 0.5, 0.2), (3.1, 0, 0))):
        outer = displacing(raised(scale=0.5), name=f"Outer {k}")
        box = place(f"Box {k}", cube(f"Box {k}", smooth=True), outer, rotation_euler=turn)
        box.scale.x = -1 if k == 1 else 1
    read, notes = found()
    assert not notes
    for placement in read.placements:
        assert np.allclose(np.linalg.norm(placement.mesh.positions, axis=1), np.sqrt(3) + 0.25, atol=1e-5)


def test_normals_follow_the_displaced_surface() -> None:
    place("Net", grid(4, smooth=True), displacing(sloped))
    place("Facets", grid(4, "Flat", smooth=False), bpy.data.materials["Displaced"])
    read = found()[0]
    flat, smooth = (placement.mesh for placement in read.placements)
    assert np.allclose(smooth.positions[:, 2], 0.5 * smooth.positions[:, 0], atol=1e-6)
    assert np.allclose(smooth.normals[smooth.normal_rows], np.array((-0.5, 0, 1)) / np.sqrt(1.25), atol=1e-5)
    assert flat.normals is None


def test_sharp_edges_stay_flat() -> None:
    box = cube("Box", smooth=True)
    box.polygons[0].use_smooth = False
    place("Box", box, displacing(raised(scale=0.2)))
    mesh = found()[0].placements[0].mesh
    corners = mesh.positions[mesh.triangles].astype(float)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    flat = (np.abs(mesh.normals[mesh.normal_rows] - faces[:, None]) < 1e-5).all(axis=(1, 2))
    assert flat.sum() == 2
    outward = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    assert np.allclose(mesh.normals[mesh.normal_rows][~flat], outward[~flat], atol=0.35)


def test_each_vertex_follows_the_material_of_its_first_triangle() -> None:
    mesh = grid(4)
    place("Net", mesh, displacing(raised()), displacing(raised(), "BUMP", "Bumped"))
    mesh.polygons.foreach_set("material_index", [int(i >= 8) for i in range(16)])
    z = found()[0].placements[0].mesh.positions[:, 2]
    assert set(np.unique(z.round(5))) == {0, 1}
    assert (z == 0).sum() == 10


def test_instances_of_a_displaced_mesh_share_it() -> None:
    mesh = grid(4)
    mesh.materials.append(displacing(raised()))
    for k in range(3):
        place(f"Net {k}", mesh, location=(3 * k, 0, 0))
    read = found()[0]
    assert len(read.placements) == 1
    assert len(read.instanced().geometry.meshes) == 1
    assert read.layout("two-level").two_level


@pytest.mark.parametrize("space", ["OBJECT", "WORLD", "TANGENT"])
def test_vectors_move_vertices(space: str) -> None:
    vector = {"space": space, "Midlevel": 0.1, "Scale": 2.0, "Vector": (0.6, 0.3, 0.0, 1)}
    mesh = grid(2)
    place("Net", mesh, displacing(made("VectorDisplacement", **vector)), scale=(2, 2, 2))
    if space == "TANGENT":
        uv = mesh.uv_layers.new(name="Map")
        for loop in mesh.loops:
            uv.uv[loop.index].vector = mesh.vertices[loop.vertex_index].co[:2]
    read, notes = found()
    assert not notes
    moved = read.placements[0].mesh.positions - np.array([v.co for v in mesh.vertices])
    # Tangent, normal and bitangent are x, z and y of this plane.
    offset = {"OBJECT": (1.0, 0.4, -0.2), "WORLD": (0.5, 0.2, -0.1), "TANGENT": (1.0, -0.2, 0.4)}[space]
    assert np.allclose(moved, offset, atol=1e-5)


def test_bump_changes_the_normal_alone() -> None:
    place("Net", grid(4), displacing(sloped, "BUMP"))
    read, notes = found()
    assert not notes
    assert np.allclose(read.placements[0].mesh.positions[:, 2], 0)
    material = next(m for m in read.scene.materials if m.name == "Displaced")
    assert [step["op"] for step in material.program].count("bump") == 1
    assert all(isinstance(closure.normal, int) for closure in material.closures)


def test_both_is_displacement_with_a_note() -> None:
    place("Net", grid(4), displacing(raised(), "BOTH"))
    read, notes = found()
    assert np.allclose(read.placements[0].mesh.positions[:, 2], 1, atol=1e-5)
    assert len(notes) == 1
    assert "Bump by displacement" in notes[0]


def test_absurd_displacements_are_listed() -> None:
    place("Far", grid(4), displacing(raised(scale=3e38), name="Far"))
    broken = grid(4, "Broken")
    broken.vertices[3].co.z = float("nan")
    place("Broken", broken, displacing(raised(), name="Usual"))
    place("Empty", bpy.data.meshes.new("Empty"), bpy.data.materials["Usual"])

    image = bpy.data.images.new("Nothing", 1, 1)
    image.source, image.filepath = "FILE", "/nowhere.png"
    textured = made("Displacement", Height=made("TexImage", image=image), Midlevel=0.0)
    place("Pictured", grid(2), displacing(textured, name="Pictured"))
    read, notes = found()
    assert "Not displaced, vertices that would leave the scene: Far (25)" in notes
    assert any("missing" in line and "Nothing" in line for line in notes)
    geometry = read.flattened().geometry
    assert np.isfinite(geometry.vertices).sum() >= geometry.vertices.size - 3

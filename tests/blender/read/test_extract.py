# SPDX-License-Identifier: GPL-3.0-or-later
"""Extraction of Blender's scenes: triangles, normals, UVs, materials, instances and lights."""

import math
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from tests.blender.shapes import cube, grid, material, normals, read, sphere, triangle, world_corners


def test_an_empty_scene_has_no_triangles() -> None:
    scene, notes = read()
    assert len(scene.geometry.triangles) == 0
    assert scene.lights == ()
    assert notes == []


def test_modifiers_and_parents_are_applied(add: Any) -> None:
    parent = add("Parent", None, location=(5, 0, 0), scale=(2, 2, 2))
    child = add("Child", cube(), parent=parent, location=(1, 0, 0))
    child.modifiers.new("Split", "SUBSURF").levels = 2
    bpy.context.scene.render.use_simplify = False
    geometry = read()[0].geometry
    evaluated = child.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.array([evaluated.matrix_world @ v.co for v in evaluated.data.vertices])
    assert len(geometry.triangles) == 2 * len(evaluated.data.polygons) > 12
    assert np.allclose(geometry.vertices + geometry.origin, points, atol=1e-5)
    assert np.allclose(geometry.origin, (7, 0, 0))


def test_the_frame_is_centred_so_that_far_scenes_keep_their_precision(add: Any) -> None:
    far = 1_048_576.0
    add("A", cube(), location=(far, 0, 0))
    add("B", cube(size=0.001), location=(far + 4, 0, 0))
    geometry = read()[0].geometry
    assert abs(geometry.vertices).max() < 10
    small = world_corners(geometry)[12:]
    assert np.allclose(np.ptp(small.reshape(-1, 3), axis=0), 0.001, rtol=1e-3)


@pytest.mark.parametrize("smooth", [False, True])
def test_mirrored_objects_face_outwards(add: Any, smooth: bool) -> None:
    add("Mirrored", cube(smooth=smooth), scale=(-1, 2, 3), rotation_euler=(0.3, 0.2, 0.1))
    geometry = read()[0].geometry
    corners = world_corners(geometry)
    outward = np.einsum("ij,ij->i", normals(corners), corners.mean(axis=1))
    assert (outward > 0).all()
    if smooth:
        assert geometry.corner_normals is not None
        assert (np.einsum("mci,mci->mc", geometry.corner_normals, corners) > 0).all()
    else:
        assert geometry.corner_normals is None


def test_normals_of_a_stretched_object_are_those_of_its_surface(add: Any) -> None:
    add("Ball", sphere(16), scale=(3, 1, 0.5))
    geometry = read()[0].geometry
    points = world_corners(geometry)
    expected = points / np.array([9.0, 1.0, 0.25])
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    assert geometry.corner_normals is not None
    assert np.allclose(np.linalg.norm(geometry.corner_normals, axis=2), 1, atol=1e-5)
    assert np.einsum("mci,mci->mc", geometry.corner_normals, expected).min() > 0.97


def test_flat_and_smooth_objects_share_one_array_of_normals(add: Any) -> None:
    add("Flat", cube(), rotation_euler=(0.1, 0.2, 0.3))
    add("Smooth", grid(4), location=(9, 0, 0))
    geometry = read()[0].geometry
    flat = normals(world_corners(geometry))[:12]
    assert np.allclose(geometry.corner_normals[:12], flat[:, None], atol=1e-4)
    assert np.allclose(geometry.corner_normals[12:], (0, 0, 1), atol=1e-6)


def test_sharp_edges_give_normals_by_corner(add: Any) -> None:
    mesh = cube(smooth=True)
    for edge in mesh.edges:
        edge.use_edge_sharp = all(mesh.vertices[v].co.z > 0 for v in edge.vertices)
    add("Lid", mesh, scale=(-1, 1, 1))
    geometry = read()[0].geometry
    corners = world_corners(geometry)
    lid = normals(corners)[:, 2] > 0.9
    assert lid.sum() == 2
    assert np.allclose(geometry.corner_normals[lid], (0, 0, 1), atol=1e-5)
    outward = np.einsum("mci,mci->mc", geometry.corner_normals, corners)
    assert (outward > 0.5).all()


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("by_parent", [False, True])
def test_flattened_objects_are_thin_and_keep_their_front(add: Any, smooth: bool, by_parent: bool) -> None:
    """Planes whose own scale across is 0, or that of their parent."""
    item = add("Plane", grid(2, smooth=smooth), scale=(2, 3, 1 if by_parent else 0))
    if by_parent:
        item.parent = add("Parent", None, scale=(0, 1, 1))
        item.rotation_euler = (0, math.pi / 4, 0)
    scene, notes = read()
    assert notes == []
    corners, front = world_corners(scene.geometry), np.array((1, 0, 0) if by_parent else (0, 0, 1))
    assert np.abs(corners @ front).max() < 1e-4
    assert np.ptp(corners[..., 1]) == pytest.approx(6)
    assert np.allclose(normals(corners), front, atol=1e-4)
    if smooth:
        assert scene.geometry.corner_normals is not None
        assert np.allclose(scene.geometry.corner_normals, front, atol=1e-4)


@pytest.mark.parametrize("scale", [(1, 0, 0), (0, 0, 0)])
def test_objects_scaled_to_a_line_or_a_point_are_dropped_and_named(add: Any, scale: tuple[float, float, float]) -> None:
    add("Kept", cube())
    add("Flattened", cube(), scale=scale, location=(1e6, 0, 0))
    scene, notes = read()
    assert len(scene.geometry.triangles) == 12
    assert any("scale 0" in line and "Flattened" in line for line in notes)
    assert np.allclose(scene.geometry.origin, 0)


def test_zero_area_triangles_are_counted_by_object(add: Any) -> None:
    mesh = bpy.data.meshes.new("Line")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [], [(0, 1, 2), (0, 1, 3)])
    add("Line", mesh)
    add("Line 2", mesh, location=(0, 0, 3))
    assert read()[0].geometry.faulty_triangles() == {"Line": 1, "Line 2": 1}


def test_slots_follow_faces_objects_and_instances(add: Any) -> None:
    red, green, blue = (material(name) for name in ("Red", "Green", "Blue"))
    mesh = cube()
    mesh.materials.append(red)
    mesh.materials.append(green)
    mesh.polygons[2].material_index = 1
    add("Plain", mesh)
    other = add("Recoloured", mesh, location=(4, 0, 0))
    other.material_slots[0].link = "OBJECT"
    other.material_slots[0].material = blue
    scene = read()[0]
    names = [scene.materials[i].name for i in scene.geometry.material_index]
    assert names[:12].count("Red") == 10
    assert names[:12].count("Green") == 2
    assert names[12:].count("Blue") == 10
    assert names[12:].count("Green") == 2


def test_objects_without_materials_get_the_default(add: Any) -> None:
    mesh = cube()
    mesh.materials.append(None)
    add("Bare", triangle())
    add("Empty slot", mesh)
    scene = read()[0]
    assert set(scene.geometry.material_index) == {0}
    assert scene.materials[0].name == "(no material)"


def test_curves_text_metaballs_and_surfaces_have_meshes(add: Any) -> None:
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(1)
    spline.bezier_points[1].co = (1, 0, 0)
    add("Curve", curve)
    text = bpy.data.curves.new("Text", "FONT")
    text.body, text.extrude = "H", 0.1
    add("Text", text, location=(0, 3, 0))
    ball = bpy.data.metaballs.new("Meta")
    ball.elements.new().radius = 1
    add("Meta", ball, location=(0, 6, 0))
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(location=(0, 9, 0))
    scene, notes = read()
    names = [name for source in scene.geometry.sources for name in source.names]
    assert sorted(names) == sorted(["Curve", "Text", "Meta", bpy.context.object.name]), "each of them once"
    assert notes == []


def test_meshes_without_vertices_are_left_out(add: Any) -> None:
    """A new mesh, an emptied one, and the second metaball of a family have no attribute of positions."""
    emptied = cube("Emptied")
    emptied.clear_geometry()
    for name, data in (("Box", cube()), ("New", bpy.data.meshes.new("New")), ("Emptied", emptied)):
        add(name, data)
    for name in ("Ball", "Ball.001"):
        ball = bpy.data.metaballs.new(name)
        ball.elements.new().radius = 1
        add(name, ball)
    scene, notes = read()
    names = [name for source in scene.geometry.sources for name in source.names]
    assert sorted(name.partition(".")[0] for name in names) == ["Ball", "Box"]
    assert notes == []


def test_collection_instances_and_vertex_instances(add: Any, scene: Any) -> None:
    collection = bpy.data.collections.new("Parts")
    part = bpy.data.objects.new("Part", triangle())
    part.location = (1, 0, 0)
    collection.objects.link(part)
    for i in range(3):
        holder = add(f"Holder {i}", None, location=(10 * i, 0, 0))
        holder.instance_type, holder.instance_collection = "COLLECTION", collection
    dots = add("Dots", grid(2), location=(0, 50, 0), instance_type="VERTS")
    add("Seed", triangle("Seed"), parent=dots)
    geometry = read()[0].geometry
    corners = world_corners(geometry)
    assert sorted(c[0, 0].round() for c in corners if c[0, 1] < 1) == [1, 11, 21]
    assert sum(c[0, 1] >= 49 - 1e-3 for c in corners) >= 9


def test_geometry_nodes_instances_are_placed(add: Any) -> None:
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    line, box, placed = (tree.nodes.new(f"GeometryNode{kind}") for kind in ("MeshLine", "MeshCube", "InstanceOnPoints"))
    line.inputs["Count"].default_value, line.inputs["Offset"].default_value = 5, (3, 0, 0)
    tree.links.new(line.outputs["Mesh"], placed.inputs["Points"])
    tree.links.new(box.outputs["Mesh"], placed.inputs["Instance"])
    tree.links.new(placed.outputs["Instances"], tree.nodes.new("NodeGroupOutput").inputs[0])
    add("Scatter", triangle()).modifiers.new("Nodes", "NODES").node_group = tree
    geometry = read()[0].geometry
    assert len(geometry.triangles) == 5 * 12
    centres = world_corners(geometry).reshape(5, -1, 3).mean(axis=1)
    assert np.allclose(sorted(centres[:, 0]), [0, 3, 6, 9, 12], atol=0.2)


def test_particles_are_placed(add: Any, scene: Any) -> None:
    seed = add("Seed", triangle("Seed"), hide_render=True)
    emitter = add("Emitter", grid(4))
    settings = emitter.modifiers.new("Dust", "PARTICLE_SYSTEM").particle_system.settings
    settings.count, settings.frame_start, settings.frame_end = 20, 1, 1
    settings.render_type, settings.instance_object = "OBJECT", seed
    scene.frame_set(5)
    scene.frame_set(6)
    sources = read()[0].geometry.sources
    assert sum(len(s.names) * s.count for s in sources if s.names[0] == "Seed") >= 20


def test_hidden_objects_are_left_out(add: Any) -> None:
    """The viewport's depsgraph obeys its own switch; `hide_render` is tested through a render."""
    add("Shown", triangle())
    add("Hidden", triangle("Hidden")).hide_viewport = True
    assert [s.names for s in read()[0].geometry.sources] == [("Shown",)]


def test_ray_visibility_makes_a_material_of_its_own(add: Any, scene: Any) -> None:
    mesh, lamp = cube(), bpy.data.lights.new("Lamp", "POINT")
    mesh.materials.append(material("Red"))
    hidden = add("Hidden", mesh, location=(3, 0, 0))
    hidden.visible_glossy = hidden.visible_shadow = False
    add("Plain", mesh)
    add("Bare", cube(), location=(6, 0, 0)).visible_camera = False
    add("Lamp", lamp).visible_diffuse = False
    found, notes = read()
    assert notes == []
    kinds = {(m.name, m.hidden_from) for m in found.materials[1:]}
    assert kinds == {("Red", ()), ("Red", ("shadow", "glossy")), ("(no material)", ("camera",))}
    assert [light.hidden_from for light in found.lights] == [("camera", "diffuse")]
    assert found.world.hidden_from == ()
    empty = bpy.data.objects.new("Instancer", None)
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("Inside", mesh))
    empty.instance_type, empty.instance_collection, empty.visible_diffuse = "COLLECTION", group, False
    scene.collection.objects.link(empty)
    assert ("Red", ("diffuse",)) in {(m.name, m.hidden_from) for m in read()[0].materials}


def test_uvs_are_read_on_request_and_follow_the_winding(add: Any) -> None:
    add("Box", cube())
    add("Mirrored", cube("Other"), scale=(-1, 1, 1), location=(5, 0, 0))
    assert read()[0].geometry.uvs is None
    geometry = read(uvs=True)[0].geometry
    assert geometry.uvs is not None
    mesh = bpy.data.meshes["Cube"]
    expected = {
        tuple(np.round((*mesh.vertices[c.vertex_index].co, *mesh.uv_layers[0].uv[c.index].vector), 4))
        for c in mesh.loops
    }
    for corners, uv, flip in (
        (world_corners(geometry)[:12], geometry.uvs[:12], 1),
        (world_corners(geometry)[12:] - (5, 0, 0), geometry.uvs[12:], -1),
    ):
        found = np.concatenate([corners * (flip, 1, 1), uv], axis=2).reshape(-1, 5)
        assert {tuple(np.round(row, 4) + 0.0) for row in found} == {tuple(np.array(e) + 0.0) for e in expected}


def test_lights_move_into_the_frame(add: Any) -> None:
    add("Far", cube(), location=(100, 0, 0))
    place = Matrix.LocRotScale((103, 0, 2), Euler((0.4, 0.5, 0.6)), (2, 2, 2))
    add("Lamp", bpy.data.lights.new("Lamp", "POINT"), matrix_world=place)
    bpy.context.view_layer.update()
    light = read()[0].lights[0]
    assert np.allclose(light.to_world[:3, 3], (3, 0, 2), atol=1e-5)
    assert np.allclose(light.to_world[:3, :3] @ light.to_world[:3, :3].T, np.eye(3), atol=1e-6)


@pytest.mark.parametrize("finer", [False, True])
def test_a_mesh_in_edit_mode_is_read_as_it_is_seen(add: Any, scene: Any, finer: bool) -> None:
    item = add("Cube", cube())
    if finer:
        item.modifiers.new("Finer", "SUBSURF").levels = 1
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        found, _ = read()
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    assert len(found.geometry.triangles) == (48 if finer else 12)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Instanced scenes have the same triangles, normals and pictures as flattened ones."""

from pathlib import Path
from typing import Any

import bpy
import halfspace_native as native
import numpy as np
import pytest

from addon.blender.read import extract
from addon.blender.render import engine
from addon.core.base.equality import same
from addon.core.base.notes import Notes
from addon.core.structures.trees import Trees
from tests.blender import atlas
from tests.blender.exr_files import render
from tests.blender.shapes import cube, grid, lamp, look, material, node, world


@pytest.fixture
def forest(add: Any, scene: Any) -> Any:
    """Instances of three meshes: rotated, mirrored, unevenly scaled, far away, some with materials of their own."""
    scene.render.engine, scene.halfspace.samples = engine.ENGINE, 2
    shapes = [cube("Block", smooth=False), grid(6, "Leaf", smooth=True), cube("Ball", smooth=True)]
    colours = [material(f"Colour {i}", Base_Color=(0.2 + 0.3 * i, 0.5, 0.3, 1)) for i in range(3)]
    for mesh in shapes:
        mesh.materials.append(colours[0])
    rng = np.random.default_rng(3)
    for i in range(20):
        item = add(f"Item {i}", shapes[i % 3], location=rng.uniform(-3, 3, 3) + np.array((1000, 0, 0)))
        item.rotation_euler = rng.uniform(-3, 3, 3)
        item.scale = ((1, 1, 1), (-0.6, 0.6, 0.6), (0.3, 1.0, 0.5), (0.2, 0.2, 0.2))[i % 4]
        if i % 5 == 0:
            item.material_slots[0].link = "OBJECT"
            item.material_slots[0].material = colours[1 + i % 2]
    lamp("SUN", rotation_euler=(0.5, 0.3, 0))
    look((48, 32), (1000, -9, 0), np.pi / 2)
    world(0.3, 0.4, 0.5)
    return scene


def find() -> extract.Found:
    return extract.find(bpy.context.evaluated_depsgraph_get(), Notes())


def test_instances_flatten_to_the_same_bits(forest: Any) -> None:
    found = find()
    flat, kept = found.flattened().geometry, found.instanced().geometry
    assert len(kept.meshes) == 3
    assert kept.count == flat.count
    structures = [native.build(mesh.vertices, mesh.triangles) for mesh in kept.meshes]
    placed = native.build_instances(structures, kept.mesh, kept.matrices)
    vertices, triangles = placed.flattened()
    assert np.array_equal(vertices.view(np.uint32), flat.vertices.view(np.uint32))
    assert np.array_equal(triangles, flat.triangles)
    assert np.array_equal(kept.origin, flat.origin)


def test_the_picture_is_the_same_in_two_levels(forest: Any, tmp_path: Path) -> None:
    forest.view_layers[0].use_pass_normal = True
    pictures = {}
    for mode in ("flatten", "two-level", "auto"):
        forest.halfspace.instancing = mode
        pictures[mode] = render(forest, tmp_path)
        report = atlas.report(forest)
        expected = "two levels" if mode == "two-level" else "instances: flattened"
        assert report.instances.startswith(expected)
        assert not any("instances" in line or "two levels" in line for line in report.left_out), "nothing is left out"
    flat = pictures["flatten"]
    assert flat["Combined.R"].std() > 0.01
    for mode in ("two-level", "auto"):
        for name, channel in flat.items():
            assert np.array_equal(channel, pictures[mode][name]), (mode, name)


READ = {
    "uv map": lambda tree: atlas.add(tree, "UVMap", uv_map="UVMap").outputs[0],
    "colour": lambda tree: atlas.add(tree, "Attribute", attribute_name="wear").outputs["Color"],
    "tangents": lambda tree: atlas.add(tree, "Tangent", direction_type="UV_MAP", uv_map="UVMap").outputs[0],
    "normal map": lambda tree: atlas.add(tree, "NormalMap", Color=(0.7, 0.3, 0.9, 1)).outputs[0],
    "object's number": lambda tree: atlas.add(tree, "ObjectInfo").outputs["Random"],
    "object's colour": lambda tree: atlas.add(tree, "ObjectInfo").outputs["Color"],
    "place": lambda tree: atlas.add(tree, "ObjectInfo").outputs["Location"],
    "box": lambda tree: atlas.add(tree, "TexCoord").outputs["Generated"],
    "object space": lambda tree: atlas.add(tree, "TexCoord").outputs["Object"],
    "normal in object space": lambda tree: atlas.add(tree, "TexCoord").outputs["Normal"],
    "pointiness": lambda tree: atlas.add(tree, "NewGeometry").outputs["Pointiness"],
    "island": lambda tree: atlas.add(tree, "NewGeometry").outputs["Random Per Island"],
    "near": lambda tree: atlas.add(tree, "AmbientOcclusion", only_local=True).outputs["Color"],
}
"""Nodes whose values differ between the triangles of a mesh or between its instances."""


@pytest.mark.parametrize("what", READ)
def test_inputs_of_materials_are_the_same_in_two_levels(forest: Any, tmp_path: Path, what: str) -> None:
    # Let every material show the value, with an attribute that only one mesh has.
    random = np.random.default_rng(1)
    mesh = forest.objects["Item 0"].data
    wear = mesh.color_attributes.new("wear", "FLOAT_COLOR", "CORNER")
    wear.data.foreach_set("color", random.random(4 * len(mesh.loops), np.float32))
    for item in forest.objects:
        item.color = (*random.random(3), 1)
    for shown in bpy.data.materials:
        shader = node(shown.node_tree, "ShaderNodeBsdfPrincipled")
        shown.node_tree.links.new(READ[what](shown.node_tree), shader.inputs["Base Color"])
        if what == "normal map":
            shown.node_tree.links.new(shader.inputs["Base Color"].links[0].from_socket, shader.inputs["Normal"])
    compared_in_both(forest, tmp_path)


def test_uvs_and_motion_are_the_same_in_two_levels(forest: Any, tmp_path: Path) -> None:
    layer = forest.view_layers[0]
    layer.use_pass_uv = layer.use_pass_vector = True
    # Move some objects, one of them out of the picture before this frame, and one that changes its triangles.
    for i in range(0, 20, 3):
        item = forest.objects[f"Item {i}"]
        for frame, by in ((0, -0.2), (2, 0.3)):
            item.location.x += by
            item.rotation_euler.y += by
            item.keyframe_insert("location", frame=frame)
            item.keyframe_insert("rotation_euler", frame=frame)
    turned = forest.objects["Item 2"].modifiers.new("Cut", "SUBSURF")
    for frame, levels in ((0, 1), (1, 2)):
        turned.render_levels = levels
        turned.keyframe_insert("render_levels", frame=frame)
    forest.frame_set(1)
    flat = compared_in_both(forest, tmp_path)
    assert {name for name in flat if "Vector" in name or "UV" in name} >= {"UV.U", "UV.V", "Vector.X", "Vector.W"}
    assert np.ptp(flat["Vector.X"]) > 1
    assert np.ptp(flat["UV.U"]) > 0.5


def compared_in_both(scene: Any, folder: Path) -> dict[str, Any]:
    """The channels of the picture, which are equal bit for bit whether instances are flattened or kept."""
    pictures = {}
    for mode, expected in (("flatten", "instances: flattened"), ("two-level", "two levels")):
        scene.halfspace.instancing = mode
        pictures[mode] = render(scene, folder)
        assert atlas.report(scene).instances.startswith(expected)
    flat = pictures["flatten"]
    assert flat["Combined.R"].std() > 0.01
    assert flat.keys() == pictures["two-level"].keys()
    for name, channel in flat.items():
        assert np.array_equal(channel, pictures["two-level"][name], equal_nan=True), name
    return flat


def test_an_object_that_the_tree_over_instances_drops_is_named(forest: Any, add: Any, tmp_path: Path) -> None:
    add("Speck", forest.objects["Item 0"].data, scale=(1e-30, 1e-30, 1e-30))
    forest.halfspace.instancing = "two-level"
    render(forest, tmp_path)
    report = atlas.report(forest)
    assert "Dropped, the transform is out of range: Speck" in report.warnings


def glow() -> None:
    """Make all meshes emit light."""
    shaders = [
        shader
        for block in bpy.data.materials
        for shader in block.node_tree.nodes
        if "Emission Strength" in shader.inputs
    ]
    assert shaders
    for shader in shaders:
        shader.inputs["Emission Strength"].default_value = 3.0


def test_emissive_instances_are_sampled_as_lights(forest: Any, tmp_path: Path) -> None:
    glow()
    pictures = {}
    for mode in ("flatten", "two-level"):
        forest.halfspace.instancing, forest.halfspace.top = mode, "grid"
        pictures[mode] = render(forest, tmp_path)["Combined.R"]
    # The same random numbers find the same points of the same lights.
    assert np.array_equal(pictures["flatten"], pictures["two-level"])
    report = atlas.report(forest)
    assert report.instances.startswith("two levels")
    assert report.statistics["top"] == "grid"
    assert not any(line.startswith("shadow rays") for line in report.left_out)


def test_emissive_meshes_light_whitted_s_pictures_in_any_mode(forest: Any, tmp_path: Path) -> None:
    glow()
    forest.halfspace.integrator = "whitted"
    pictures = {}
    for mode in ("flatten", "two-level"):
        forest.halfspace.instancing = mode
        pictures[mode] = render(forest, tmp_path)["Combined.R"]
        report = atlas.report(forest)
        assert report.instances.startswith("instances: flattened, since Whitted's integrator")
    assert np.array_equal(pictures["flatten"], pictures["two-level"])


def test_frames_build_only_what_changed(forest: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = []

    def of(self: Trees, *parts: Any) -> Any:
        found, count = known(self, *parts)
        built.append(count)
        return found, count

    known = Trees.of
    monkeypatch.setattr(Trees, "of", of)
    forest.halfspace.instancing = "two-level"
    forest.render.use_persistent_data = True
    render(forest, tmp_path)
    forest.objects["Item 4"].location.x += 1
    moved = render(forest, tmp_path)
    bpy.data.meshes["Leaf"].vertices[3].co.z += 0.5
    bpy.data.meshes["Leaf"].update()
    edited = render(forest, tmp_path)
    assert built == [2, 0, 1]  # both cubes have one shape
    forest.render.use_persistent_data = False
    fresh = render(forest, tmp_path)
    assert not engine._kept
    for name, channel in fresh.items():
        assert np.array_equal(channel, edited[name]), name
    assert any(not np.array_equal(channel, moved[name]) for name, channel in fresh.items())


def test_a_scene_without_objects_renders_its_background(forest: Any, tmp_path: Path) -> None:
    for item in list(forest.objects):
        if item.type == "MESH":
            bpy.data.objects.remove(item)
    forest.halfspace.instancing = "two-level"
    assert np.ptp(render(forest, tmp_path)["Combined.R"]) == 0


@pytest.mark.parametrize("reads", ["Location", "Random", ""])
def test_repeated_instances_are_read_as_each_alone(add: Any, monkeypatch: pytest.MonkeyPatch, reads: str) -> None:
    """On faces of several sizes, of which two have none."""
    faces = grid(4, "Faces")
    for vertex in faces.polygons[5].vertices:
        faces.vertices[vertex].co = (0.3, 0.2, 0.1)
    instancer = add("Instancer", faces)
    instancer.instance_type, instancer.use_instance_faces_scale = "FACES", True
    shown = material("Shown")
    if reads:
        info, shader = (
            shown.node_tree.nodes.new("ShaderNodeObjectInfo"),
            node(shown.node_tree, "ShaderNodeBsdfPrincipled"),
        )
        shown.node_tree.links.new(info.outputs[reads], shader.inputs["Base Color"])
    for number, name in enumerate(("Leaf", "Blade")):
        item = add(name, cube(name, 0.2 + number, smooth=bool(number)))
        item.parent = instancer
        item.data.materials.append(shown)

    def read() -> tuple[extract.Found, list[str]]:
        notes = Notes()
        return extract.find(bpy.context.evaluated_depsgraph_get(), notes), notes.lines()

    found, said = read()
    places = iter(range(1000))
    monkeypatch.setattr(extract, "_repetition", lambda *_: (0, 0, next(places)))
    alone, expected = read()
    assert (said, len(said)) == (expected, 1)
    assert "scale 0" in said[0]
    assert sum(len(placement.names) for placement in found.placements) > 2
    for here, there in zip(found.placements, alone.placements, strict=True):
        assert (here.names, here.keys, here.values) == (there.names, there.keys, there.values)
        assert same((here.mesh, here.materials, here.matrices), (there.mesh, there.materials, there.matrices))

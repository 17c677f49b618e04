# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials read attributes of every kind that a mesh stores, and what they cannot read is said."""

import tracemalloc
from typing import Any

import bpy
import halfspace_native
import numpy as np
import pytest

from addon.blender.read import extract, layers, meshes
from addon.blender.read.layers import read_layers
from addon.blender.read.value_nodes import ISLAND
from addon.blender.read.vertex_layers import lowest_neighbours
from addon.core.base.notes import Notes
from addon.core.base.steps import completed
from addon.core.scene.scene import SceneError
from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.shapes import cube, material, node, place, read, sphere

KEY = ("tangent", "UVMap")


@pytest.fixture
def box(add: Any) -> Any:
    """The mesh of a cube whose paint is the attribute "wear"."""
    source = made("Attribute", attribute_name="wear", output="Color")
    paint = atlas.tile_material("Paint", made("BsdfPrincipled", Base_Color=source))
    mesh = cube()
    mesh.materials.append(paint)
    add("Box", mesh)
    return mesh


@pytest.mark.parametrize("kind", ["FLOAT", "INT", "INT8", "BOOLEAN"])
@pytest.mark.parametrize("domain", ["POINT", "FACE", "CORNER"])
def test_numbers_of_every_type_are_read(box: Any, kind: str, domain: str) -> None:
    wear = box.attributes.new("wear", kind, domain)
    for i, item in enumerate(wear.data):
        item.value = i % 2 if kind == "BOOLEAN" else 100 - 7 * i  # negative numbers too
    found, notes = read()
    assert notes == []
    (layer,) = found.geometry.layers
    stored = [float(item.value) for item in wear.data]
    if domain == "FACE":
        assert layer.reshape(6, -1).tolist() == [[value] * 18 for value in stored], "two triangles to a face"
    else:
        assert set(np.unique(layer)) == set(stored)
    assert (layer == layer[..., :1]).all(), "grey"


@pytest.mark.parametrize(
    ("kind", "domain", "reason"), [("QUATERNION", "POINT", "type quaternion"), ("FLOAT", "EDGE", "domain edge")]
)
def test_notes_an_attribute_that_cannot_be_read(box: Any, kind: str, domain: str, reason: str) -> None:
    box.attributes.new("wear", kind, domain)
    assert read()[1] == [f"The attribute 'wear' is black, its {reason} is not supported yet: Box"]


def test_notes_an_attribute_that_no_mesh_has(box: Any, add: Any) -> None:
    assert read()[1] == ["No mesh has the attribute 'wear', it is 0 everywhere, in material: Paint"]
    other = cube("Other")
    other.attributes.new("wear", "FLOAT", "POINT")
    add("Other", other, location=(5, 0, 0))
    assert read()[1] == []


def test_does_not_miss_the_attributes_of_an_unused_material(scene: Any, add: Any) -> None:
    paint = material("Unused")
    place("Bare", cube(), paint)
    tree = paint.node_tree
    source = atlas.add(tree, "UVMap", uv_map="nowhere")
    assert read()[1] == []
    checker = made("TexChecker", source.outputs[0])(tree)
    tree.links.new(checker, node(tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"])
    assert read()[1] == ["No mesh has the UV map 'nowhere', it is 0 everywhere, in material: Unused"]


def test_more_attributes_than_fit_over_the_whole_scene_are_refused_before_any_is_copied(
    box: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    box.attributes.new("wear", "FLOAT_COLOR", "CORNER")
    monkeypatch.setattr(layers, "read_layers", lambda *_: pytest.fail("they were copied"))
    # The triangles and their corners alone would have room: 12 triangles of 8 vertices, flat.
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: 12 * 8 + 16 * 12)
    with pytest.raises(SceneError, match=r"12 triangles, .* does not fit; use fewer different attributes in materials"):
        read()


def test_attributes_are_counted_over_all_places_only_if_these_are_flattened(
    box: Any, add: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    box.attributes.new("wear", "FLOAT_COLOR", "CORNER")
    for i in range(9):
        add(f"Box {i}", box)
    other = cube("Other")
    other.attributes.new("wear", "FLOAT_COLOR", "CORNER")
    add("Other", other)
    # Room for a mesh's own layer next to that of five cubes, each of 12 triangles.
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: 12 * 4 * 12 * (1 + 5))
    with pytest.raises(SceneError, match=r"132 triangles, .* do not fit"):
        read()
    found = extract.find(bpy.context.evaluated_depsgraph_get(), Notes()).instanced().geometry
    (layer,) = (one for one in found.layers if one is not None)
    assert len(layer) == 24


@pytest.mark.parametrize("kind", ["FLOAT", "FLOAT2", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR", "INT"])
def test_layers_are_counted_as_they_are_read(box: Any, kind: str) -> None:
    box.attributes.new("wear", kind, "CORNER")
    keys = [("color", "wear"), ("color", "none"), ("uv", ""), ("uv", "none"), ("tangent", "UVMap")]
    found = completed(layers.read_layers(box, keys))
    assert layers.widths(box, keys) == {key: layer.shape[2] for key, layer in found.items()}
    assert len(found) == 3


@pytest.mark.parametrize(
    ("most", "free", "advice"),
    [
        (1 << 29, 12 * 8 + 16 * 12, "use fewer different attributes in materials"),
        (1 << 29, 12 * 8 + 16 * 12 - 1, "use fewer triangles"),
        (11, 1 << 40, "use fewer triangles"),
    ],
)
def test_the_advice_is_about_what_does_not_fit(
    box: Any, monkeypatch: pytest.MonkeyPatch, most: int, free: int, advice: str
) -> None:
    keys = [("uv", "")]
    placement = meshes.Placement(
        completed(meshes.read_mesh(box, layers=keys)), np.zeros(1, np.int32), ["Box"], np.eye(4)[None]
    )
    monkeypatch.setattr(meshes, "MOST_TRIANGLES", most)
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: free)
    with pytest.raises(SceneError, match=f"12 triangles, .* do not fit; {advice}$"):
        meshes.assemble([placement], layers=keys)
    twice = meshes.Placement(placement.mesh, placement.materials, ["Box"] * 2, np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(SceneError, match=r"24 triangles, .* do not fit; keep the instances in two levels$"):
        meshes.assemble([twice], layers=keys)


def test_tangents_stay_in_the_space_of_their_mesh_within_the_memory_that_is_counted() -> None:
    triangles, places = 1000, 40
    random = np.random.default_rng(4)
    tangents = random.standard_normal((triangles, 3, 4)).astype(np.float32)
    mesh = meshes.MeshArrays(
        np.zeros((3, 3), np.float32), np.zeros((triangles, 3), np.int32), None, None, None, None, {KEY: tangents}
    )
    matrices = np.tile(np.eye(4), (places, 1, 1))
    matrices[:, :3, :3] = random.standard_normal((places, 3, 3))
    tracemalloc.start()
    try:
        (layer,) = layers.assemble_layers([(mesh, np.linalg.det(matrices[:, :3, :3]) < 0)], [KEY])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2 * layer.nbytes
    # The corners of mirrored places are in the order of their triangles.
    mirrored = np.linalg.det(matrices[:, :3, :3]) < 0
    assert mirrored.any()
    assert not mirrored.all()
    found = layer.reshape(places, triangles, 3, 4)
    assert (found[~mirrored] == tangents).all()
    assert (found[mirrored] == tangents[:, [0, 2, 1]]).all()


def test_meshes_without_a_map_have_the_tangents_of_their_longitudes() -> None:
    mesh = sphere(32)
    keys = [("tangent", ""), ("tangent", "UVMap")]
    found = completed(layers.read_layers(mesh, keys))
    assert layers.widths(mesh, keys) == {("tangent", ""): 4}
    assert list(found) == [("tangent", "")]
    # East along the equator, also where the longitudes end, and the bitangent to the north.
    arrays = completed(meshes.read_mesh(mesh))
    places = arrays.positions[arrays.triangles].reshape(-1, 3)
    tangents = found["tangent", ""].reshape(-1, 4)
    equator = np.abs(places[:, 2]) < 0.3
    east = np.stack([-places[:, 1], places[:, 0]], axis=1)[equator]
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    assert ((tangents[equator, :2] * east).sum(axis=1) > 0.99).all()
    assert (tangents[equator, 3] == 1).all()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
def test_a_custom_normal_that_is_not_finite_is_that_of_its_faces(domain: str, value: float) -> None:
    if bpy.app.version < (5, 0):
        pytest.skip("this Blender has no custom normals of this type")
    mesh = sphere(32)
    normals = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", domain)
    values = np.tile(np.float32([0, 0, 1]), (len(normals.data), 1))
    values[7, 1] = value
    normals.data.foreach_set("vector", values.ravel())
    found = completed(meshes.read_mesh(mesh))
    assert found.lost == 1
    assert found.normals is not None
    assert found.normal_rows is not None
    assert np.isfinite(found.normals).all()
    others = np.delete(found.normals, 7, axis=0)
    assert np.allclose(others, [0, 0, 1], atol=1e-3)
    # That of the sphere there, not straight up.
    triangle, corner = np.argwhere(found.normal_rows == 7)[0]
    outward = found.positions[found.triangles[triangle, corner]]
    assert found.normals[7] @ outward > 0.98


def test_islands_are_the_connected_parts_of_a_mesh() -> None:
    chain = np.stack([np.arange(999), np.arange(1, 1000)], axis=1)[::-1]
    edges = np.concatenate([chain, [[1001, 1003], [1003, 1002], [1006, 1005]]])
    found = lowest_neighbours(1007, edges)
    assert (found[:1000] == 0).all()
    assert found[1000:].tolist() == [1000, 1001, 1001, 1001, 1004, 1005, 1005]
    assert lowest_neighbours(0, np.zeros((0, 2), np.int32)).tolist() == []


def test_each_island_has_a_random_number() -> None:
    mesh = bpy.data.meshes.new("Two")
    mesh.from_pydata([(x, y, 0) for x in (0, 1, 2, 3) for y in (0, 1)], [], [(0, 1, 3, 2), (4, 5, 7, 6)])
    found = completed(read_layers(mesh, [(ISLAND, "")]))[ISLAND, ""]
    assert found.shape == (4, 3, 3)
    numbers = np.unique(found)
    assert len(numbers) == 2
    assert 0 <= numbers[0] < numbers[1] <= 1

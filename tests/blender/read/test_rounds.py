# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, particle hair and point clouds become triangles when a scene is read."""

import math
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read.strands import collecting
from addon.blender.read.value_nodes import COLOR, STRAND, UV
from addon.core.scene import tubes
from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.rounds import camera, cloud, found, fur, hair, locks, pointed
from tests.blender.shapes import cube, grid, material


@pytest.fixture(autouse=True)
def view(scene: Any) -> None:
    camera(scene)


def reading(*sockets: tuple[str, str], **settings: Any) -> Any:
    """A material that adds these outputs of nodes, by the type of node and the output's name."""
    total = None
    for kind, name in sockets:
        own = settings if kind == "Attribute" else {}
        total = made("VectorMath", made(kind, output=name, **own), total)
    return atlas.tile_material("Reader", made("Emission", Color=total))


def test_hair_curves_are_tubes_of_their_material(add: Any) -> None:
    curves = hair(locks(7))
    curves.materials.append(material("Brown"))
    add("Curls", curves, location=(1, 2, 3))
    read, notes = found()
    geometry = read.flattened().geometry
    assert not notes
    assert len(read.made) == 1
    assert f"7 hairs as {geometry.count:,} triangles" in read.made[0]
    assert geometry.count >= 7 * 4 * 2 * tubes.FEWEST_SIDES
    assert {read.scene.materials[i].name for i in geometry.material_index} == {"Brown"}
    corners = geometry.vertices + geometry.origin
    ends = locks(7)[:, [0, -1]].reshape(-1, 3) + np.array((1, 2, 3))
    nearest = np.linalg.norm(corners[:, None] - ends, axis=2).min(axis=0)
    assert np.allclose(nearest, 0.02, rtol=0.22), "the last polygons surround the ends of the curves"


def test_straight_curves_stay_straight(add: Any) -> None:
    points = [[(0, 0, 0), (1, 1, 0), (2, 0, 0)]]
    chains = hair(points)
    chains.set_types(type="POLY")
    add("Chain", chains)
    add("Spline", hair(points, name="Spline"), location=(0, 3, 0))
    read = found()[0]
    assert "1 to a segment" in read.made[0]
    assert "1 to a segment" not in read.made[1]


def test_particle_hair_has_parents_or_children_and_their_radii(add: Any, scene: Any) -> None:
    item = add("Head", grid(2))
    item.data.materials.append(material("Skin"))
    item.data.materials.append(material("Fur"))
    particles = fur(item, 10, hair_length=0.5, root_radius=1.0, tip_radius=0.5, radius_scale=0.1, material=2)
    particles.use_close_tip = True
    read = found()[0]
    assert "Head: 10 hairs" in read.made[0]
    strands = read.placements[-1]
    assert read.scene.materials[strands.materials[0]].name == "Fur"
    root = strands.mesh.positions[strands.mesh.positions[:, 2] == 0]
    assert np.allclose(strands.mesh.positions[:, 2].max(), 0.5, atol=0.02)
    # Each root's polygon has the radius 1 * 0.1 / 2, widened to the breadth of a circle.
    centres = root.reshape(10, -1, 3).mean(axis=1)
    radii = np.linalg.norm(root.reshape(10, -1, 3) - centres[:, None], axis=2)
    half = math.pi / radii.shape[1]
    assert np.allclose(radii, 0.05 * half / math.sin(half), rtol=0.01)
    tips = strands.mesh.positions[strands.mesh.positions[:, 2] > 0.499]
    assert len(np.unique(tips.round(4), axis=0)) <= 10, "closed tips are points"
    particles.child_type, particles.rendered_child_count, particles.child_percent = "SIMPLE", 5, 3
    assert "Head: 30 hairs" in found()[0].made[0], "children replace their parents; views show fewer than pictures"


def test_hair_of_hidden_emitters_is_rendered(add: Any) -> None:
    item = add("Head", grid(2))
    fur(item, 10)
    item.show_instancer_for_viewport = False
    read = found()[0]
    assert [placement.names for placement in read.placements] == [["Head"]]
    assert read.made
    item.particle_systems[0].settings.render_type = "NONE"
    assert not found()[0].made


def test_view_layers_can_leave_hair_out(add: Any, scene: Any) -> None:
    add("Curls", hair(locks(3)))
    fur(add("Head", grid(2)), 5)
    assert len(found()[0].made) == 2
    scene.view_layers[0].use_strand = False
    assert not found()[0].made


def test_points_are_spheres_or_instances_of_one(add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    centres, radii = rng.uniform(-2, 2, (50, 3)), rng.uniform(0.02, 0.2, 50)
    item = add("Dust", cloud(centres, radii), location=(1, 0, 0))
    read = found()[0]
    (merged,) = read.placements
    assert len(merged.names) == 1
    assert "50 points" in read.made[0]
    monkeypatch.setattr(collecting, "MERGED", 10)
    (many,) = found()[0].placements
    assert len(many.names) == 50
    assert set(many.names) == {item.name}
    one = many.mesh.positions.astype(float)
    placed = np.einsum("kij,nj->kni", many.matrices[:, :3, :3], one) + many.matrices[:, None, :3, 3]
    assert np.allclose(placed.reshape(-1, 3), merged.mesh.positions + np.array((1, 0, 0)), atol=1e-5)
    assert many.mesh.box == merged.mesh.box


def test_an_instance_of_a_point_has_its_values_in_the_space_of_its_object(
    add: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    dust, other = cloud([(0, 0, 0), (1, 0, 0)], [0.1, 0.2]), cloud([(5, 0, 0)], name="Other")
    shade = dust.attributes.new("shade", "FLOAT_VECTOR", "POINT")
    shade.data.foreach_set("vector", np.float32([1, 2, 3, 4, np.nan, 6]))
    sockets = ("Attribute", "Color"), ("ObjectInfo", "Location"), ("PointInfo", "Radius")
    reader = reading(*sockets, attribute_name="shade")
    for data in (dust, other):
        data.materials.append(reader)
    for number in range(2):
        add(f"Dust {number}", dust, location=(0, number, 0), rotation_euler=(0, 0, 1))
    add("Other", other, location=(0, 5, 0))
    origin = np.zeros(3)
    whole = found()[0].flattened(origin=origin).geometry.objects
    monkeypatch.setattr(collecting, "MERGED", 0)
    read, notes = found()
    assert not notes
    for geometry in (read.flattened(origin=origin).geometry, read.instanced(origin=origin).geometry):
        assert [one.to_object for one in geometry.objects] == [whole[i].to_object for i in (0, 0, 1, 1, 2)]
        assert [one.generated for one in geometry.objects] == [whole[i].generated for i in (0, 0, 1, 1, 2)]
        for one, place, radius, colour in (
            (geometry.objects[0], 0, 0.1, (1, 2, 3, 1)),
            (geometry.objects[3], 1, 0.2, (4, 0, 6, 1)),
            (geometry.objects[4], 5, 0.1, None),
        ):
            values = [value for value in one.values if any(value[:3])]
            assert len(values) == (place > 0) + 1 + (colour is not None)
            assert (0.0, place, 0.0, 1.0) in values or not place
            assert any(np.allclose(value, (radius, radius, radius, 1)) for value in values)
            assert colour is None or colour in values
    used = [read.scene.materials[placement.materials[0]] for placement in read.placements]
    layers = [sum(step["op"] == "attribute" for step in one.program) for one in used]
    assert layers == [0, 1], "the other cloud lacks the attribute, which is 0 there"


def test_points_of_geometry_nodes_are_spheres(add: Any) -> None:
    pointed(add("Net", grid(3), location=(0, 2, 0)), 0.1)
    read, notes = found()
    assert not notes
    assert "Net: 16 points" in read.made[0]
    (only,) = read.placements
    assert np.allclose(np.abs(only.mesh.positions).max(axis=0), (1.1, 1.1, 0.1), atol=0.02)
    assert only.matrices[0, 1, 3] == 2


def test_instances_share_one_mesh(add: Any, scene: Any) -> None:
    curves = hair(locks(5))
    for i in range(3):
        add(f"Curls {i}", curves, location=(6 * i, 0, 0), scale=(1, 1, -1))
    read = found()[0]
    (only,) = read.placements
    assert only.names == ["Curls 0", "Curls 1", "Curls 2"]
    assert read.instanced().geometry.size * 3 == read.flattened().geometry.count


def test_detail_grows_towards_the_camera(add: Any, scene: Any) -> None:
    add("Curls", hair(locks(1), 0.2))
    near = len(found()[0].placements[0].mesh.triangles)
    scene.camera.location.z = 1000
    far = len(found()[0].placements[0].mesh.triangles)
    scene.camera = None
    assert far < near
    assert len(found()[0].placements[0].mesh.triangles) > far, "without a camera by the size of the object"


def test_values_of_strands_reach_materials(add: Any) -> None:
    names = ("Is Strand", "Intercept", "Length", "Thickness", "Random")
    reader = reading(*(("HairInfo", name) for name in names))
    curves = hair([[(0, 0, 0), (1, 0, 0), (3, 0, 0)]] * 2, [[0.1, 0.2, 0.3]] * 2)
    curves.materials.append(reader)
    add("Curls", curves)
    add("Box", cube()).data.materials.append(reader)
    read, notes = found()
    assert not notes
    layers = read.placements[-1].mesh.layers
    at = read.placements[-1].mesh.positions[read.placements[-1].mesh.triangles][..., 0]
    assert (layers[STRAND, "Is Strand"] == 1).all()
    assert np.allclose(layers[STRAND, "Length"], 3)
    share = layers[STRAND, "Intercept"][..., 0]
    for x, expected in ((0, 0), (1, 1 / 3), (3, 1)):
        assert np.allclose(share[np.isclose(at, x, atol=1e-3)], expected, atol=1e-3)
    assert np.allclose(layers[STRAND, "Thickness"][np.isclose(at, 1, atol=1e-4)], 0.4)
    assert len(np.unique(layers[STRAND, "Random"])) == 2
    assert not any(kind == STRAND for kind, _ in read.placements[0].mesh.layers)


def test_attributes_and_uv_maps_of_hair_reach_materials(add: Any) -> None:
    curves = hair(locks(4))
    roots = curves.attributes.new("surface_uv_coordinate", "FLOAT2", "CURVE")
    roots.data.foreach_set("vector", np.arange(8, dtype=np.float32) / 8)
    shade = curves.attributes.new("shade", "FLOAT_COLOR", "POINT")
    shade.data.foreach_set("color", np.linspace(0, 1, 4 * 5 * 4).astype(np.float32))
    curves.materials.append(reading(("UVMap", "UV"), ("Attribute", "Color"), attribute_name="shade"))
    add("Curls", curves)
    read, notes = found()
    assert not notes
    layers = read.placements[0].mesh.layers
    assert np.array_equal(np.unique(layers[UV, ""].reshape(-1, 2), axis=0), np.arange(8).reshape(4, 2) / 8)
    assert layers[COLOR, "shade"].shape[2] == 4
    assert layers[COLOR, "shade"].min() == 0
    assert layers[COLOR, "shade"].max() == 1


def test_particle_hair_has_the_uv_of_its_roots(add: Any) -> None:
    item = add("Head", cube())
    item.data.materials.append(reading(("UVMap", "UV")))
    fur(item, 20)
    read = found()[0]
    uv = read.placements[-1].mesh.layers[UV, ""].reshape(20, -1, 2)
    assert np.ptp(uv, axis=1).max() == 0
    assert np.ptp(uv, axis=0).max() > 0.1
    assert 0 <= uv.min() <= uv.max() <= 1


def test_values_of_points_reach_materials(add: Any) -> None:
    dust = cloud([(0, 0, 0), (1, 0, 0)], [0.1, 0.2])
    dust.materials.append(reading(*(("PointInfo", name) for name in ("Position", "Radius", "Random"))))
    add("Dust", dust)
    layers = found()[0].placements[0].mesh.layers
    assert np.unique(layers[STRAND, "Radius"]).tolist() == pytest.approx([0.1, 0.2])
    assert np.unique(layers[STRAND, "Position"][..., 0]).tolist() == [0, 1]
    assert len(np.unique(layers[STRAND, "Point Random"])) == 2


def test_absurd_values_are_listed(add: Any) -> None:
    points = locks(6)
    points[0, 2, 1] = np.nan
    points[1, 0, 0] = np.inf
    points[2] = points[2, 0]
    radii = np.full((6, 5), 0.1)
    radii[3, :2] = -1
    radii[4, 3] = np.nan
    add("Curls", hair(points, radii))
    centres = locks(1)[0]
    centres[0, 0] = np.nan
    add("Dust", cloud(centres, [1, -1, 0, 1e30, 0.1]))
    add("Bald", bpy.data.hair_curves.new("Bald"))
    add("Nothing", bpy.data.pointclouds.new("Nothing"))
    add("Dot", hair([[(0, 0, 0)]], name="Dot"))
    add("Collapsed", hair(locks(2), name="Flat"), scale=(0, 0, 1))
    read, notes = found()
    assert "Left out hairs with coordinates or radii that are not finite: Curls (3)" in notes
    assert "Negative radii are rendered as 0, of hairs: Curls" in notes
    assert "Left out points with coordinates or radii that are not finite: Dust (2)" in notes
    assert "Negative radii are rendered as 0, of points: Dust" in notes
    assert len(notes) == 5
    assert "collapses" in notes[0]
    assert [line.split(" as ")[0] for line in read.made] == ["Curls: 2 hairs", "Dust: 1 points"]
    assert np.isfinite(read.flattened().geometry.vertices).all()


def test_too_much_hair_is_thinned_with_a_note(add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    add("Curls", hair(locks(100), 0.3))
    full = found()[0]
    for most in (len(full.placements[0].mesh.triangles) - 1, 100 * 4 * 8, 1000):
        monkeypatch.setattr(collecting, "MOST_TRIANGLES", most)
        read, notes = found()
        assert len(read.placements[0].mesh.triangles) <= most
        assert bool(notes) == (most == 1000)
    assert notes == ["Only one in 3 hairs is rendered, all together have more than 1,000 triangles: Curls"]


def test_too_many_particles_and_points_are_thinned_with_a_note(add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    fur(add("Head", grid(2)), 200)
    add("Dust", cloud(np.random.default_rng(1).uniform(-1, 1, (100, 3))))
    monkeypatch.setattr(collecting, "MOST_TRIANGLES", 4000)
    monkeypatch.setattr(collecting, "MOST_INSTANCED", 4000)
    read, notes = found()
    assert all(len(one.mesh.triangles) * len(one.names) <= 4000 for one in read.placements)
    assert [line.split(":")[1].strip() for line in notes] == ["Head", "Dust"]
    assert "hairs" in notes[0]
    assert "points" in notes[1]

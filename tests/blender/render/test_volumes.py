# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume shader nodes compared with Cycles: cubes in the light of a world, a sun and a lamp."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read.media import grids
from addon.blender.session import reports
from tests.blender import atlas
from tests.blender.atlas import add as node
from tests.blender.shapes import cube, read, with_nodes

SAMPLES, BOUNCES = 512, 8


def volume(kind: str, **settings: Any) -> atlas.Maker:
    return lambda tree: node(tree, f"Volume{kind}", **settings).outputs[0]


def mixed(tree: Any) -> Any:
    factor = {"Fac" if bpy.app.version < (5, 0) else "Factor": 0.3}
    mix = node(tree, "MixShader", **factor)
    tree.links.new(node(tree, "VolumePrincipled", Density=4.0, Emission_Strength=0.5).outputs[0], mix.inputs[1])
    tree.links.new(node(tree, "VolumeAbsorption", Color=(0.2, 0.9, 0.3, 1), Density=3.0).outputs[0], mix.inputs[2])
    return mix.outputs[0]


def added(tree: Any) -> Any:
    total = node(tree, "AddShader")
    scatter = node(tree, "VolumeScatter", Color=(0.9, 0.5, 0.2, 1), Density=2.0, Anisotropy=-0.4)
    glow = node(tree, "Emission", Color=(0.2, 0.5, 0.9, 1), Strength=0.7)
    tree.links.new(scatter.outputs[0], total.inputs[0])
    tree.links.new(glow.outputs[0], total.inputs[1])
    return total.outputs[0]


def negative(tree: Any) -> Any:
    fog, number = node(tree, "VolumeAbsorption"), node(tree, "Value")
    number.outputs[0].default_value = -5.0
    tree.links.new(number.outputs[0], fog.inputs["Density"])
    return fog.outputs[0]


VOLUMES = {
    "absorption": volume("Absorption", Color=(0.2, 0.5, 0.9, 1), Density=2.0),
    "scatter": volume("Scatter", Color=(0.8, 0.5, 0.3, 1), Density=1.5),
    "forwards": volume("Scatter", Color=(0.9, 0.9, 0.9, 1), Density=3.0, Anisotropy=0.7),
    "principled": volume("Principled", Density=3.0, Color=(0.7, 0.4, 0.2, 1), Absorption_Color=(0.3, 0.1, 0.5, 1)),
    "glowing": volume("Principled", Density=2.0, Emission_Strength=1.0, Emission_Color=(1, 0.5, 0.2, 1)),
    "fire": volume("Principled", Density=1.0, Blackbody_Intensity=1.0, Temperature=2400.0),
    "mixed": mixed,
    "added": added,
}


@pytest.fixture(name="lit")
def lights(scene: Any, add: Any) -> Any:
    """A scene with a dim world and a sun."""
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 2.0, 0.1
    add("Sun", sun, rotation_euler=(0.6, 0.3, 0))
    return scene


def only_volumes(names: Any) -> Iterator[Any]:
    """Move what the tiles' materials have as a surface to their volume."""
    for name in names:
        tree = bpy.data.materials[name].node_tree
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        (link,) = output.inputs["Surface"].links
        tree.links.new(link.from_socket, output.inputs["Volume"])
        tree.links.remove(output.inputs["Surface"].links[0])
        yield tree


@pytest.mark.parametrize("bounces", [0, 12])
def test_volumes_are_those_of_cycles(lit: Any, bounces: int) -> None:
    atlas.sheet(lit, VOLUMES, cube(size=0.8))
    assert len(list(only_volumes(VOLUMES))) == len(VOLUMES)
    lit.halfspace.volume_bounces = lit.cycles.volume_bounces = bounces
    ours, theirs = atlas.both(lit, VOLUMES, samples=SAMPLES, bounces=max(bounces, BOUNCES))
    assert not atlas.differences(ours, theirs, alike=None)
    report = reports.last(lit)
    assert report is not None
    assert not report.warnings


def test_absurd_volumes_are_named_and_rendered(lit: Any) -> None:
    family = {
        "dense": volume("Scatter", Density=1e9),
        "negative": negative,
        "sharp": volume("Scatter", Density=2.0, Anisotropy=1.0),
        "empty": volume("Principled", Density=0.0),
    }
    atlas.sheet(lit, family, cube(size=0.8))
    assert len(list(only_volumes(family))) == len(family)
    atlas.configure(lit, 4, 2)
    for tile in atlas.rendered(lit, family, "HALFSPACE").values():
        assert (tile >= 0).all()
    report = reports.last(lit)
    assert report is not None
    assert any("negative" in warning.lower() for warning in report.warnings)


def test_a_world_of_fog_is_read_and_one_that_varies_is_named(scene: Any, add: Any) -> None:
    add("Cube", cube())
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    tree = scene.world.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    fog = node(tree, "VolumeScatter", Density=0.1)
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    found, notes = read()
    assert found.world.volume is not None
    assert not notes
    texture = node(tree, "TexNoise")
    tree.links.new(texture.outputs[0], fog.inputs["Density"])
    found, notes = read()
    assert found.world.volume is None
    assert any("varies" in line for line in notes)


@pytest.fixture(name="fog")
def fog_file(tmp_path: Path) -> Path:
    """A file with a ball of fog that thins out, twelve voxels across, and a hot half of it."""
    bpy.utils.expose_bundled_modules()
    openvdb = pytest.importorskip("openvdb")
    axis = np.linspace(-1, 1, 13)
    place = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    density = np.clip(1 - np.linalg.norm(place, axis=-1), 0, 1).astype(np.float32)
    grids = []
    for name, values in (("density", density), ("temperature", (density * (place[..., 0] > 0)).astype(np.float32))):
        grid = openvdb.FloatGrid()
        grid.name = name
        grid.copyFromArray(values, ijk=(-6, -6, -6))
        grid.transform = openvdb.createLinearTransform(voxelSize=0.06)
        grids.append(grid)
    path = tmp_path / "fog.vdb"
    openvdb.write(str(path), grids)
    return path


def glowing(tree: Any) -> Any:
    """Emission in proportion to a grid: Cycles 5 reads one voxel at random, which agrees for linear uses only."""
    cloud, heat = node(tree, "VolumePrincipled", Density=3.0), node(tree, "Attribute", attribute_name="temperature")
    scaled = node(tree, "Math", operation="MULTIPLY")
    scaled.inputs[1].default_value = 3.0
    tree.links.new(heat.outputs["Fac" if "Fac" in heat.outputs else "Factor"], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], cloud.inputs["Emission Strength"])
    return cloud.outputs[0]


def test_volume_objects_are_those_of_cycles(lit: Any, add: Any, fog: Path) -> None:
    family = {
        "grey": volume("Principled", Density=8.0),
        "glowing": glowing,
        "absorbing": volume("Principled", Density=9.0, Color=(0.1, 0.3, 0.8, 1)),
        "forwards": volume("Principled", Density=9.0, Anisotropy=0.6),
    }
    atlas.sheet(lit, family, cube(size=0.8))
    assert len(list(only_volumes(family))) == len(family)
    # Replace the cubes by the volume, turned and scaled.
    for number, name in enumerate(family):
        item = bpy.data.objects[name]
        data = bpy.data.volumes.new(name)
        data.filepath = str(fog)
        data.materials.append(item.material_slots[0].material)
        add(f"Fog {name}", data, location=item.location, rotation_euler=(0.3 * number, 0.2, 0), scale=(1, 1.1, 0.8))
        bpy.data.objects.remove(item)
    lit.halfspace.volume_bounces = lit.cycles.volume_bounces = 4
    ours, theirs = atlas.both(lit, family, samples=SAMPLES, bounces=BOUNCES)
    # Cycles of Blender 4.5 marches through grids in steps, with more noise.
    assert not atlas.differences(ours, theirs, alike=0.95 if bpy.app.version >= (5, 0) else 0.9)
    report = reports.last(lit)
    assert report is not None
    assert not report.warnings


def made(way: str, material: Any) -> Any:
    """Geometry nodes that make a volume of this material on a mesh object."""
    tree = bpy.data.node_groups.new(way, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")

    def new(kind: str, **inputs: Any) -> Any:
        one = tree.nodes.new(f"GeometryNode{kind}")
        for name, value in inputs.items():
            one.inputs[name.replace("_", " ")].default_value = value
        return one

    def linked(source: Any, target: Any, name: str = "Geometry") -> Any:
        tree.links.new(source.outputs[0], target.inputs[name])
        return target

    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    if way == "from a mesh":
        source = linked(first, new("MeshToVolume", Density=1.0, Voxel_Amount=16.0), "Mesh")
    else:
        size = 0.15 if way.startswith("instances") else 0.3
        cube = new("VolumeCube", Density=1.0, Min=(-size,) * 3, Max=(size,) * 3)
        for axis in "XYZ":
            cube.inputs[f"Resolution {axis}"].default_value = 12
        # A density that varies, so that a box without the grid is another picture.
        place, parts = new("InputPosition"), tree.nodes.new("ShaderNodeSeparateXYZ")
        clamp = tree.nodes.new("ShaderNodeMath")
        clamp.operation, clamp.inputs[1].default_value, clamp.inputs[2].default_value = "MULTIPLY_ADD", 0.5 / size, 0.5
        tree.links.new(place.outputs[0], parts.inputs[0])
        tree.links.new(parts.outputs[0], clamp.inputs[0])
        tree.links.new(clamp.outputs[0], cube.inputs["Density"])
        source = cube
    shaded = linked(source, new("SetMaterial", Material=material))
    if way.startswith("instances"):
        placed = linked(first, tree.nodes.new("GeometryNodeInstanceOnPoints"), "Points")
        placed.inputs["Rotation"].default_value = (0.0, 0.0, 0.4)
        shaded = linked(shaded, placed, "Instance")
        if way == "instances that are made real":
            shaded = linked(shaded, new("RealizeInstances"))
    if way == "next to a mesh":
        moved = linked(first, new("Transform", Scale=(0.3, 0.3, 0.3), Translation=(0.0, 0.0, -0.3)))
        joined = linked(shaded, new("JoinGeometry"))
        tree.links.new(moved.outputs[0], joined.inputs["Geometry"])
        shaded = joined
    tree.links.new(shaded.outputs[0], last.inputs[0])
    return tree


WAYS = ("a cube", "from a mesh", "next to a mesh", "instances", "instances that are made real", "turned")
"""How nodes make volumes on mesh objects."""


def test_volumes_that_nodes_make_are_those_of_cycles(lit: Any, add: Any) -> None:
    """On mesh objects, where no data block is a volume: as dense as their grids are, not solid boxes."""
    family = dict.fromkeys(WAYS, volume("Principled", Density=9.0, Color=(0.3, 0.6, 0.8, 1)))
    atlas.sheet(lit, family, cube(size=0.45))
    assert len(list(only_volumes(family))) == len(family)
    for name in family:
        item = bpy.data.objects[name]
        item.modifiers.new("Volume", "NODES").node_group = made(name, item.material_slots[0].material)
        if name == "turned":
            item.rotation_euler, item.scale = (0.4, 0.2, 0.7), (1.2, 0.9, 0.7)
    assert not any(isinstance(block, bpy.types.Volume) for block in bpy.context.evaluated_depsgraph_get().ids)
    lit.halfspace.volume_bounces = lit.cycles.volume_bounces = 4
    ours, theirs = atlas.both(lit, family, samples=SAMPLES, bounces=BOUNCES)
    for found in (ours, theirs) if bpy.app.version < (5, 0) else ():
        del found["instances"]  # Cycles 4.5 differs from Cycles 5.2 by as much
    assert not atlas.differences(ours, theirs, alike=0.9)
    report = reports.last(lit)
    assert report is not None
    assert not report.warnings


def test_grids_have_a_limit_in_total(lit: Any, add: Any, fog: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grids, "MOST_OF_ALL", 3000)
    for name in ("First", "Second"):
        data = bpy.data.volumes.new(name)
        data.filepath = str(fog)
        add(name, data)
    large = [line for line in read()[1] if "too large together with the scene's other grids" in line]
    assert large
    assert all("Second" in line and "First" not in line for line in large)


def test_volumes_without_a_file_or_a_shader_are_named(lit: Any, add: Any, fog: Path) -> None:
    missing, plain = bpy.data.volumes.new("Missing"), bpy.data.volumes.new("Plain")
    missing.filepath, plain.filepath = "/nowhere/fog.vdb", str(fog)
    add("Missing", missing)
    add("Plain", plain)
    add("Empty", bpy.data.volumes.new("Empty"))
    _, notes = read()
    for name in ("Missing", "Plain", "Empty"):
        assert any(name in line for line in notes), notes
    lit.view_layers[0].use_volumes = False
    assert not read()[1]

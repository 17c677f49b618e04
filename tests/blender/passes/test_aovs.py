# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes that materials write, beside those of Cycles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add as node
from atlas import tile_material
from exr_files import exr
from shapes import cube, grid, with_nodes

from addon.blender.render.engine import ENGINE


def waves(tree: Any) -> Any:
    """A smooth colour of the place."""
    wave = node(tree, "VectorMath", operation="SINE")
    tree.links.new(node(tree, "NewGeometry").outputs["Position"], wave.inputs[0])
    return wave.outputs[0]


def written(tree: Any) -> Any:
    """A matt surface that writes a varying colour and, inside a group, a varying number."""
    color = node(tree, "OutputAOV")
    color.aov_name = "Waves"
    tree.links.new(waves(tree), color.inputs["Color"])
    group = bpy.data.node_groups.new("Inside", "ShaderNodeTree")
    number = node(group, "OutputAOV")
    number.aov_name = "Fade"
    group.links.new(node(group, "LayerWeight", Blend=0.3).outputs["Facing"], number.inputs["Value"])
    tree.nodes.new("ShaderNodeGroup").node_tree = group
    return node(tree, "BsdfDiffuse", Color=(0.6, 0.3, 0.2, 1)).outputs[0]


def constant(tree: Any) -> Any:
    """A surface that writes constants, half transparent."""
    color = node(tree, "OutputAOV")
    color.aov_name = "Waves"
    color.inputs["Color"].default_value, color.inputs["Value"].default_value = (0.2, 0.4, 0.8, 1.0), 0.7
    other = node(tree, "OutputAOV")
    other.aov_name = "Fade"
    other.inputs["Value"].default_value = 0.7
    return node(tree, "BsdfDiffuse").outputs[0]


@pytest.fixture
def stage(add: Any, scene: Any) -> Any:
    """Two cubes that write, on a floor that does not."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    for name, make, place in (("Varying", written, (-1.3, 0, 0)), ("Constant", constant, (1.3, 1, 0))):
        mesh = cube(name)
        mesh.materials.append(tile_material(name, make))
        add(name, mesh, location=place, rotation_euler=(0.3, 0.2, 0.4))
    add("Floor", grid(1), location=(0, 0, -1.3), scale=(3, 3, 1))
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, -8, 4), rotation_euler=(1.1, 0, 0))
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 60, 40, 100
    atlas.configure(scene, 256, 1)
    layer = bpy.context.view_layer
    for name, kind in (("Fade", "VALUE"), ("Waves", "COLOR"), ("Unwritten", "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    return scene


def test_materials_write_what_they_write_in_cycles(stage: Any, tmp_path: Path) -> None:
    found = []
    for engine in (ENGINE, "CYCLES"):
        stage.render.engine = engine
        found.append(exr(stage, tmp_path / f"{engine}.exr"))
    ours, theirs = found
    names = ["Fade.X", "Waves.R", "Waves.G", "Waves.B", "Waves.A"]
    for name in names:
        assert theirs[name].std() > 0.1, name
        assert np.abs(ours[name] - theirs[name]).mean() < 0.01, name
        assert abs(ours[name].mean() - theirs[name].mean()) < 0.01 * np.abs(theirs[name]).mean(), name
    assert not ours["Unwritten.R"].any()


def test_worlds_write_what_they_write_in_cycles(stage: Any, tmp_path: Path) -> None:
    world = stage.world = bpy.data.worlds.new("World")
    with_nodes(world)
    tree = world.node_tree
    color = node(tree, "OutputAOV")
    color.aov_name = "Waves"
    other = bpy.data.objects.new("Other", None)
    other.location, other.rotation_euler, other.scale = (0.3, 0.2, -0.4), (0.4, 0.5, 0.6), (1.5, 2.0, 0.7)
    stage.collection.objects.link(other)
    tree.links.new(node(tree, "TexCoord", object=other).outputs["Object"], color.inputs["Color"])
    number = node(tree, "OutputAOV")
    number.aov_name, number.inputs["Value"].default_value = "Fade", 0.6
    stage.camera.rotation_euler = (1.4, 0, 0)
    atlas.configure(stage, 64, 1)
    found = []
    for engine in (ENGINE, "CYCLES"):
        stage.render.engine = engine
        found.append(exr(stage, tmp_path / f"{engine}.exr"))
    ours, theirs = found
    for name in ("Fade.X", "Waves.R", "Waves.G", "Waves.B", "Waves.A"):
        assert theirs[name].std() > 0.05 or name == "Waves.A", name
        assert np.abs(ours[name] - theirs[name]).mean() < 0.01, name


def test_materials_stay_as_they_are_without_their_passes(stage: Any, tmp_path: Path) -> None:
    stage.render.engine, stage.halfspace.samples = ENGINE, 4
    written = exr(stage, tmp_path / "written.exr")
    bpy.context.view_layer.aovs.remove(bpy.context.view_layer.aovs[0])
    fewer = exr(stage, tmp_path / "fewer.exr")
    assert "Fade.X" not in fewer
    assert all(np.array_equal(fewer[name], written[name]) for name in fewer)

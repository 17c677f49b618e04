# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes that materials write, compared with those of Cycles."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import add, made, tile_material
from tests.blender.exr_files import both, exr
from tests.blender.shapes import cube, grid, look, place, world

waves = made("VectorMath", made("NewGeometry", output="Position"), operation="SINE")
"""A smooth colour of the place."""


def write(tree: Any, name: str, **inputs: Any) -> None:
    """Write to a pass."""
    add(tree, "OutputAOV", aov_name=name, **inputs)


def written(tree: Any) -> Any:
    """A matt surface that writes a varying colour and, inside a group, a varying number."""
    write(tree, "Waves", Color=waves)
    group = bpy.data.node_groups.new("Inside", "ShaderNodeTree")
    write(group, "Fade", Value=made("LayerWeight", Blend=0.3, output="Facing"))
    tree.nodes.new("ShaderNodeGroup").node_tree = group
    return add(tree, "BsdfDiffuse", Color=(0.6, 0.3, 0.2, 1)).outputs[0]


def constant(tree: Any) -> Any:
    """A surface that writes constants."""
    write(tree, "Waves", Color=(0.2, 0.4, 0.8, 1.0), Value=0.7)
    write(tree, "Fade", Value=0.7)
    return add(tree, "BsdfDiffuse").outputs[0]


@pytest.fixture
def stage(scene: Any) -> Any:
    """Two cubes that write, on a floor that does not."""
    atlas.with_cycles(scene)
    for name, make, where in (("Varying", written, (-1.3, 0, 0)), ("Constant", constant, (1.3, 1, 0))):
        place(name, cube(name), tile_material(name, make), location=where, rotation_euler=(0.3, 0.2, 0.4))
    place("Floor", grid(1), location=(0, 0, -1.3), scale=(3, 3, 1))
    look((60, 40), (0, -8, 4), 1.1)
    atlas.configure(scene, 256, 1)
    layer = bpy.context.view_layer
    for name, kind in (("Fade", "VALUE"), ("Waves", "COLOR"), ("Unwritten", "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    return scene


NAMES = ("Fade.X", "Waves.R", "Waves.G", "Waves.B", "Waves.A")


def test_materials_write_what_they_write_in_cycles(stage: Any, tmp_path: Path) -> None:
    ours, theirs = both(stage, tmp_path)
    for name in NAMES:
        assert theirs[name].std() > 0.1, name
        assert np.abs(ours[name] - theirs[name]).mean() < 0.01, name
        assert abs(ours[name].mean() - theirs[name].mean()) < 0.01 * np.abs(theirs[name]).mean(), name
    assert not ours["Unwritten.R"].any()


def test_worlds_write_what_they_write_in_cycles(stage: Any, tmp_path: Path) -> None:
    world()
    turned = {"location": (0.3, 0.2, -0.4), "rotation_euler": (0.4, 0.5, 0.6), "scale": (1.5, 2.0, 0.7)}
    tree, other = stage.world.node_tree, place("Other", None, **turned)
    write(tree, "Waves", Color=made("TexCoord", object=other, output="Object"))
    write(tree, "Fade", Value=0.6)
    stage.camera.rotation_euler = (1.4, 0, 0)
    atlas.configure(stage, 64, 1)
    ours, theirs = both(stage, tmp_path)
    for name in NAMES:
        assert theirs[name].std() > 0.05 or name == "Waves.A", name
        assert np.abs(ours[name] - theirs[name]).mean() < 0.01, name


def test_materials_stay_as_they_are_without_their_passes(stage: Any, tmp_path: Path) -> None:
    stage.render.engine, stage.halfspace.samples = ENGINE, 4
    written = exr(stage, tmp_path / "written.exr")
    bpy.context.view_layer.aovs.remove(bpy.context.view_layer.aovs[0])
    fewer = exr(stage, tmp_path / "fewer.exr")
    assert "Fade.X" not in fewer
    assert all(np.array_equal(fewer[name], written[name]) for name in fewer)

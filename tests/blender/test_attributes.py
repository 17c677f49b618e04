# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials read attributes of every kind that a mesh stores, and what they cannot read is said."""

from __future__ import annotations

from typing import Any

import bpy
import halfspace_native
import numpy as np
import pytest
from shapes import cube, material, node, read

from addon.blender import layers
from addon.core.scene import SceneError


@pytest.fixture
def box(add: Any) -> Any:
    """The mesh of a cube whose paint is the attribute "wear"."""
    paint = material("Paint")
    tree = paint.node_tree
    source = tree.nodes.new("ShaderNodeAttribute")
    source.attribute_name = "wear"
    tree.links.new(source.outputs["Color"], node(tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"])
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
    assert layer is not None
    stored = [float(item.value) for item in wear.data]
    if domain == "FACE":
        assert layer.reshape(6, -1).tolist() == [[value] * 18 for value in stored], "two triangles to a face"
    else:
        assert set(np.unique(layer)) == set(stored)
    assert (layer == layer[..., :1]).all(), "grey"


@pytest.mark.parametrize(
    ("kind", "domain", "reason"), [("QUATERNION", "POINT", "type quaternion"), ("FLOAT", "EDGE", "domain edge")]
)
def test_what_cannot_be_read_is_said(box: Any, kind: str, domain: str, reason: str) -> None:
    box.attributes.new("wear", kind, domain)
    assert read()[1] == [f"The attribute 'wear' is black, its {reason} is not supported yet: Box"]


def test_what_no_mesh_has_is_said(box: Any, add: Any) -> None:
    assert read()[1] == ["No mesh has the attribute 'wear', it is 0 everywhere, in material: Paint"]
    other = cube("Other")
    other.attributes.new("wear", "FLOAT", "POINT")
    add("Other", other, location=(5, 0, 0))
    assert read()[1] == []


def test_what_an_unused_material_reads_is_not_missed(scene: Any, add: Any) -> None:
    paint = material("Unused")
    source = paint.node_tree.nodes.new("ShaderNodeUVMap")
    source.uv_map = "nowhere"
    add("Bare", cube())
    assert read()[1] == []
    image = paint.node_tree.nodes.new("ShaderNodeTexChecker")
    paint.node_tree.links.new(source.outputs[0], image.inputs["Vector"])
    shader = node(paint.node_tree, "ShaderNodeBsdfPrincipled")
    paint.node_tree.links.new(image.outputs[0], shader.inputs["Base Color"])
    bpy.data.meshes["Cube"].materials.append(paint)
    assert read()[1] == ["No mesh has the UV map 'nowhere', it is 0 everywhere, in material: Unused"]


def test_more_attributes_than_fit_over_the_whole_scene_are_refused_before_any_is_copied(
    box: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    box.attributes.new("wear", "FLOAT_COLOR", "CORNER")
    monkeypatch.setattr(layers, "assemble_layers", lambda *_: pytest.fail("they were copied"))
    # The triangles and their corners alone would have room: 12 triangles of 8 vertices, flat.
    monkeypatch.setattr(halfspace_native, "free_memory", lambda: 12 * 8 + 16 * 12)
    with pytest.raises(SceneError, match=r"12 triangles, .* do not fit; let materials read fewer different attributes"):
        read()

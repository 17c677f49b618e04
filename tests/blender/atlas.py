# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets of small tiles, each with a node tree of its own, rendered with this engine and with Cycles."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest
from shapes import with_nodes

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE

TILE, MARGIN = 24, 2
"""Pixels along a tile, and pixels at its edge that are not compared."""

Maker = Callable[[Any], Any]
"""Adds nodes to a tree; returns a shader's output, or a value's, which becomes emission."""

Tiles = dict[str, np.ndarray[Any, Any]]
"""By name, the (n, n, 3) pixels of each tile."""


def tile_material(name: str, make: Maker) -> Any:
    """A material whose surface is what `make` returns."""
    material = bpy.data.materials.new(name)
    with_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    socket = make(tree)
    if socket.type != "SHADER":
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(socket, emission.inputs["Color"])
        socket = emission.outputs[0]
    tree.links.new(socket, output.inputs["Surface"])
    return material


def sheet(scene: Any, makers: Mapping[str, Maker], mesh: Any) -> None:
    """Place an instance of `mesh`, which is at most one unit wide, for each tile, and look at them from above."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    columns = math.ceil(math.sqrt(len(makers)))
    rows = math.ceil(len(makers) / columns)
    mesh.materials.append(None)
    for index, (name, make) in enumerate(makers.items()):
        item = bpy.data.objects.new(name, mesh)
        item.location = (index % columns + 0.5, index // columns + 0.5, 0)
        item.material_slots[0].link = "OBJECT"
        item.material_slots[0].material = tile_material(name, make)
        scene.collection.objects.link(item)
    camera = bpy.data.cameras.new("Above")
    camera.type, camera.ortho_scale = "ORTHO", max(columns, rows)
    scene.camera = bpy.data.objects.new("Above", camera)
    scene.camera.location = (columns / 2, rows / 2, 10)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y = columns * TILE, rows * TILE
    scene.render.resolution_percentage = 100


def configure(scene: Any, samples: int, bounces: int) -> None:
    """Give both engines the same settings, without any that trades light for noise."""
    ours, theirs = scene.halfspace, scene.cycles
    ours.samples, ours.max_bounces = samples, bounces
    ours.clamp_direct = ours.clamp_indirect = ours.filter_glossy = 0.0
    ours.pixel_filter_type = theirs.pixel_filter_type = "BOX"
    theirs.device, theirs.samples = "CPU", samples
    theirs.use_denoising = theirs.use_adaptive_sampling = theirs.use_light_tree = False
    theirs.light_sampling_threshold = theirs.sample_clamp_direct = theirs.sample_clamp_indirect = 0.0
    theirs.blur_glossy = 0.0
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(theirs, f"{kind}_bounces", bounces)


def rendered(scene: Any, names: Mapping[str, Maker], engine: str, channels: int = 3) -> Tiles:
    """The tiles of the picture of an engine."""
    scene.render.engine = engine
    picture = pictures.render(scene)[..., :channels]
    columns = picture.shape[1] // TILE
    inside = slice(MARGIN, TILE - MARGIN)
    return {
        name: picture[y * TILE :, x * TILE :][inside, inside]
        for name, (y, x) in zip(names, (divmod(i, columns) for i in range(len(names))), strict=True)
    }


RECORD = "HALFSPACE_NODES"
"""Environment variable: a file to which each comparison without a difference appends its test and its nodes."""

_compared: list[str] = []
"""Types of the nodes of the pictures that `both` made last."""


def remember_nodes() -> None:
    """Keep the types of the nodes of all materials and lights in use, for the record of the next comparison."""
    blocks = [*bpy.data.materials, *bpy.data.lights]
    trees = [block.node_tree for block in blocks if block.users and block.node_tree]
    _compared[:] = sorted({node.bl_idname for tree in trees for node in tree.nodes})


def both(scene: Any, makers: Mapping[str, Maker], *, samples: int, bounces: int) -> tuple[Tiles, Tiles]:
    """The tiles of this engine and of Cycles."""
    configure(scene, samples, bounces)
    remember_nodes()
    return rendered(scene, makers, ENGINE), rendered(scene, makers, "CYCLES")


def differences(ours: Tiles, theirs: Tiles, *, mean: float = 0.01, alike: float | None = 0.95) -> dict[str, str]:
    """The tiles whose mean colours differ by more than `mean` of Cycles' mean, or whose pixels correlate less."""
    found = {}
    for name, theirs_ in theirs.items():
        a, b = (one.reshape(-1, 3).astype(float) for one in (ours[name], theirs_))
        apart = np.abs(a.mean(axis=0) - b.mean(axis=0)).max() / max(np.abs(b).mean(), 1e-3)
        spread = a.std() * b.std()
        correlation = ((a - a.mean()) * (b - b.mean())).mean() / spread if spread > 1e-8 else 1.0
        if not apart <= mean or (alike is not None and not correlation >= alike):
            found[name] = f"means apart by {apart:.4f}, correlation {correlation:.4f}: {a.mean(0)} {b.mean(0)}"
    if RECORD in os.environ and not found:
        test = os.environ["PYTEST_CURRENT_TEST"].split("::")[-1].split("[")[0].split(" ")[0]
        with Path(os.environ[RECORD]).open("a", encoding="utf-8") as file:
            file.write(json.dumps([test, _compared]) + "\n")
    return found


def add(tree: Any, kind: str, **settings: Any) -> Any:
    """A new node with these attributes, or values of inputs where it has no such attribute."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for key, value in settings.items():
        if key in node.bl_rna.properties:
            setattr(node, key, value)
        else:
            node.inputs[key.replace("_", " ")].default_value = value
    return node


def place(tree: Any, scale: float = 3.0) -> Any:
    """Object coordinates, turned and shifted away from all planes of symmetry."""
    coordinates = add(tree, "TexCoord")
    mapping = add(tree, "Mapping", Location=(0.37, -0.71, 0.23), Rotation=(0.4, 0.3, 0.2), Scale=(scale,) * 3)
    tree.links.new(coordinates.outputs["Object"], mapping.inputs["Vector"])
    return mapping.outputs["Vector"]

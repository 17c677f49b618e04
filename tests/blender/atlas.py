# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets of small tiles, each with a node tree of its own, rendered with this engine and with Cycles."""

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

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from addon.blender.session import reports
from tests.blender.shapes import grid, with_nodes

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


def with_cycles(scene: Any) -> None:
    """Enable Cycles; skips the test where there is none."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")


def tiles(scene: Any) -> list[Any]:
    """The objects of a sheet."""
    return [item for item in scene.objects if item.type == "MESH"]


def flat(scene: Any, makers: Mapping[str, Maker]) -> None:
    """A sheet of squares."""
    sheet(scene, makers, grid(1))
    for item in tiles(scene):
        item.scale = (0.5, 0.5, 1.0)


def sheet(scene: Any, makers: Mapping[str, Maker], mesh: Any) -> None:
    """Place an instance of `mesh`, which is at most one unit wide, for each tile, and look at them from above."""
    with_cycles(scene)
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
    ours.samples = samples
    ours.clamp_direct = ours.clamp_indirect = ours.filter_glossy = 0.0
    ours.pixel_filter_type = theirs.pixel_filter_type = "BOX"
    theirs.device, theirs.samples = "CPU", samples
    theirs.use_denoising = theirs.use_adaptive_sampling = theirs.use_light_tree = False
    theirs.light_sampling_threshold = theirs.sample_clamp_direct = theirs.sample_clamp_indirect = 0.0
    theirs.blur_glossy = 0.0
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(ours, f"{kind}_bounces", bounces)
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


def report(scene: Any) -> Any:
    """The report of the last picture, which there is."""
    found = reports.last(scene)
    assert found is not None
    return found


def warnings(scene: Any) -> list[str]:
    """The warnings of the last picture."""
    return list(report(scene).warnings)


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


def pair(scene: Any, channels: int = 3) -> Any:
    """The pictures of this engine and of Cycles, (2, h, w, channels)."""
    found = []
    for engine in (ENGINE, "CYCLES"):
        scene.render.engine = engine
        found.append(pictures.render(scene)[..., :channels].astype(float))
    return np.stack(found)


def assert_alike(
    scene: Any, makers: Mapping[str, Maker], *, samples: int = 64, bounces: int = 0, **limits: float | None
) -> None:
    """Render a sheet with both engines: no tile differs by more than `limits`, and nothing is warned of."""
    found = differences(*both(scene, makers, samples=samples, bounces=bounces), **limits)  # type: ignore[arg-type]
    assert not found, found
    assert not warnings(scene)


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


def add(tree: Any, kind: str, *inputs: Any, **settings: Any) -> Any:
    """A new node with these attributes, or inputs where it has no such attribute; `inputs` are those of its first
    sockets. Sockets, and those of makers, are linked; None leaves an input as it is.
    """
    node = tree.nodes.new(f"ShaderNode{kind}")
    given: dict[int | str, Any] = dict(enumerate(inputs))
    for key, value in settings.items():
        if key in node.bl_rna.properties:
            setattr(node, key, value)
        else:
            given[key.replace("_", " ")] = value
    for key, value in given.items():
        socket = value(tree) if callable(value) else value
        if isinstance(socket, bpy.types.NodeSocket):
            tree.links.new(socket, node.inputs[key])
        elif socket is not None:
            node.inputs[key].default_value = socket
    return node


def made(kind: str, *inputs: Any, output: int | str = 0, **settings: Any) -> Maker:
    """An output of a new node, as of `add`."""
    return lambda tree: add(tree, kind, *inputs, **settings).outputs[output]


def number(value: float) -> Maker:
    """A value that no limits of sockets change."""

    def make(tree: Any) -> Any:
        node = add(tree, "Value")
        node.outputs[0].default_value = value
        return node.outputs[0]

    return make


def shown(value: Any, factor: float = 0.5, shift: float = 0.5) -> Maker:
    """A vector or number whose negative values are visible, too."""
    return made("VectorMath", value, (factor,) * 3, (shift,) * 3, operation="MULTIPLY_ADD")


def read(kind: str, output: int | str, factor: float = 0.5, shift: float = 0.5, **settings: Any) -> Maker:
    """An output of a node as of `shown`."""
    return shown(made(kind, output=output, **settings), factor, shift)


def place(tree: Any, scale: float = 3.0) -> Any:
    """Object coordinates, turned and shifted away from all planes of symmetry."""
    turned = {"Location": (0.37, -0.71, 0.23), "Rotation": (0.4, 0.3, 0.2), "Scale": (scale,) * 3}
    return add(tree, "Mapping", made("TexCoord", output="Object"), **turned).outputs["Vector"]


def placed(scale: float) -> Maker:
    """The coordinates of `place` at this scale."""
    return lambda tree: place(tree, scale)

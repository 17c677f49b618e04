# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights with node trees beside Cycles: as the camera sees them, and by what they shine on."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add
from shapes import grid, node, with_nodes

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from addon.blender.session import reports

Maker = Callable[[Any], Any]

FILE = """IESNA:LM-63-1995
[TEST] a lamp with two lobes
TILT=NONE
1 1000, 1 7 3 1 2 0.1 0.1 0
1.0 1.0 60
0 15 30 45 60 75 90
0 45 90
900 1200 700 400 150 60 10
900 800 500 300 120 40 5
900 500 300 150 60 20 1
"""


def shown(tree: Any, output: Any, factor: float = 0.5, shift: float = 0.5) -> Any:
    """A vector or number whose negative values are visible, too."""
    node = add(tree, "VectorMath", operation="MULTIPLY_ADD")
    tree.links.new(output, node.inputs[0])
    node.inputs[1].default_value, node.inputs[2].default_value = (factor,) * 3, (shift,) * 3
    return node.outputs[0]


def read(kind: str, output: str, factor: float = 0.5, shift: float = 0.5, **settings: Any) -> Maker:
    return lambda tree: shown(tree, add(tree, kind, **settings).outputs[output], factor, shift)


def ies(text: str = FILE, *, linked: bool = False, **settings: Any) -> Maker:
    """A photometric texture of a text; linked: in the direction of the normal."""

    def make(tree: Any) -> Any:
        block = bpy.data.texts.new("Lamp")
        block.write(text)
        item = add(tree, "TexIES", mode="INTERNAL", **settings)
        item.ies = block
        if linked:
            tree.links.new(add(tree, "TexCoord").outputs["Normal"], item.inputs["Vector"])
        return item.outputs[0]

    return make


def checker(tree: Any) -> Any:
    texture = add(tree, "TexChecker", Scale=4.0)
    tree.links.new(add(tree, "NewGeometry").outputs["Parametric"], texture.inputs["Vector"])
    return texture.outputs["Color"]


def noise(tree: Any) -> Any:
    texture = add(tree, "TexNoise", Scale=3.0)
    tree.links.new(add(tree, "TexCoord").outputs["Normal"], texture.inputs["Vector"])
    return texture.outputs["Color"]


def lamp(scene: Any, name: str, kind: str, make: Maker, **settings: Any) -> Any:
    """A light whose emission has the colour that `make` returns, a closure's weight aside."""
    data = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(data, key, value)
    with_nodes(data)
    tree = data.node_tree
    tree.links.new(make(tree), node(tree, "ShaderNodeEmission").inputs["Color"])
    item = bpy.data.objects.new(name, data)
    scene.collection.objects.link(item)
    return item


SEEN: dict[str, tuple[str, Maker]] = {
    "normal": ("POINT", read("TexCoord", "Normal")),
    "object": ("POINT", read("TexCoord", "Object")),
    "generated": ("POINT", read("TexCoord", "Generated")),
    "incoming": ("POINT", read("NewGeometry", "Incoming")),
    "position": ("POINT", read("NewGeometry", "Position", 0.1)),
    "parametric": ("POINT", read("NewGeometry", "Parametric")),
    "area": ("AREA", read("NewGeometry", "Parametric")),
    "area UV": ("AREA", read("TexCoord", "UV")),
    "area normal": ("AREA", read("TexCoord", "Normal")),
    "checker": ("AREA", checker),
    "noise": ("POINT", noise),
    "photometry": ("POINT", ies(linked=True, Strength=0.005)),
    "length": ("POINT", read("LightPath", "Ray Length", 0.05, 0.0)),
    "linear": ("POINT", read("LightFalloff", "Linear", 0.1, 0.0, Strength=1.0)),
    "smooth": ("POINT", read("LightFalloff", "Constant", 0.01, 0.0, Strength=1.0, Smooth=30.0)),
    "location": ("POINT", read("ObjectInfo", "Location", 0.1)),
    "warm": ("POINT", lambda tree: add(tree, "Blackbody", Temperature=3000.0).outputs[0]),
}


@pytest.fixture
def dark(scene: Any) -> Any:
    """A scene without a world."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    return scene


def test_lights_look_as_in_cycles(dark: Any) -> None:
    makers: dict[str, atlas.Maker] = {name: lambda tree: add(tree, "Holdout").outputs[0] for name in SEEN}
    atlas.sheet(dark, makers, grid(1))
    for item in [item for item in dark.objects if item.type == "MESH"]:
        kind, make = SEEN[item.name]
        size = {"size": 0.8} if kind == "AREA" else {"shadow_soft_size": 0.4, "use_soft_falloff": False}
        seen = lamp(dark, f"Lamp {item.name}", kind, make, energy=2.0 if kind == "AREA" else 6.3, **size)
        seen.location = (item.location[0], item.location[1], 0)
        seen.rotation_euler = (math.pi + 0.4, 0.3, 0.2) if kind == "AREA" else (0.5, 0.3, -0.4)
        seen.visible_camera = True
        bpy.data.objects.remove(item)
    ours, theirs = atlas.both(dark, makers, samples=64, bounces=0)
    assert not atlas.differences(ours, theirs)
    report = reports.last(dark)
    assert report is not None
    assert [line for line in report.warnings if "no surface" not in line] == []


def stage(scene: Any) -> None:
    """A floor and a wall seen from above."""
    for name, location, turned in (("Floor", (0, 0, 0), 0.0), ("Wall", (0, 2, 1), math.pi / 2)):
        item = bpy.data.objects.new(name, grid(1))
        item.location, item.rotation_euler, item.scale = location, (turned, 0, 0), (3, 3, 1)
        item.data.materials.append(atlas.tile_material(name, lambda tree: add(tree, "BsdfDiffuse").outputs[0]))
        scene.collection.objects.link(item)
    data = bpy.data.cameras.new("Camera")
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.camera.location, scene.camera.rotation_euler = (0, -3, 7), (0.4, 0, 0)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.render.resolution_percentage = 100


LIT: dict[str, tuple[str, Maker, dict[str, Any]]] = {
    "photometry": ("POINT", ies(Strength=0.01), {"energy": 60, "shadow_soft_size": 0.1}),
    "falloff": ("POINT", read("LightFalloff", "Linear", 1.0, 0.0, Strength=0.5), {"energy": 60}),
    "projector": ("SPOT", checker, {"energy": 300, "spot_size": 1.2, "shadow_soft_size": 0.0}),
    "window": ("AREA", noise, {"energy": 60, "size": 1.5}),
    "sun": ("SUN", read("LightFalloff", "Constant", 1.0, 0.0, Strength=1.5), {"energy": 1, "angle": 0.3}),
}


@pytest.mark.parametrize("case", LIT)
def test_lights_shine_as_in_cycles(dark: Any, case: str) -> None:
    kind, make, settings = LIT[case]
    stage(dark)
    item = lamp(dark, case, kind, make, **settings)
    item.location, item.rotation_euler = (0.3, 0.2, 1.8), (0.3, -0.2, 0.5)
    atlas.configure(dark, 64, 1)
    atlas.remember_nodes()
    found = []
    for engine in (ENGINE, "CYCLES"):
        dark.render.engine = engine
        found.append(pictures.render(dark)[..., :3])
    assert found[1].std() > 0.01
    # Cycles of Blender 4.5 interpolates between the angles otherwise.
    mean = 0.02 if case == "photometry" and bpy.app.version < (5, 0) else 0.01
    assert not atlas.differences({"all": found[0]}, {"all": found[1]}, mean=mean)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "TILT"),
        ("TILT=NONE\n1 1000 1 7", "ends early"),
        (FILE.replace("700", "red"), "'red'"),
        (FILE.replace("7 3 1", "-7 3 1"), "-7 angles"),
        (FILE.replace("7 3 1", "7 3 9"), "type 9"),
        (FILE.replace("0 45 90\n", "0 90 45\n"), "do not ascend"),
        (FILE.replace("1200", "1e999"), "not finite"),
    ],
)
def test_unreadable_photometric_texts_are_named(dark: Any, text: str, reason: str) -> None:
    stage(dark)
    lamp(dark, "Broken", "POINT", ies(text), energy=1).location = (0, 0, 2)
    atlas.configure(dark, 1, 0)
    dark.render.engine = ENGINE
    picture = pictures.render(dark)
    assert np.isfinite(picture).all()
    assert picture[..., :3].max() > 0
    report = reports.last(dark)
    assert report is not None
    assert any("IES Texture" in line and reason in line and "Broken" in line for line in report.warnings)


def test_photometric_files_are_read_from_disk(dark: Any, tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_text(FILE, encoding="latin-1")
    stage(dark)
    means = []
    for path in (tmp_path / "lamp.ies", tmp_path / "missing.ies"):
        item = lamp(
            dark,
            "Lamp",
            "POINT",
            lambda tree, path=path: add(tree, "TexIES", mode="EXTERNAL", filepath=str(path)).outputs[0],
        )
        item.location = (0, 0, 2)
        atlas.configure(dark, 4, 0)
        dark.render.engine = ENGINE
        means.append(pictures.render(dark)[..., :3].mean())
        report = reports.last(dark)
        assert report is not None
        assert bool(report.warnings) == (path.name == "missing.ies")
        bpy.data.objects.remove(item)
    assert 0 < means[0] < means[1]

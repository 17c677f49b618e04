# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights with node trees compared with Cycles: as the camera sees them, and by what they shine on."""

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import add, made, read
from tests.blender.shapes import grid, lamp, look, node, place, with_nodes

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


def ies(text: str = FILE, *, linked: bool = False, **settings: Any) -> atlas.Maker:
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


checker = made("TexChecker", made("NewGeometry", output="Parametric"), Scale=4.0)
noise = made("TexNoise", made("TexCoord", output="Normal"), Scale=3.0, output="Color")


def noded(name: str, kind: str, make: atlas.Maker, **settings: Any) -> Any:
    """A light whose emission has the colour that `make` returns, a closure's weight aside."""
    item = lamp(kind, name=name, **settings)
    with_nodes(item.data)
    tree = item.data.node_tree
    tree.links.new(make(tree), node(tree, "ShaderNodeEmission").inputs["Color"])
    return item


SEEN: dict[str, tuple[str, atlas.Maker]] = {
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
    "warm": ("POINT", made("Blackbody", Temperature=3000.0)),
}


@pytest.fixture
def dark(scene: Any) -> Any:
    """A scene without a world."""
    atlas.with_cycles(scene)
    return scene


def test_lights_look_as_in_cycles(dark: Any) -> None:
    makers: dict[str, atlas.Maker] = dict.fromkeys(SEEN, made("Holdout"))
    atlas.sheet(dark, makers, grid(1))
    for item in atlas.tiles(dark):
        kind, make = SEEN[item.name]
        size = {"size": 0.8} if kind == "AREA" else {"shadow_soft_size": 0.4, "use_soft_falloff": False}
        turn = (math.pi + 0.4, 0.3, 0.2) if kind == "AREA" else (0.5, 0.3, -0.4)
        where = {"location": (*item.location[:2], 0), "rotation_euler": turn, "visible_camera": True}
        noded(f"Lamp {item.name}", kind, make, energy=2.0 if kind == "AREA" else 6.3, **size, **where)
        bpy.data.objects.remove(item)
    ours, theirs = atlas.both(dark, makers, samples=64, bounces=0)
    assert not atlas.differences(ours, theirs)
    assert [line for line in atlas.warnings(dark) if "no surface" not in line] == []


def stage() -> None:
    """A floor and a wall seen from above."""
    matt = atlas.tile_material("Matt", made("BsdfDiffuse"))
    for name, location, turned in (("Floor", (0, 0, 0), 0.0), ("Wall", (0, 2, 1), math.pi / 2)):
        place(name, grid(1), matt, location=location, rotation_euler=(turned, 0, 0), scale=(3, 3, 1))
    look((32, 32), (0, -3, 7), 0.4)


LIT: dict[str, tuple[str, atlas.Maker, dict[str, Any]]] = {
    "photometry": ("POINT", ies(Strength=0.01), {"energy": 60, "shadow_soft_size": 0.1}),
    "falloff": ("POINT", read("LightFalloff", "Linear", 1.0, 0.0, Strength=0.5), {"energy": 60}),
    "projector": ("SPOT", checker, {"energy": 300, "spot_size": 1.2, "shadow_soft_size": 0.0}),
    "window": ("AREA", noise, {"energy": 60, "size": 1.5}),
    "sun": ("SUN", read("LightFalloff", "Constant", 1.0, 0.0, Strength=1.5), {"energy": 1, "angle": 0.3}),
}


@pytest.mark.parametrize("case", LIT)
def test_lights_shine_as_in_cycles(dark: Any, case: str) -> None:
    kind, make, settings = LIT[case]
    stage()
    noded(case, kind, make, **settings, location=(0.3, 0.2, 1.8), rotation_euler=(0.3, -0.2, 0.5))
    atlas.configure(dark, 64, 1)
    atlas.remember_nodes()
    found = atlas.pair(dark)
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
    stage()
    noded("Broken", "POINT", ies(text), energy=1, location=(0, 0, 2))
    atlas.configure(dark, 1, 0)
    dark.render.engine = ENGINE
    picture = pictures.render(dark)
    assert np.isfinite(picture).all()
    assert picture[..., :3].max() > 0
    told = [line for line in atlas.warnings(dark) if "IES Texture" in line and "Broken" in line]
    assert any(reason in line for line in told)


def test_photometric_files_are_read_from_disk(dark: Any, tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_text(FILE, encoding="latin-1")
    stage()
    means = []
    for path in (tmp_path / "lamp.ies", tmp_path / "missing.ies"):
        file = made("TexIES", mode="EXTERNAL", filepath=str(path))
        item = noded("Lamp", "POINT", file, location=(0, 0, 2))
        atlas.configure(dark, 4, 0)
        dark.render.engine = ENGINE
        means.append(pictures.render(dark)[..., :3].mean())
        assert bool(atlas.warnings(dark)) == (path.name == "missing.ies")
        bpy.data.objects.remove(item)
    assert 0 < means[0] < means[1]

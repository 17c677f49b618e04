# SPDX-License-Identifier: GPL-3.0-or-later
"""The light passes: they add up to the combined pass, and each is that of Cycles."""

from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read.passes import LIGHT_PASSES
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import made, tile_material
from tests.blender.exr_files import both, colours, exr
from tests.blender.shapes import cube, grid, lamp, look, place, world

KINDS = ("Diffuse", "Glossy", "Transmission")


paint = partial(made, "BsdfPrincipled")

leaf = made(
    "MixShader",
    0.6,
    made("BsdfTransparent"),
    made(
        "MixShader",
        0.5,
        made("BsdfTranslucent", Color=(0.3, 0.7, 0.1, 1)),
        made("BsdfDiffuse", Color=(0.2, 0.5, 0.1, 1)),
    ),
)
"""Light through both sides, and holes."""


MATERIALS: dict[str, atlas.Maker] = {
    "plastic": paint(Base_Color=(0.7, 0.2, 0.1, 1), Roughness=0.4),
    "metal": paint(Base_Color=(0.9, 0.6, 0.2, 1), Metallic=1.0, Roughness=0.3),
    "coat": paint(Base_Color=(0.1, 0.3, 0.6, 1), Coat_Weight=1.0, Coat_Roughness=0.2, Roughness=0.6),
    "glass": made("BsdfGlass", Color=(0.8, 0.9, 1.0, 1), Roughness=0.3),
    "mirror": made("BsdfGlossy", Color=(0.6, 0.7, 0.8, 1), Roughness=0.0),
    "leaf": leaf,
    "lamp": made("Emission", Color=(1.0, 0.7, 0.4, 1), Strength=2.0),
    "frost": paint(Base_Color=(0.6, 0.8, 0.7, 1), Transmission_Weight=1.0, Roughness=0.4),
}


@pytest.fixture
def shelf(scene: Any) -> Any:
    """Turned cubes of all kinds of lobes on a floor, in the light of an area, a sun and a world."""
    atlas.with_cycles(scene)
    for index, (name, make) in enumerate(MATERIALS.items()):
        where = {"location": (index % 4 * 3.0 - 4.5, index // 4 * 3.0, 0.3), "rotation_euler": (0.3, 0.2, 0.4 + index)}
        place(name, cube(name), tile_material(name, make), **where)
    frost, grey = tile_material("Pane", MATERIALS["frost"]), paint(Base_Color=(0.5, 0.5, 0.5, 1), Roughness=0.5)
    place("Pane", grid(1), frost, location=(2.5, 8.5, 0.8), rotation_euler=(1.57, 0, 0.1), scale=(2, 2, 1))
    place("Floor", grid(1), tile_material("Floor", grey), location=(0, 0, -1.2), scale=(9, 9, 1))
    # Seen through glass, a smaller sun would be noise.
    lamp("SUN", 2.0, angle=1.0, rotation_euler=(0.5, 0.3, 0))
    lamp("AREA", 400.0, size=2.0, location=(-3, -4, 5), rotation_euler=(0.6, -0.4, 0))
    world(0.2, 0.3, 0.5)
    look((64, 40), (0, -12, 7), 1.1)
    for light in LIGHT_PASSES:
        setattr(bpy.context.view_layer, light.switch, True)
    return scene


def passes_of(picture: dict[str, Any]) -> dict[str, Any]:
    """The light passes, and Combined, of a picture, as (h, w, 3) by their names since Blender 5.0."""
    names = {"Combined": "Combined"} | {light.name: light.in_blender for light in LIGHT_PASSES}
    return {name: colours(picture, own) for name, own in names.items()}


def total(found: dict[str, Any]) -> Any:
    """The sum of the passes."""
    scattered = sum((found[f"{kind} Direct"] + found[f"{kind} Indirect"]) * found[f"{kind} Color"] for kind in KINDS)
    return scattered + found["Emission"] + found["Environment"]


@pytest.mark.parametrize("integrator", ["path", "whitted", "ao"])
def test_light_passes_add_up_to_combined(shelf: Any, tmp_path: Path, integrator: str) -> None:
    atlas.configure(shelf, 8, 3)
    shelf.render.engine, shelf.halfspace.integrator = ENGINE, integrator
    shelf.halfspace.film_exposure = 1.7
    shelf.halfspace.clamp_indirect = 2.0
    found = passes_of(exr(shelf, tmp_path / "picture.exr"))
    assert found["Combined"].std() > 0.1
    assert np.allclose(total(found), found["Combined"], rtol=1e-4, atol=1e-5)


def test_each_light_pass_is_that_of_cycles(shelf: Any, tmp_path: Path) -> None:
    atlas.configure(shelf, 400, 3)
    for settings in (shelf.halfspace, shelf.cycles):  # their noise would hide small differences
        settings.caustics_reflective = settings.caustics_refractive = False
    found = [passes_of(channels) for channels in both(shelf, tmp_path)]
    theirs = found[1]
    assert np.allclose(total(theirs), theirs["Combined"], rtol=1e-3, atol=1e-4), "the definition is that of Cycles"
    wrong = {}
    whole = theirs["Combined"].mean()
    for name in theirs:
        # Light is compared multiplied by its colour, because quotients are noisy at the edges of colours.
        kind, _, part = name.partition(" ")
        factors = [one[f"{kind} Color"] if part in ("Direct", "Indirect") else 1.0 for one in found]
        means = [(one[name] * factor).mean(axis=(0, 1)) for one, factor in zip(found, factors, strict=True)]
        assert means[1].mean() > 1e-3, name
        # Colours of rough glass are approximate in both engines. Dim passes differ by a part of the whole picture.
        allowed = 0.03 if name in ("Glossy Color", "Transmission Color") else 0.01
        if not np.abs(means[0] - means[1]).max() < allowed * means[1].mean() + 0.002 * whole:
            wrong[name] = means
    assert not wrong


def test_light_passes_do_not_depend_on_the_others(shelf: Any, tmp_path: Path) -> None:
    atlas.configure(shelf, 4, 2)
    shelf.render.engine = ENGINE
    every = exr(shelf, tmp_path / "every.exr")
    one = LIGHT_PASSES[4]
    for light in LIGHT_PASSES:
        setattr(bpy.context.view_layer, light.switch, light is one)
    alone = exr(shelf, tmp_path / "one.exr")
    assert {name.split(".")[0] for name in alone} == {"Combined", one.in_blender}
    assert all(np.array_equal(alone[name], every[name]) for name in alone)
    setattr(bpy.context.view_layer, one.switch, False)
    none = exr(shelf, tmp_path / "none.exr")
    assert all(np.array_equal(none[name], every[name]) for name in none)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Subsurface scattering compared with Cycles: closed balls in the light of a world and of a sun."""

from functools import partial
from typing import Any

import bpy
import numpy as np
import pytest

from tests.blender import atlas
from tests.blender.atlas import add, made, place
from tests.blender.shapes import lamp, sphere, world

BOUNCES = 1
NEW = bpy.app.version >= (5, 2)
"""Whether radii are mean free paths, and not those of older profiles."""

LONG = 1.0 if NEW else 12.0
"""Factor on the radii of the method Random Walk."""


def ball(*, smooth: bool = True) -> Any:
    """A closed sphere of 0.9 units."""
    return sphere(32, 0.45, smooth=smooth)


scattering = partial(made, "SubsurfaceScattering")
principled = partial(made, "BsdfPrincipled")


def textured(tree: Any) -> Any:
    """Colours and a bump that vary."""
    noise = add(tree, "TexNoise", Vector=place, Scale=1.5, Detail=1.0)
    bump = made("Bump", Height=noise.outputs[0], Distance=0.1)
    return scattering(Color=noise.outputs["Color"], Normal=bump, Scale=0.05 * LONG)(tree)


SKIN = {"Base_Color": (0.8, 0.5, 0.4, 1), "Subsurface_Radius": (1.0, 0.4, 0.2), "Subsurface_Scale": 0.1 * LONG}

BALLS = {
    "random walk": scattering(Color=(0.8, 0.5, 0.2, 1), Scale=0.1 * LONG, Radius=(1, 0.5, 0.25)),
    "forward": scattering(Color=(0.8, 0.6, 0.4, 1), Scale=0.2 * LONG, Radius=(1, 1, 1), Anisotropy=0.6),
    "skin": scattering(falloff="RANDOM_WALK_SKIN", Color=(0.8, 0.5, 0.2, 1), Scale=0.5, Radius=(1, 0.5, 0.25)),
    "thin": scattering(Color=(0.9, 0.9, 0.9, 1), Scale=1.0 * LONG, Radius=(1, 0.3, 0.0)),
    "dense": scattering(Color=(0.5, 0.5, 0.5, 1), Scale=0.002 * LONG, Radius=(1, 1, 1)),
    "principled": principled(Subsurface_Weight=1.0, Roughness=0.4, **SKIN),
    "half": principled(Subsurface_Weight=0.5, Subsurface_Anisotropy=0.4, Roughness=0.7, **SKIN),
    "principled skin": principled(subsurface_method="RANDOM_WALK_SKIN", Subsurface_Weight=1.0, **SKIN),
    "textured": textured,
}
if NEW:
    BALLS["legacy"] = scattering(falloff="RANDOM_WALK_LEGACY", Color=(0.8, 0.5, 0.2, 1), Scale=1.0, Anisotropy=0.3)


@pytest.fixture(name="lit")
def lights(scene: Any) -> Any:
    """A scene with a dim world and a sun from the side."""
    world()
    lamp("SUN", 3.0, angle=0.5, rotation_euler=(1.1, 0.3, 0))
    return scene


def test_walks_are_those_of_cycles(lit: Any) -> None:
    atlas.sheet(lit, BALLS, ball())
    # Cycles before Blender 5.2 is up to 3.6 % darker.
    atlas.assert_alike(lit, BALLS, samples=256, bounces=BOUNCES, mean=0.01 if NEW else 0.04)


def test_a_white_furnace_stays_white(scene: Any) -> None:
    # Flat facets: corner normals send a part of the light back into the ball, in Cycles as well.
    white = {"Color": (1, 1, 1, 1), "Radius": (1, 1, 1)}
    balls = {
        "walk": scattering(Scale=0.3 * LONG, **white),
        "forward": scattering(Scale=0.05 * LONG, Anisotropy=0.8, **white),
        "skin": scattering(falloff="RANDOM_WALK_SKIN", Scale=50.0, **white),
    }
    world(1, 1, 1)
    atlas.sheet(scene, balls, ball(smooth=False))
    atlas.configure(scene, 2048, 12)
    for name, tile in atlas.rendered(scene, balls, "HALFSPACE").items():
        middle = tile[4:-4, 4:-4].astype(float).mean(axis=(0, 1))
        assert np.abs(middle - 1).max() < 0.002, (name, middle)


def test_the_profile_of_christensen_and_burley_is_named(lit: Any) -> None:
    family = {"profile": scattering(falloff="BURLEY")}
    atlas.sheet(lit, family, ball())
    atlas.configure(lit, 1, BOUNCES)
    atlas.rendered(lit, family, "HALFSPACE")
    assert any("Christensen-Burley" in line for line in atlas.warnings(lit))

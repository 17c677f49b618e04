# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes compared with Cycles: balls in the light of a world and of two suns, one of them behind."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.blender import atlas
from tests.blender.atlas import made, place
from tests.blender.shapes import ball, lamp, world

BOUNCES = 1


def shader(kind: str, **settings: Any) -> atlas.Maker:
    return made(f"Bsdf{kind}", **settings)


def bumped(kind: str, *, height: atlas.Maker, bump: dict[str, Any], **settings: Any) -> atlas.Maker:
    """A shader whose normal is that of a bump."""
    return shader(kind, Normal=made("Bump", Height=height, **bump), **settings)


noise = made("TexNoise", Vector=place, Scale=1.5, Detail=1.0)
rings = made("TexWave", made("UVMap"), wave_type="RINGS", Scale=1.5, output="Color")
facing = made("VectorMath", made("Bump", Height=rings, Distance=0.2), (0.6, 0, 0.8), operation="DOT_PRODUCT", output=1)
bump_within = made("Math", facing, noise)
"""A height that is noise and the facing of another bump's normal."""


def mixed(share: float, one: atlas.Maker, other: atlas.Maker) -> atlas.Maker:
    return made("MixShader", share, one, other)


DIFFUSE = {
    "lambert": shader("Diffuse", Color=(0.8, 0.5, 0.3, 1)),
    "rough": shader("Diffuse", Color=(0.8, 0.5, 0.3, 1), Roughness=1.0),
    "half rough": shader("Diffuse", Color=(0.9, 0.9, 0.2, 1), Roughness=0.4),
    "rough base": shader("Principled", Base_Color=(0.7, 0.3, 0.6, 1), Diffuse_Roughness=0.9),
    "rough base below a coat": shader("Principled", Diffuse_Roughness=0.5, Coat_Weight=0.7, Coat_Roughness=0.5),
}

TRANSLUCENT = {
    "translucent": shader("Translucent", Color=(0.8, 0.5, 0.3, 1)),
    "mixed with gloss": mixed(
        0.4,
        shader("Translucent", Color=(0.2, 0.9, 0.3, 1)),
        shader("Glossy", Color=(0.8, 0.7, 0.6, 1), Roughness=0.4),
    ),
}


TANGENT = made("Tangent", direction_type="UV_MAP")

STRETCHED = {
    "principled": shader("Principled", Roughness=0.6, Anisotropic=0.7, Metallic=1.0),
    "base": shader("Principled", Roughness=0.5, Anisotropic=0.9, Anisotropic_Rotation=0.2),
    "gloss": shader("Anisotropic", distribution="GGX", Roughness=0.6, Anisotropy=0.5),
    "gloss across": shader("Anisotropic", Roughness=0.6, Anisotropy=-0.5, Rotation=0.1),
    "metallic": shader("Metallic", Roughness=0.6, Anisotropy=0.7, Rotation=0.3),
    "along UV": shader("Principled", Roughness=0.6, Anisotropic=0.7, Metallic=1.0, Tangent=TANGENT),
}

DISTRIBUTIONS = {
    "beckmann": shader("Anisotropic", distribution="BECKMANN", Roughness=0.5),
    "beckmann stretched": shader("Anisotropic", distribution="BECKMANN", Roughness=0.5, Anisotropy=0.5),
    "beckmann metal": shader("Metallic", distribution="BECKMANN", Roughness=0.6),
    "beckmann glass": shader("Glass", distribution="BECKMANN", Roughness=0.5),
    "beckmann window": shader("Refraction", distribution="BECKMANN", Roughness=0.4),
    "ashikhmin": shader("Anisotropic", distribution="ASHIKHMIN_SHIRLEY", Roughness=0.5),
    "ashikhmin stretched": shader("Anisotropic", distribution="ASHIKHMIN_SHIRLEY", Roughness=0.5, Anisotropy=0.5),
    "conductor": shader("Metallic", fresnel_type="PHYSICAL_CONDUCTOR", Roughness=0.6),
    "rough conductor": shader("Metallic", fresnel_type="PHYSICAL_CONDUCTOR", Roughness=0.8, distribution="GGX"),
}

SHEEN = {
    "layer": shader("Principled", Sheen_Weight=1.0, Sheen_Roughness=0.5),
    "tinted layer": shader("Principled", Sheen_Weight=0.7, Sheen_Roughness=0.3, Sheen_Tint=(1.0, 0.4, 0.2, 1)),
    "coated": shader("Principled", Sheen_Weight=1.0, Sheen_Roughness=0.8, Coat_Weight=0.5, Coat_Roughness=0.3),
    "over emission": shader("Principled", Sheen_Weight=1.0, Emission_Strength=0.4, Base_Color=(0, 0, 0, 1)),
    "fibers": shader("Sheen", Roughness=0.6),
    "fine fibers": shader("Sheen", Roughness=0.2),
    "velvet": shader("Sheen", distribution="ASHIKHMIN", Roughness=0.5),
    "fine velvet": shader("Sheen", distribution="ASHIKHMIN", Roughness=0.2),
}

TOON = {
    "diffuse": shader("Toon", Size=0.4, Smooth=0.2),
    "hard": shader("Toon", Size=0.6),
    "glossy": shader("Toon", component="GLOSSY", Size=0.3, Smooth=0.3),
    "wide": shader("Toon", component="GLOSSY", Size=0.9, Smooth=0.9),
}

FILMS = {
    "on a base": shader("Principled", Roughness=0.6, Thin_Film_Thickness=400.0),
    "thick": shader("Principled", Roughness=0.6, Thin_Film_Thickness=1200.0, Thin_Film_IOR=1.8),
    "thin": shader("Principled", Roughness=0.6, Thin_Film_Thickness=20.0, Thin_Film_IOR=2.0),
    "dark": shader("Principled", Base_Color=(0, 0, 0, 1), IOR=2.0, Roughness=0.6, Thin_Film_Thickness=120.0),
    "tinted": shader(
        "Principled",
        Base_Color=(0, 0, 0, 1),
        Roughness=0.6,
        Specular_Tint=(0.8, 0.3, 0.2, 1),
        Thin_Film_Thickness=300.0,
    ),
    "on glass": shader("Glass", Roughness=0.6, Thin_Film_Thickness=500.0, Thin_Film_IOR=1.8),
    "transmission": shader("Principled", Roughness=0.6, Transmission_Weight=1.0, Thin_Film_Thickness=500.0),
    "on metal": shader("Principled", Metallic=1.0, Roughness=0.6, Thin_Film_Thickness=500.0),
    "on copper": shader("Metallic", Base_Color=(0.9, 0.5, 0.3, 1), Roughness=0.6, Thin_Film_Thickness=350.0),
    "on a conductor": shader(
        "Metallic", fresnel_type="PHYSICAL_CONDUCTOR", Roughness=0.6, Thin_Film_Thickness=350.0, Thin_Film_IOR=1.6
    ),
}


BUMPS = {
    "matte": bumped("Diffuse", height=noise, bump={"Distance": 0.2}),
    "inverted": bumped("Diffuse", height=noise, bump={"Distance": 0.2, "invert": True}),
    "weak": bumped("Diffuse", height=noise, bump={"Distance": 0.3, "Strength": 0.4}),
    "gloss": bumped("Glossy", height=noise, bump={"Distance": 0.1}, Roughness=0.3),
    "rings": bumped("Diffuse", height=rings, bump={"Distance": 0.03}),
    "within": bumped("Diffuse", height=bump_within, bump={"Distance": 0.2}),
    "rough": bumped("Diffuse", height=noise, bump={"Distance": 0.2}, Roughness=0.8),
    "principled": bumped("Principled", height=noise, bump={"Distance": 0.15}, Roughness=0.4),
}

NORMALS = {
    # Half flat and matte, half bumped and glossy.
    "two normals": mixed(0.5, shader("Diffuse"), bumped("Glossy", height=noise, bump={"Distance": 0.1}, Roughness=0.5)),
    "coat alone": shader(
        "Principled", Coat_Weight=1.0, Coat_Roughness=0.5, Coat_Normal=made("Bump", Height=noise, Distance=0.1)
    ),
    "smooth coat": bumped(
        "Principled", height=noise, bump={"Distance": 0.1}, Roughness=0.5, Coat_Weight=1.0, Coat_Roughness=0.5
    ),
    "velvet": bumped("Sheen", height=noise, bump={"Distance": 0.1}),
    "stretched": bumped("Principled", height=noise, bump={"Distance": 0.05}, Anisotropic=0.7, Roughness=0.6),
}

FAMILIES = {
    "diffuse": DIFFUSE,
    "translucent": TRANSLUCENT,
    "bump": BUMPS,
    "stretched": STRETCHED,
    "distributions": DISTRIBUTIONS,
    "sheen": SHEEN,
    "toon": TOON,
    "normals": NORMALS,
    "films": FILMS,
}


@pytest.fixture(name="lit")
def lights(scene: Any) -> Any:
    """A scene with a dim world, a sun from above and one from below."""
    world()
    for tilt, energy in ((0.6, 2.0), (2.4, 1.5)):
        lamp("SUN", energy, angle=0.1, rotation_euler=(tilt, 0.3, 0))
    return scene


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_shaders_are_those_of_cycles(lit: Any, family: dict[str, atlas.Maker]) -> None:
    if family is FILMS and bpy.app.version < (5, 0):
        # Its Glass and Metallic have no inputs of films; those of its Principled differ by up to 4 %.
        family = {name: make for name, make in FILMS.items() if name in ("on a base", "thick", "thin")}
    # Highlights of suns on bent and stretched facets are noisier than matte surfaces. Blender 4.5 differs in how nodes
    # are read, which fewer samples show.
    coarse = bpy.app.version < (5, 0) and family not in (DIFFUSE, TRANSLUCENT, BUMPS)
    samples = 256 if coarse or family in (DIFFUSE, TRANSLUCENT) else 1024
    atlas.sheet(lit, family, ball())
    limits = {"mean": 0.05 if coarse else 0.01, "alike": None if coarse else 0.95}
    atlas.assert_alike(lit, family, samples=samples, bounces=BOUNCES, **limits)


LEAVES = {
    "leaf": shader("Principled", Thin_Wall=True, Subsurface_Weight=1.0, Base_Color=(0.3, 0.8, 0.2, 1)),
    "forward": shader("Principled", Thin_Wall=True, Subsurface_Weight=0.7, Subsurface_Anisotropy=0.6),
    "coated": shader("Principled", Thin_Wall=True, Subsurface_Weight=1.0, Coat_Weight=0.8, Coat_Roughness=0.4),
    "plain": shader("Principled", Thin_Wall=True),
}

PANES = {
    "clear": shader("Principled", Thin_Wall=True, Transmission_Weight=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1)),
    "tinted": shader(
        "Principled", Thin_Wall=True, Transmission_Weight=1.0, Roughness=0.0, Base_Color=(0.2, 0.9, 0.7, 1)
    ),
    "dense": shader("Principled", Thin_Wall=True, Transmission_Weight=1.0, Roughness=0.0, IOR=2.2),
    "half": shader("Principled", Thin_Wall=True, Transmission_Weight=0.5, Roughness=0.0, Alpha=0.8),
    "metal": shader("Principled", Thin_Wall=True, Transmission_Weight=0.6, Metallic=0.3, Roughness=0.02),
}


@pytest.mark.parametrize(("family", "bounces", "mean"), [(LEAVES, 1, 0.01), (PANES, 6, 0.02)], ids=["leaves", "panes"])
def test_thin_walls_are_those_of_cycles(lit: Any, family: dict[str, atlas.Maker], bounces: int, mean: float) -> None:
    if bpy.app.version < (5, 2):
        pytest.skip("new in Blender 5.2")
    atlas.sheet(lit, family, ball())
    # Few paths meet suns in mirrors, which would hide all else in noise.
    for item in lit.objects:
        if item.type == "LIGHT" and family is PANES:
            item.visible_glossy = item.visible_transmission = False
    atlas.assert_alike(lit, family, samples=512, bounces=bounces, mean=mean)


def test_rough_thin_glass_is_named(lit: Any) -> None:
    if bpy.app.version < (5, 2):
        pytest.skip("new in Blender 5.2")
    family = {"frosted": shader("Principled", Thin_Wall=True, Transmission_Weight=1.0, Roughness=0.4)}
    atlas.sheet(lit, family, ball())
    atlas.configure(lit, 1, 0)
    atlas.rendered(lit, family, "HALFSPACE")
    assert any("rough transmission of a Thin Wall" in line for line in atlas.warnings(lit))


def test_a_bump_changes_the_picture_and_a_flat_one_does_not(lit: Any) -> None:
    family = {
        "plain": shader("Diffuse"),
        "flat": bumped("Diffuse", height=made("Value"), bump={"Distance": 1.0}),
        "none": bumped("Diffuse", height=noise, bump={"Distance": 0.2, "Strength": 0.0}),
        "bump": BUMPS["matte"],
    }
    atlas.sheet(lit, family, ball())
    atlas.configure(lit, 64, 0)
    found = atlas.rendered(lit, family, "HALFSPACE")
    plain = found.pop("plain")
    changed = {name for name, tile in found.items() if ((tile - plain) ** 2).mean() ** 0.5 > 0.1 * plain.mean()}
    assert changed == {"bump"}


def alphas(lit: Any, family: dict[str, atlas.Maker]) -> list[float]:
    """The alphas in the middle of the tiles, whose means are those of Cycles."""
    lit.render.film_transparent = True
    atlas.configure(lit, 256, BOUNCES)
    ours, theirs = (atlas.rendered(lit, family, engine, channels=4) for engine in ("HALFSPACE", "CYCLES"))
    for name in family:
        means = [one[name].mean(axis=(0, 1)) for one in (ours, theirs)]
        assert np.abs(means[0] - means[1]).max() < 0.01, (name, means)
    return [round(float(tile[8:12, 8:12, 3].mean()), 1) for tile in ours.values()]


def test_a_holdout_is_a_hole_in_the_picture_as_in_cycles(lit: Any) -> None:
    half = mixed(0.3, shader("Diffuse"), made("Holdout"))
    family = {"whole": made("Holdout"), "half": half, "none": shader("Diffuse")}
    atlas.sheet(lit, family, ball())
    assert alphas(lit, family) == [0.0, 0.7, 1.0]


@pytest.mark.parametrize("alpha", [1.0, 0.4])
def test_an_object_that_is_a_holdout_is_a_hole_as_in_cycles(lit: Any, alpha: float) -> None:
    family = {"held": shader("Principled", Alpha=alpha), "none": shader("Diffuse")}
    atlas.sheet(lit, family, ball())
    lit.objects["held"].is_holdout = True
    assert alphas(lit, family) == [0.0, 1.0]


def test_a_world_sees_the_depth_of_rays(scene: Any) -> None:
    background = world()
    bright = made("Math", made("LightPath", output="Ray Depth"), 0.3)(scene.world.node_tree)
    scene.world.node_tree.links.new(bright, background.inputs["Strength"])
    family = {"matte": shader("Diffuse"), "gloss": shader("Glossy", Roughness=0.5), "clear": shader("Transparent")}
    atlas.sheet(scene, family, ball())
    ours, theirs = atlas.both(scene, family, samples=256, bounces=2)
    assert not atlas.differences(ours, theirs, alike=None)
    assert ours["matte"].max() > ours["clear"].max() > 0.0

# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter Glossy, caustics and exposure compared with Cycles with the same settings."""

from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.blender.render import engine
from addon.lab.pictures import proving_parts as parts
from tests.blender import atlas
from tests.blender.exr_files import colours, render

WIDTH, HEIGHT = 48, 32
SAMPLES, BOUNCES = 1024, 4


@pytest.fixture
def stage(scene: Any) -> Any:
    """A matte floor between a chrome wall, glass and coated balls, in the light of a lamp."""
    atlas.with_cycles(scene)
    parts.new_world(scene, (0.2, 0.25, 0.3))
    parts.wear(parts.plane(scene, 6), parts.one_shader("Floor", "BsdfDiffuse", Color=(0.6, 0.6, 0.6, 1)))
    wall = parts.box(scene, (0, 2.2, 1.5), (3, 0.1, 1.5))
    parts.wear(wall, parts.principled("Chrome", (0.9, 0.9, 0.9), Metallic=1, Roughness=0.1))
    parts.wear(
        parts.sphere(scene, (-1.2, 0, 0.8), 0.8), parts.one_shader("Glass", "BsdfGlass", Roughness=0.05, IOR=1.5)
    )
    coated = parts.principled("Coated", (0.5, 0.1, 0.1), Roughness=0.3, Coat_Weight=1, Coat_Roughness=0.05)
    parts.wear(parts.sphere(scene, (1.2, 0, 0.8), 0.8), coated)
    parts.lamp(scene, "AREA", (-2, -3, 5), (0, 0, 0), energy=600, size=2.0)
    parts.look(scene, (0, -8, 3), (0, 0, 0.6), 34)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    return scene


def prepared(scene: Any, *, filter_glossy: float, reflective: bool, refractive: bool) -> None:
    """Give both engines the same settings."""
    atlas.configure(scene, SAMPLES, BOUNCES)
    ours, theirs = scene.halfspace, scene.cycles
    ours.filter_glossy, ours.caustics_reflective, ours.caustics_refractive = filter_glossy, reflective, refractive
    theirs.blur_glossy, theirs.caustics_reflective, theirs.caustics_refractive = filter_glossy, reflective, refractive


def means(scene: Any, name: str, folder: Path) -> Any:
    """Mean colours of the picture of an engine."""
    scene.render.engine = name
    return colours(render(scene, folder)).mean(axis=(0, 1))


@pytest.mark.parametrize(
    ("filter_glossy", "reflective", "refractive"),
    [(1.0, True, True), (10.0, True, True), (0.0, False, True), (0.0, True, False), (1.0, False, False)],
)
def test_means_are_those_of_cycles(
    stage: Any, tmp_path: Path, filter_glossy: float, reflective: bool, refractive: bool
) -> None:
    prepared(stage, filter_glossy=filter_glossy, reflective=reflective, refractive=refractive)
    ours, theirs = means(stage, engine.ENGINE, tmp_path), means(stage, "CYCLES", tmp_path)
    assert ours == pytest.approx(theirs, rel=0.01)


def test_caustics_and_exposure_have_an_effect(stage: Any, tmp_path: Path) -> None:
    prepared(stage, filter_glossy=0.0, reflective=True, refractive=True)
    stage.halfspace.samples = 64
    every = means(stage, engine.ENGINE, tmp_path)
    for name in ("caustics_reflective", "caustics_refractive"):
        setattr(stage.halfspace, name, False)
        assert (means(stage, engine.ENGINE, tmp_path) < 0.99 * every).all(), name
        setattr(stage.halfspace, name, True)
    stage.halfspace.film_exposure = 2.0
    assert means(stage, engine.ENGINE, tmp_path) == pytest.approx(2 * every, rel=1e-5)


def test_defaults_are_those_of_cycles(stage: Any) -> None:
    for ours, theirs in (
        ("filter_glossy", "blur_glossy"),
        ("caustics_reflective", "caustics_reflective"),
        ("caustics_refractive", "caustics_refractive"),
        ("clamp_direct", "sample_clamp_direct"),
        ("clamp_indirect", "sample_clamp_indirect"),
        ("film_exposure", "film_exposure"),
        ("pixel_filter_type", "pixel_filter_type"),
        ("filter_width", "filter_width"),
    ):
        properties = bpy.context.scene.cycles.bl_rna.properties
        assert stage.halfspace.bl_rna.properties[ours].default == properties[theirs].default, ours

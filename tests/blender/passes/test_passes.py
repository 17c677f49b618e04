# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes and the lens, compared with those of Cycles, which defines them in Blender."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read import passes
from addon.blender.render import engine
from tests.blender.exr_files import exr
from tests.blender.shapes import cube, grid, lamp, look, material, node, place, world

WIDTH, HEIGHT = 64, 48
BACKGROUND = 1e9
"""Depths beyond are those of nothing."""


def set_up(scene: Any, name: str, samples: int) -> None:
    """Choose an engine, with the same pixel filter and nothing clever."""
    scene.render.engine = name
    if name == "CYCLES":
        scene.cycles.samples = samples
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.cycles.max_bounces, scene.cycles.filter_width = 2, 1.5
    else:
        scene.halfspace.samples, scene.halfspace.max_bounces = samples, 2


def both(scene: Any, folder: Path, samples: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """The channels of our picture and of that of Cycles."""
    pictures = []
    for name in (engine.ENGINE, "CYCLES"):
        set_up(scene, name, samples)
        pictures.append(exr(scene, folder / f"{name}.exr"))
    return pictures[0], pictures[1]


@pytest.fixture
def stage(scene: Any) -> Any:
    """Two numbered cubes on a floor in mist, seen from above at an angle."""
    for number, (name, where) in enumerate((("Left", (-1.6, 0, 0)), ("Right", (1.6, 1, 0))), 1):
        paint = material(f"Paint {name}", Base_Color=(0.2 * number, 0.5, 0.4, 1))
        paint.pass_index = 10 * number
        place(name, cube(name), paint, location=where, rotation_euler=(0, 0, 0.4 * number), pass_index=number)
    place("Floor", grid(3), location=(0, 0, -1), scale=(9, 9, 1))
    lamp("SUN", rotation_euler=(0.5, 0.3, 0))
    look((WIDTH, HEIGHT), (0, -8, 5), 1.05)
    world(0.2, 0.2, 0.2)
    mist = scene.world.mist_settings
    mist.start, mist.depth = 6.0, 9.0
    return scene


def alike(ours: Any, theirs: Any, tolerance: float) -> float:
    """The share of pixels that differ by less than the tolerance."""
    return float((np.abs(ours - theirs) <= tolerance).mean())


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_passes_are_those_of_cycles(stage: Any, tmp_path: Path, kind: str) -> None:
    stage.camera.data.type = kind
    stage.camera.data.ortho_scale = 9.0
    layer = bpy.context.view_layer
    names = ("z", "mist", "normal", "position", "uv", "object_index", "material_index")
    for name in names:
        setattr(layer, f"use_pass_{name}", True)
    ours, theirs = both(stage, tmp_path, 16)
    of = {shown.name: shown.in_blender for shown in passes.PASSES}

    # One sample each, anywhere in its pixel: pixels at edges may see one thing or the other.
    for name in ("Object Index", "Material Index"):
        channel = f"{of[name]}.X"
        assert set(np.unique(ours[channel])) == set(np.unique(theirs[channel]))
        assert len(np.unique(ours[channel])) == 3
        assert alike(ours[channel], theirs[channel], 0) > 0.93
    depth, expected = ours["Depth.Z"], theirs["Depth.Z"]
    seen = (depth < BACKGROUND) & (expected < BACKGROUND)
    assert ((depth > BACKGROUND) == (expected > BACKGROUND)).mean() > 0.97
    assert alike(depth[seen], expected[seen], 0.4) > 0.93
    for axis in "XYZ":
        assert alike(ours[f"Position.{axis}"][seen], theirs[f"Position.{axis}"][seen], 0.5) > 0.9
        # Means over a pixel's samples, noisy at edges only.
        uv = f"UV.{'UVA'['XYZ'.index(axis)]}"
        assert alike(ours[uv], theirs[uv], 0.05) > 0.8
        assert abs(ours[uv].mean() - theirs[uv].mean()) < 0.01
        assert alike(ours[f"Normal.{axis}"], theirs[f"Normal.{axis}"], 0.02) > 0.8
        assert abs(ours[f"Normal.{axis}"].mean() - theirs[f"Normal.{axis}"].mean()) < 0.01
    assert alike(ours["Mist.Z"], theirs["Mist.Z"], 0.03) > 0.93
    assert abs(ours["Mist.Z"].mean() - theirs["Mist.Z"].mean()) < 0.005
    assert 0.1 < ours["Mist.Z"].mean() < 0.9


@pytest.mark.parametrize("falloff", ["LINEAR", "INVERSE_QUADRATIC"])
def test_mist_grows_as_in_cycles(stage: Any, tmp_path: Path, falloff: str) -> None:
    stage.world.mist_settings.falloff = falloff
    bpy.context.view_layer.use_pass_mist = True
    ours, theirs = both(stage, tmp_path, 8)
    assert abs(ours["Mist.Z"].mean() - theirs["Mist.Z"].mean()) < 0.005


LENSES = {
    "triangle": {"aperture_blades": 3, "aperture_rotation": 0.5},
    "anamorphic": {"aperture_blades": 5, "aperture_ratio": 2.0},
    "parallel": {"aperture_blades": 0, "aperture_fstop": 1.5},
}


@pytest.mark.parametrize("name", LENSES)
def test_objects_out_of_focus_are_blurred_as_in_cycles(scene: Any, tmp_path: Path, name: str) -> None:
    """A small bright plate before black shows the shape of the aperture."""
    bright = material("Bright", Base_Color=(0, 0, 0, 1), Emission_Strength=20.0, Emission_Color=(1, 1, 1, 1))
    turned = {"scale": (0.15, 0.1, 1), "location": (0.1, 0, -0.05), "rotation_euler": (np.pi / 2, 0, 0)}
    place("Plate", grid(1, "Plate"), bright, **turned)
    data = look((WIDTH, HEIGHT), (0, -4, 0), np.pi / 2).data
    data.dof.use_dof = True
    data.dof.focus_distance, data.dof.aperture_fstop = 2.0, 0.04
    for key, value in LENSES[name].items():
        setattr(data.dof, key, value)
    if name == "parallel":
        data.type, data.ortho_scale = "ORTHO", 3.0
        data.dof.focus_object = place("Focus", None, location=(5, -2, 3))
        data.dof.focus_distance = 4.0  # which does not count then
    scene.world = None
    ours, theirs = both(scene, tmp_path, 512)
    ours, theirs = (coarse(picture["Combined.R"]) for picture in (ours, theirs))
    assert (theirs > 0.02 * theirs.max()).sum() > 12, "it is blurred"
    assert abs(ours.sum() / theirs.sum() - 1) < 0.02
    assert np.abs(ours - theirs).sum() / theirs.sum() < 0.12


def coarse(picture: Any, side: int = 4) -> Any:
    """Means over squares of pixels, which are less noisy."""
    height, width = picture.shape
    return picture.reshape(height // side, side, width // side, side).mean(axis=(1, 3))


def test_fewer_samples_where_there_is_no_noise(stage: Any, tmp_path: Path) -> None:
    set_up(stage, engine.ENGINE, 64)
    stage.camera.rotation_euler.x = 1.4  # half of it is sky
    bpy.context.view_layer.halfspace.use_pass_samples = True
    whole = exr(stage, tmp_path / "whole.exr")
    assert (whole["Sample Count.X"] == 64).all()
    stage.halfspace.use_adaptive, stage.halfspace.noise_threshold = True, 0.05
    parts = []
    for threads in (1, 3):
        stage.render.threads_mode, stage.render.threads = "FIXED", threads
        parts.append(exr(stage, tmp_path / f"{threads}.exr"))
    assert set(np.unique(parts[0]["Sample Count.X"])) == {48, 64}
    assert np.abs(parts[0]["Combined.G"] - whole["Combined.G"]).mean() < 0.01
    assert all(np.array_equal(parts[0][name], parts[1][name]) for name in parts[0])


def test_a_time_limit_ends_a_picture_that_would_take_forever(stage: Any, tmp_path: Path) -> None:
    set_up(stage, engine.ENGINE, 1 << 20)
    stage.halfspace.time_limit = 0.2
    bpy.context.view_layer.halfspace.use_pass_samples = True
    picture = exr(stage, tmp_path / "picture.exr")
    assert 1 <= picture["Sample Count.X"].min() < 1 << 20
    assert picture["Combined.G"].min() > 0.01


def test_the_albedo_is_the_colour_of_matt_paint(stage: Any, tmp_path: Path) -> None:
    set_up(stage, engine.ENGINE, 4)
    stage.halfspace.max_bounces = 0
    for name in ("Left", "Right"):
        shader = node(bpy.data.materials[f"Paint {name}"].node_tree, "ShaderNodeBsdfPrincipled")
        shader.inputs["Specular IOR Level"].default_value = 0.0
    layer = bpy.context.view_layer
    layer.halfspace.use_pass_albedo = layer.use_pass_material_index = True
    picture = exr(stage, tmp_path / "picture.exr")
    material_index = next(shown for shown in passes.PASSES if shown.name == "Material Index")
    number = picture[f"{material_index.in_blender}.X"]
    for paint, red in ((10, 0.2), (20, 0.4)):
        assert np.median(picture["Denoising Albedo.R"][number == paint]) == pytest.approx(red, rel=0.01)
        assert np.median(picture["Denoising Albedo.G"][number == paint]) == pytest.approx(0.5, rel=0.01)


def test_the_depth_of_leaves_is_seen(stage: Any, tmp_path: Path) -> None:
    set_up(stage, engine.ENGINE, 1)
    bpy.context.view_layer.halfspace.use_pass_depth = True
    depth = exr(stage, tmp_path / "picture.exr")["Leaf Depth.X"]
    assert depth.min() >= 0
    assert 0 < depth.max() < 64
    stage.halfspace.structure = "brute"
    assert (exr(stage, tmp_path / "picture.exr")["Leaf Depth.X"] == 0).all()

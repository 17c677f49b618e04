# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers compared with those of Cycles."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.exr_files import both
from tests.blender.shapes import cube, grid, lamp, look, material, place, world


@pytest.fixture
def staged(scene: Any) -> Any:
    """A cube over a catching floor that ends within the picture, in the light of a square lamp and a world."""
    atlas.with_cycles(scene)
    matt = material("Floor", Base_Color=(0.7, 0.6, 0.5, 1), Roughness=0.8)
    place("Floor", grid(1, "Floor"), matt, scale=(3.2, 3.2, 1), is_shadow_catcher=True)
    paint = material("Box", Base_Color=(0.6, 0.1, 0.05, 1), Roughness=0.5)
    place("Box", cube("Box", 1.2), paint, location=(0, 0.2, 0.9), rotation_euler=(0.2, 0.1, 0.5))
    lamp("AREA", 300.0, size=1.5, location=(2.5, -1, 4), rotation_euler=(0.2, 0.55, 0))
    world(0.4, 0.5, 0.6)
    look((48, 40), (0, -8, 5), 1.0, lens=40.0)
    atlas.configure(scene, 100, 3)
    return scene


def blocks(values: Any) -> Any:
    """The means of squares of 8 × 8 pixels."""
    height, width = values.shape[:2]
    return values.reshape(height // 8, 8, width // 8, 8, -1).mean(axis=(1, 3))


@pytest.mark.parametrize("transparent", [True, False])
def test_the_picture_is_that_of_cycles(staged: Any, transparent: bool) -> None:
    staged.render.film_transparent = transparent
    ours, theirs = atlas.pair(staged, 4)
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 0.01 * theirs.mean()
    apart = np.abs(blocks(ours) - blocks(theirs))
    # Cycles darkens pixels of the background that an object shares with a catcher.
    assert apart.max() < (0.02 if transparent else 0.05)
    assert np.median(apart) < 0.003
    if transparent:
        assert 0.4 < blocks(ours)[..., 3].max() < 1
        assert (blocks(ours)[..., 3] > 0.1).sum() > 4, "the shadow and the box"


def test_the_pass_is_that_of_cycles(staged: Any, tmp_path: Path) -> None:
    staged.render.film_transparent = True
    layer = bpy.context.view_layer
    layer.halfspace.use_pass_shadow_catcher = layer.cycles.use_pass_shadow_catcher = True
    layer.use_pass_diffuse_direct = True
    ours, theirs = both(staged, tmp_path)
    for name in ("Combined.R", "Combined.A", "Shadow Catcher.R", "Shadow Catcher.G", "Shadow Catcher.B"):
        apart = np.abs(blocks(ours[name]) - blocks(theirs[name]))
        assert apart.max() < 0.03, name
        assert np.median(apart) < 0.002, name
    # Light passes leave the light of catchers out.
    direct = "Diffuse Direct" if bpy.app.version >= (5, 0) else "DiffDir"
    open_floor = ours["Combined.A"] == 0
    assert open_floor.mean() > 0.5
    assert ours[f"{direct}.R"][open_floor].max() == 0
    assert ours[f"{direct}.R"].max() > 0.1


def test_the_shadow_does_not_depend_on_the_structure(staged: Any) -> None:
    staged.render.engine, staged.halfspace.samples = ENGINE, 4
    found = []
    for structure in ("kd", "bvh-sah", "octree-net"):
        staged.halfspace.structure = structure
        found.append(pictures.render(staged))
    assert all(np.array_equal(found[0], other) for other in found[1:])
    assert not np.isnan(found[0]).any()


def test_the_shadow_is_denoised(staged: Any) -> None:
    staged.render.engine, staged.halfspace.samples, staged.render.film_transparent = ENGINE, 4, True
    noisy = pictures.render(staged)[..., 3].astype(float)
    staged.halfspace.use_denoising = True
    clean = pictures.render(staged)[..., 3].astype(float)
    assert abs(clean.mean() - noisy.mean()) < 0.03 * noisy.mean()
    # Neighbouring pixels of the shadow differ less.
    rough, smooth = (np.abs(np.diff(one, axis=1)).mean() for one in (noisy, clean))
    assert smooth < 0.9 * rough


def test_instances_and_their_instancers_catch_shadows(staged: Any, add: Any) -> None:
    staged.render.engine, staged.halfspace.samples, staged.render.film_transparent = ENGINE, 8, True
    alone = pictures.render(staged)
    floor = bpy.data.objects["Floor"]
    floor.is_shadow_catcher = False
    stage = bpy.data.collections.new("Stage")
    staged.collection.objects.unlink(floor)
    stage.objects.link(floor)
    copy = add("Copy", None, instance_type="COLLECTION", instance_collection=stage)
    assert pictures.render(staged)[..., 3].min() < 1  # the corners are empty
    assert pictures.render(staged)[..., 3].mean() > 1.3 * alone[..., 3].mean(), "the floor is opaque"
    copy.is_shadow_catcher = True
    assert np.array_equal(pictures.render(staged), alone)

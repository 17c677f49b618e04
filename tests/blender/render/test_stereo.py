# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereo cameras compared with Cycles, in one file with both eyes."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import made, tile_material
from tests.blender.exr_files import colours, exr
from tests.blender.shapes import grid, look

WIDTH, HEIGHT = 60, 36


stripes = atlas.shown(
    made(
        "VectorMath",
        made("VectorMath", made("NewGeometry", output="Position"), operation="SCALE", Scale=3.0),
        operation="SINE",
    ),
    0.4,
)
"""Broad waves of colour along all axes, of at least 0.1."""


@pytest.fixture
def corridor(add: Any, scene: Any) -> Any:
    """Plates at several distances before a stereo camera."""
    atlas.with_cycles(scene)
    mesh = grid(1)
    mesh.materials.append(tile_material("Plate", stripes))
    for place, size in (((0, 9, 0), 8), ((-1, 4, -0.5), 1), ((0.8, 2.5, 0.4), 0.5)):
        add("Plate", mesh, location=place, rotation_euler=(1.4, 0, 0.2), scale=(size, size, size))
    data = look((WIDTH, HEIGHT), tilt=1.5, lens=30.0, shift_x=0.05, shift_y=-0.02).data
    data.stereo.interocular_distance, data.stereo.convergence_distance = 0.6, 3.0
    scene.render.use_multiview = True
    atlas.configure(scene, 64, 0)
    return scene


def eyes(scene: Any, path: Path, engine: str) -> dict[str, np.ndarray[Any, Any]]:
    """The picture of each view, (h, w, 3)."""
    scene.render.engine = engine
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.views_format = "OPEN_EXR_MULTILAYER", "MULTIVIEW"
    channels = exr(scene, path)
    found = {}
    for view in (one.name for one in scene.render.views if one.use):
        # Before Blender 5.0 all views are in one part of the file.
        name = f"{view}.Combined" if bpy.app.version >= (5, 0) else f"Combined.{view}"
        found[view] = colours(channels, name)
    return found


def compare(scene: Any, folder: Path) -> None:
    ours, theirs = (eyes(scene, folder / f"{engine}.exr", engine) for engine in (ENGINE, "CYCLES"))
    assert len(ours) == len(theirs) == 2
    for name, expected in theirs.items():
        assert np.abs(ours[name] - expected).mean() < 0.01 * expected.mean(), name
        assert np.corrcoef(ours[name].ravel(), expected.ravel())[0, 1] > 0.995, name
    left, right = ours.values()
    assert np.abs(left - right).mean() > 0.05, "the eyes see different pictures"
    assert not [line for line in atlas.warnings(scene) if "tereo" in line]


@pytest.mark.parametrize("mode", ["OFFAXIS", "PARALLEL", "TOE"])
@pytest.mark.parametrize("pivot", ["LEFT", "CENTER"])
def test_both_eyes_see_what_they_see_in_cycles(corridor: Any, tmp_path: Path, mode: str, pivot: str) -> None:
    stereo = corridor.camera.data.stereo
    stereo.convergence_mode, stereo.pivot = mode, pivot
    compare(corridor, tmp_path)


def test_tall_pictures_shift_by_their_height(corridor: Any, tmp_path: Path) -> None:
    corridor.render.resolution_x, corridor.render.resolution_y = HEIGHT, WIDTH
    compare(corridor, tmp_path)


def test_views_of_several_cameras_are_those_of_their_suffixes(corridor: Any, add: Any, tmp_path: Path) -> None:
    corridor.render.views_format = "MULTIVIEW"
    corridor.camera.name = "Eye_L"
    corridor.camera.rotation_euler.z = -0.1
    add("Eye_R", corridor.camera.data.copy(), location=(0.9, 0, 0), rotation_euler=(1.5, 0, 0.2))
    compare(corridor, tmp_path)

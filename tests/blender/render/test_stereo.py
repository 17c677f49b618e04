# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereo cameras beside Cycles, in one file with both eyes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add as node
from atlas import tile_material
from exr_files import exr
from shapes import grid

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from addon.blender.session import reports

WIDTH, HEIGHT = 60, 36


def stripes(tree: Any) -> Any:
    """Broad waves of colour along all axes, of at least 0.1."""
    place = node(tree, "NewGeometry").outputs["Position"]
    scaled, wave = node(tree, "VectorMath", operation="SCALE", Scale=3.0), node(tree, "VectorMath", operation="SINE")
    lifted = node(tree, "VectorMath", operation="MULTIPLY_ADD")
    tree.links.new(place, scaled.inputs[0])
    tree.links.new(scaled.outputs[0], wave.inputs[0])
    tree.links.new(wave.outputs[0], lifted.inputs[0])
    lifted.inputs[1].default_value, lifted.inputs[2].default_value = (0.4, 0.4, 0.4), (0.5, 0.5, 0.5)
    return lifted.outputs[0]


@pytest.fixture
def corridor(add: Any, scene: Any) -> Any:
    """Plates at several distances before a stereo camera."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    mesh = grid(1)
    mesh.materials.append(tile_material("Plate", stripes))
    for place, size in (((0, 9, 0), 8), ((-1, 4, -0.5), 1), ((0.8, 2.5, 0.4), 0.5)):
        add("Plate", mesh, location=place, rotation_euler=(1.4, 0, 0.2), scale=(size, size, size))
    data = bpy.data.cameras.new("Eyes")
    data.lens, data.shift_x, data.shift_y = 30.0, 0.05, -0.02
    data.stereo.interocular_distance, data.stereo.convergence_distance = 0.6, 3.0
    scene.camera = add("Eyes", data, rotation_euler=(1.5, 0, 0))
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
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
        found[view] = np.dstack([channels[f"{name}.{c}"] for c in "RGB"]).astype(float)
    return found


def compare(scene: Any, folder: Path) -> None:
    ours, theirs = (eyes(scene, folder / f"{engine}.exr", engine) for engine in (ENGINE, "CYCLES"))
    assert len(ours) == len(theirs) == 2
    for name, expected in theirs.items():
        assert np.abs(ours[name] - expected).mean() < 0.01 * expected.mean(), name
        assert np.corrcoef(ours[name].ravel(), expected.ravel())[0, 1] > 0.995, name
    left, right = ours.values()
    assert np.abs(left - right).mean() > 0.05, "the eyes see different pictures"
    report = reports.last(scene)
    assert report is not None
    assert not [line for line in report.warnings if "tereo" in line]


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


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Blender 4.5 reads no pixels of a file that names one view")
def test_views_of_a_picture_are_side_by_side(corridor: Any) -> None:
    corridor.render.engine, corridor.halfspace.samples = ENGINE, 1
    both = pictures.render(corridor)
    assert both.shape == (HEIGHT, 2 * WIDTH, 4)
    assert np.abs(both[:, :WIDTH] - both[:, WIDTH:]).max() > 0.05, "the eyes see different pictures"
    corridor.render.use_multiview = False
    assert pictures.render(corridor).shape == (HEIGHT, WIDTH, 4)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramic cameras compared with Cycles, in a scene of differently coloured walls."""

import math
from typing import Any

import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import made, tile_material
from tests.blender.shapes import grid, look

WIDTH, HEIGHT = 60, 36

KINDS: dict[str, dict[str, Any]] = {
    "EQUIRECTANGULAR": {},
    "part of a sphere": {"longitude_min": -1.2, "longitude_max": 2.0, "latitude_min": -0.4, "latitude_max": 1.1},
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": 3.6},
    "FISHEYE_EQUISOLID": {"fisheye_fov": 2.8, "fisheye_lens": 8.0},
    "FISHEYE_LENS_POLYNOMIAL": {"fisheye_fov": 3.0},
    "MIRRORBALL": {},
    "CENTRAL_CYLINDRICAL": {},
    "part of a cylinder": {
        "central_cylindrical_range_u_min": -0.6,
        "central_cylindrical_range_u_max": 1.7,
        "central_cylindrical_range_v_min": -0.9,
        "central_cylindrical_range_v_max": 2.0,
        "central_cylindrical_radius": 1.5,
    },
    "EQUIANGULAR_CUBEMAP_FACE": {},
}

PARTS = {"part of a sphere": "EQUIRECTANGULAR", "part of a cylinder": "CENTRAL_CYLINDRICAL"}


@pytest.fixture(name="hall")
def walls(scene: Any, add: Any) -> Any:
    """Five walls around the camera; the ceiling is open."""
    atlas.with_cycles(scene)
    # A colour for each position, smooth and of at least 0.1.
    where = made("NewGeometry", output="Position")
    colour = made("VectorMath", where, (0.1, 0.13, 0.16), (0.5, 0.5, 0.5), operation="MULTIPLY_ADD")
    mesh = grid(1)
    mesh.materials.append(tile_material("Wall", colour))
    quarter = math.pi / 2
    for place, turn in (
        ((3, 0, 0), (0, quarter, 0)),
        ((-2, 0, 0), (0, quarter, 0)),
        ((0, 2.5, 0), (quarter, 0, 0)),
        ((0, -3, 0), (quarter, 0, 0)),
        ((0, 0, -1), (0, 0, 0)),
    ):
        add("Wall", mesh, location=place, rotation_euler=turn, scale=(1.5, 1.5, 1.5))
    look((WIDTH, HEIGHT), (0.1, 0.2, 0.3), type="PANO").rotation_euler = (1.2, 0.1, 0.4)
    atlas.configure(scene, 128, 0)
    return scene


def choose(hall: Any, kind: str) -> Any:
    """Give the camera this kind of panorama; its data."""
    settings = hall.camera.data
    settings.panorama_type = PARTS.get(kind, kind)
    for name, value in KINDS[kind].items():
        setattr(settings, name, value)
    return settings


@pytest.mark.parametrize("kind", list(KINDS))
def test_panoramas_are_those_of_cycles(hall: Any, kind: str) -> None:
    choose(hall, kind)
    found = atlas.pair(hall, 4)
    assert np.array_equal(found[0][..., 3], found[1][..., 3])
    ours, theirs = (picture[..., :3] for picture in found)
    assert ours.std() > 0.05
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 0.01 * theirs.mean()
    # Edges are the only noise: each pixel there is a mean of 128 samples.
    assert np.abs(ours - theirs).mean() < 0.01 * theirs.mean()
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.99


@pytest.mark.parametrize("kind", ["EQUIRECTANGULAR", "MIRRORBALL"])
def test_depth_of_field_is_that_of_cycles(hall: Any, kind: str) -> None:
    settings = choose(hall, kind)
    hall.render.engine = ENGINE
    sharp = pictures.render(hall).astype(float)
    # An aperture of three blades, narrow and turned: a sideways one is apart by a tenth.
    atlas.configure(hall, 256, 0)
    dof = settings.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 1.0, 0.05
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 3, 0.4, 2.0
    ours, theirs = atlas.pair(hall)
    assert not atlas.warnings(hall)
    blur = np.abs(ours - sharp[..., :3]).mean()
    assert blur > 0.04 * ours.mean()
    assert np.abs(ours - theirs).mean() < 0.02 * theirs.mean()
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 0.01 * theirs.mean()


@pytest.mark.parametrize("value", [math.inf, -1e30, 1e30, 0.0])
def test_absurd_lenses_give_a_picture(hall: Any, value: float) -> None:
    settings = hall.camera.data
    hall.render.engine = ENGINE
    for kind in ("FISHEYE_EQUISOLID", "FISHEYE_LENS_POLYNOMIAL", "CENTRAL_CYLINDRICAL"):
        settings.panorama_type = kind
        settings.fisheye_lens = settings.fisheye_polynomial_k1 = value
        settings.central_cylindrical_range_u_max = settings.central_cylindrical_range_v_max = value
        assert np.isfinite(pictures.render(hall)).all()
    atlas.report(hall)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene arrays refuse what is wrong, by name, and know whose triangles are faulty."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from addon.core.base.equality import same
from addon.core.scene.faulty import faulty
from addon.core.scene.scene import Camera, Geometry, Light, Material, Scene, SceneError, Source, World

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [2, 0, 0]], np.float32)


def geometry(rows: list[list[int]], **changes: object) -> Geometry:
    array = np.array(rows, np.int32).reshape(-1, 3)
    parts = {"vertices": VERTICES.copy(), "triangles": array, "material_index": np.zeros(len(array), np.int32)}
    return Geometry(**{**parts, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("vertices", np.zeros((4, 3))),
        ("vertices", np.zeros((4, 2), np.float32)),
        ("vertices", np.zeros((3, 8), np.float32).T[:, ::-1][:, :3]),
        ("triangles", np.zeros((1, 3), np.int64)),
        ("triangles", np.full((1, 3), 5, np.int32)),
        ("triangles", np.full((1, 3), -1, np.int32)),
        ("material_index", np.zeros(2, np.int32)),
        ("corner_normals", np.zeros((1, 9), np.float32)),
        ("uvs", np.zeros((1, 3, 3), np.float32)),
        ("origin", np.array([0.0, 0.0, np.inf])),
    ],
)
def test_rejects_a_wrong_array_by_name(name: str, value: object) -> None:
    with pytest.raises(SceneError, match=name):
        geometry([[0, 1, 2]], **{name: value})


def test_arrays_are_frozen_and_a_material_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="read-only"):
        geometry([[0, 1, 2]]).vertices[0, 0] = 1.0
    one = geometry([[0, 1, 2]], material_index=np.ones(1, np.int32))
    with pytest.raises(SceneError, match="material_index"):
        Scene(one, (Material("only"),), (), World())


def test_faulty_triangles_are_counted_by_object() -> None:
    sources = (Source(0, 2, ("A", "B")), Source(4, 1, ("C",)))
    flat, broken, good = [0, 1, 4], [0, 1, 3], [0, 1, 2]
    assert geometry([good, flat, broken, flat, good], sources=sources).faulty_triangles() == {"A": 1, "B": 2}
    assert geometry([good] * 5, sources=sources).faulty_triangles() == {}


@pytest.mark.parametrize("scale", [2.0**-149, 2.0**-90, 1.0, 2.0**90])
def test_faulty_triangles_are_those_without_area_at_any_scale(scale: float) -> None:
    rng = np.random.default_rng(7)
    # Three points in a line, which differences rounded to f32 move off it, and next to them points almost there.
    start, step = rng.integers(-(2**24), -(2**24) + 2**20, (500, 3)), rng.integers(2**23, 10_500_000, (500, 3))
    line = np.stack([start, start + step, start + 3 * step], axis=1)
    line[250:, 1] += rng.integers(-1, 2, (250, 3))
    line *= rng.choice([-1, 1], (500, 1, 3))
    flat = ~np.cross(line[:, 1] - line[:, 0], line[:, 2] - line[:, 0]).any(axis=1)
    assert 250 <= flat.sum() < 300
    vertices = (line.reshape(-1, 3) * scale).astype(np.float32)
    vertices[5, 2], vertices[999, 0] = np.nan, np.inf
    flat[[1, 333]] = True
    assert np.array_equal(faulty(vertices, np.arange(1500, dtype=np.int32).reshape(-1, 3)), flat)


def test_a_camera_that_is_not_finite_is_refused() -> None:
    with pytest.raises(SceneError, match="camera"):
        Camera("perspective", np.eye(4), (-1.0, np.nan, -1.0, 1.0), 0.1, 100.0)
    with pytest.raises(SceneError, match="kind"):
        Camera("panoramic", np.eye(4), (-1.0, 1.0, -1.0, 1.0), 0.1, 100.0)


@pytest.mark.parametrize("wrong", [{"power": (np.inf, 0.0, 0.0)}, {"to_world": np.full((4, 4), np.nan)}])
def test_an_error_about_a_light_names_it(wrong: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match=r"^Desk Lamp: its transform or power is not finite"):
        Light(**{"kind": "point", "to_world": np.eye(4), "power": (1.0, 1.0, 1.0), "name": "Desk Lamp", **wrong})


def test_a_renamed_light_is_the_same_light() -> None:
    light = Light("point", np.eye(4), (1.0, 1.0, 1.0), name="Desk Lamp")
    assert same(light, replace(light, name="Lamp"))
    assert not same(light, replace(light, radius=1.0))

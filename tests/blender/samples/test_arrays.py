# SPDX-License-Identifier: GPL-3.0-or-later
"""Import of scene files of arrays: triangles, camera, and files that cannot be read."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from addon.core.scene.workload import load_npz
from tests.blender.shapes import read

VERTICES = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1.5]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def written(path: Path, **changed: Any) -> Path:
    """A scene file of two triangles."""
    arrays = {
        "vertices": VERTICES,
        "triangles": TRIANGLES,
        "camera_eye": [5.0, -4.0, 3.0],
        "camera_target": [0.0, 1.0, 0.0],
        "camera_up": [0.0, 0.0, 1.0],
        "camera_vfov_deg": 35.0,
    }
    np.savez(path, **{**arrays, **changed})
    return path


def test_triangles_and_camera_are_those_of_the_file(scene: Any, tmp_path: Path) -> None:
    path = written(tmp_path / "two.npz")
    assert bpy.ops.halfspace.import_arrays(filepath=str(path)) == {"FINISHED"}
    item = bpy.context.view_layer.objects.active
    assert item.name == "two"
    geometry = read()[0].geometry
    corners = geometry.vertices[geometry.triangles] + geometry.origin
    assert np.array_equal(corners, VERTICES[TRIANGLES])
    # The middle and the upper edge of the picture are those of the file's view.
    view = load_npz(path).view
    camera = scene.camera
    assert np.allclose(camera.matrix_world.translation, view.eye)
    forward = camera.matrix_world.to_3x3() @ Vector((0, 0, -1))
    assert np.allclose(forward, (view.target - view.eye) / np.linalg.norm(view.target - view.eye), atol=1e-6)
    assert np.degrees(camera.data.angle_y) == pytest.approx(view.vertical_fov)


@pytest.mark.parametrize(
    "bad", [{"vertices": np.zeros((2, 2))}, {"camera_vfov_deg": 200.0}, {"triangles": [[0, 1, 9]]}]
)
def test_a_bad_file_is_named_and_adds_nothing(scene: Any, tmp_path: Path, bad: dict[str, Any]) -> None:
    path = written(tmp_path / "bad.npz", **bad)
    with pytest.raises(RuntimeError, match=r"bad(\.npz)?: "):
        bpy.ops.halfspace.import_arrays(filepath=str(path))
    assert not scene.objects


@pytest.mark.parametrize(
    ("up", "option", "expected"),
    [
        ("y", "FILE", (0, -1, 2)),
        ("Y", "FILE", (0, -1, 2)),
        ("x", "FILE", (-1, 2, 0)),
        ("z", "FILE", (0, 2, 1)),
        (None, "FILE", (0, 2, 1)),
        ("y", "Z", (0, 2, 1)),
        (None, "Y", (0, -1, 2)),
    ],
)
def test_the_up_axis_points_upwards(
    scene: Any, tmp_path: Path, up: str | None, option: str, expected: tuple[float, ...]
) -> None:
    vertices = np.array([[0, 2, 1], [1, 0, 0], [0, 0, 5]], np.float32)
    view = {"camera_eye": [9.0, 8.0, 7.0], "camera_up": [0.1, 1.0, 0.2]}
    path = written(
        tmp_path / "up.npz", vertices=vertices, triangles=[[0, 1, 2]], **view, **({} if up is None else {"up_axis": up})
    )
    assert bpy.ops.halfspace.import_arrays(filepath=str(path), up_axis=option) == {"FINISHED"}
    item = bpy.context.view_layer.objects.active
    assert tuple(item.data.vertices[0].co) == expected
    # The camera sees the same picture: places relative to it are those of the file.
    loaded = load_npz(path).view
    right, above, ahead = loaded.axes()
    for place, vertex in zip(item.data.vertices, vertices, strict=True):
        local = scene.camera.matrix_world.inverted() @ place.co
        assert np.allclose(local, [(vertex - loaded.eye) @ axis for axis in (right, above, -ahead)], atol=1e-5)


@pytest.mark.parametrize("up", ["w", "", 2, ["y", "z"]])
def test_an_up_axis_that_is_none_is_refused(scene: Any, tmp_path: Path, up: Any) -> None:
    path = written(tmp_path / "bad.npz", up_axis=up)
    with pytest.raises(RuntimeError, match="up_axis: expected x, y or z"):
        bpy.ops.halfspace.import_arrays(filepath=str(path))
    assert not scene.objects

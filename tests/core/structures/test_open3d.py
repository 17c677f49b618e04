# SPDX-License-Identifier: GPL-3.0-or-later
"""Queries in the shape of Open3D's RaycastingScene, whose own tests `scripts/dev/foreign_tests.py` runs."""

from __future__ import annotations

import copy
import inspect
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from scripts.dev import foreign_tests


@pytest.fixture(scope="module", name="module")
def loaded() -> Any:
    return foreign_tests.module("halfspace_open3d", foreign_tests.CLASSES / "open3d.py")


def box(low: float = 0.0, high: float = 1.0) -> tuple[Any, Any]:
    """The vertices and triangles of a cube whose normals point outwards."""
    corners = np.array([[x, y, z] for z in (low, high) for y in (low, high) for x in (low, high)], np.float32)
    squares = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return corners, np.array([t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))])


RAYS = np.array([[0.5, 0.25, -1, 0, 0, 2], [0.5, 0.5, 0.5, 0, 0, -1], [9, 9, 9, 1, 0, 0]], np.float32)


def test_geometries_keep_their_numbers(module: Any) -> None:
    scene = module.RaycastingScene()
    assert scene.add_triangles(*box(5, 6)) == 0
    assert scene.add_triangles(*box()) == 1
    found = scene.cast_rays(RAYS.reshape(3, 1, 6))
    assert found["t_hit"].ravel().tolist() == [0.5, 0.5, np.inf]
    assert found["geometry_ids"].ravel().tolist() == [1, 1, scene.INVALID_ID]
    assert (found["primitive_ids"].ravel() < 12).tolist() == [True, True, False]
    assert found["primitive_normals"][:, 0].tolist() == [[0, 0, -1], [0, 0, -1], [0, 0, 0]]
    assert {name: one.shape for name, one in found.items()} == {
        "t_hit": (3, 1),
        "geometry_ids": (3, 1),
        "primitive_ids": (3, 1),
        "primitive_uvs": (3, 1, 2),
        "primitive_normals": (3, 1, 3),
    }
    # A geometry that is added later is seen.
    assert scene.add_triangles(*box(8.5, 9.5)) == 2
    assert scene.cast_rays(RAYS)["geometry_ids"].tolist() == [1, 1, 2]


def test_a_ray_through_a_diagonal_meets_each_face_once(module: Any) -> None:
    scene = module.RaycastingScene()
    scene.add_triangles(*box())
    through = np.array([[0.5, 0.5, -1, 0, 0, 1], [0.5, 0.5, 0.5, 0, 0, 1], [3, 3, 3, 1, 0, 0]], np.float32)
    assert scene.count_intersections(through).tolist() == [2, 1, 0]
    found = scene.list_intersections(through)
    assert found["ray_splits"].tolist() == [0, 2, 3, 3]
    assert found["ray_ids"].tolist() == [0, 0, 1]
    assert found["t_hit"].tolist() == [1, 2, 0.5]
    assert scene.test_occlusions(through, tnear=0.75, tfar=1.5).tolist() == [True, False, False]


def test_points_are_inside_or_outside_whatever_the_ray_meets(module: Any) -> None:
    scene = module.RaycastingScene()
    scene.add_triangles(*box())
    # Send the first ray of a point through the middle of an edge: it touches the box and decides nothing.
    middle = np.array([1, 0, 0.5]) - module.DIRECTIONS[0].astype(np.float64)
    points = np.array([[0.5, 0.5, 0.5], [-0.5, -0.5, -0.5], [0.25, 0.9, 0.1], middle], np.float32)
    assert scene.compute_occupancy(points).tolist() == [1, 0, 1, 0]
    distances = scene.compute_signed_distance(points)
    assert distances[:3] == pytest.approx([-0.5, np.sqrt(0.75), -0.1], abs=1e-6)
    assert scene.compute_distance(points) == pytest.approx(np.abs(distances))


def test_closest_points_have_weights(module: Any) -> None:
    scene = module.RaycastingScene()
    corners, triangles = box()
    scene.add_triangles(corners, triangles)
    points = np.random.default_rng(3).uniform(-1, 2, (200, 3)).astype(np.float32)
    found = scene.compute_closest_points(points)
    u, v = found["primitive_uvs"].astype(np.float64).T
    a, b, c = corners.astype(np.float64)[triangles[found["primitive_ids"]]].transpose(1, 0, 2)
    again = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    np.testing.assert_allclose(again, found["points"], atol=1e-6)
    expected = np.clip(points, 0, 1)
    outside = (points != expected).any(axis=1)
    np.testing.assert_allclose(found["points"][outside], expected[outside], atol=1e-6)


class Tensor:
    """A fake of Open3D's tensor."""

    def __init__(self, values: Any) -> None:
        self.values = np.asarray(values)

    @classmethod
    def from_numpy(cls, values: Any) -> Tensor:
        return cls(values)

    def cpu(self) -> Tensor:
        return self

    def numpy(self) -> Any:
        return self.values


def test_tensors_give_tensors(module: Any) -> None:
    scene = module.RaycastingScene(device="CPU:0")
    scene.add_triangles(*map(Tensor, box()))
    found = scene.cast_rays(Tensor(RAYS))
    assert all(isinstance(one, Tensor) for one in found.values())
    assert found["t_hit"].numpy().tolist() == [0.5, 0.5, np.inf]
    assert scene.compute_signed_distance(Tensor([[0.5, 0.5, 0.25]])).numpy().tolist() == [-0.25]
    # Rays of a scene of tensors have tensors as results, too, and tensors at a scene without.
    assert isinstance(scene.count_intersections(RAYS), Tensor)
    plain = module.RaycastingScene()
    plain.add_triangles(*box())
    assert isinstance(plain.count_intersections(Tensor(RAYS)), Tensor)
    assert isinstance(plain.count_intersections(RAYS), np.ndarray)


def test_bad_input_is_named(module: Any) -> None:
    scene = module.RaycastingScene()
    for words, call in (
        ("device: expected the CPU, got CUDA:0", lambda: module.RaycastingScene(device="CUDA:0")),
        (
            r"vertex_positions: expected shape \(n, 3\), got \(4,\)",
            lambda: scene.add_triangles(np.zeros(4), np.zeros((1, 3), int)),
        ),
        (r"rays: expected shape \(..., 6\), got \(2, 3\)", lambda: scene.cast_rays(np.zeros((2, 3)))),
        (r"query_points: expected shape \(..., 3\), got \(2,\)", lambda: scene.compute_distance(np.zeros(2))),
    ):
        with pytest.raises(ValueError, match=words):
            call()
    scene.add_triangles(*box())
    scene.add_triangles(box()[0][:3], np.array([[0, 1, 3]]))
    with pytest.raises(native.ShapeError, match="geometry 1 has an index out of range for 3 vertices"):
        scene.cast_rays(RAYS)


def test_a_scene_without_triangles_is_empty(module: Any) -> None:
    scene = module.RaycastingScene()
    assert scene.cast_rays(RAYS)["geometry_ids"].tolist() == [scene.INVALID_ID] * 3
    assert scene.count_intersections(RAYS).tolist() == [0, 0, 0]
    assert scene.compute_distance(np.zeros((2, 3))).tolist() == [np.inf, np.inf]


METHODS = {
    "add_triangles": ["vertex_positions", "triangle_indices", "mesh"],
    "cast_rays": ["rays", "nthreads"],
    "compute_closest_points": ["query_points", "nthreads"],
    "compute_distance": ["query_points", "nthreads"],
    "compute_occupancy": ["query_points", "nthreads", "nsamples"],
    "compute_signed_distance": ["query_points", "nthreads", "nsamples"],
    "count_intersections": ["rays", "nthreads"],
    "create_rays_pinhole": ["arguments", "named"],
    "list_intersections": ["rays", "nthreads"],
    "test_occlusions": ["rays", "tnear", "tfar", "nthreads"],
}
"""The methods of Open3D's class in version 0.20, with their arguments."""


def test_every_method_of_open3d_is_there(module: Any) -> None:
    scene = module.RaycastingScene
    assert {name for name in dir(scene) if not name.startswith("_")} == {*METHODS, "INVALID_ID"}
    for name, arguments in METHODS.items():
        assert [one for one in inspect.signature(getattr(scene, name)).parameters if one != "self"] == arguments


def test_rays_of_a_pinhole_camera_go_through_the_centres_of_pixels(module: Any) -> None:
    create = module.RaycastingScene.create_rays_pinhole
    rays = create(90.0, [1, 2, 0], [1, 2, 3], [0, 2, 0], 5, 3)
    assert rays.shape == (3, 5, 6)
    assert rays.dtype == np.float32
    assert (rays[..., :3] == [1, 2, 3]).all()
    np.testing.assert_allclose(rays[1, 2, 3:], [0, 0, -1], atol=1e-7)
    # The field of view is that of the width; the depth of each direction is 1.
    np.testing.assert_allclose(rays[..., 5], -1, atol=1e-7)
    np.testing.assert_allclose(np.abs(rays[1, [0, 4], 3]), 0.8, atol=1e-6)
    np.testing.assert_allclose(np.diff(rays[:, 2, 4]), 0.4, atol=1e-6)
    # The same camera by its matrices.
    turn = np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1.0]])
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = turn, -turn @ [1, 2, 3]
    intrinsic = np.array([[2.5, 0, 2.5], [0, 2.5, 1.5], [0, 0, 1]])
    np.testing.assert_allclose(create(intrinsic, extrinsic, 5, 3), rays, atol=1e-6)
    named = create(intrinsic_matrix=intrinsic, extrinsic_matrix=extrinsic, width_px=5, height_px=3)
    np.testing.assert_allclose(named, rays, atol=1e-6)
    made = create(fov_deg=60, center=[0, 0, 0], eye=[-1, -1, -1], up=[0, 0, 1], width_px=4, height_px=2)
    assert made.shape == (2, 4, 6)
    assert isinstance(create(Tensor(intrinsic), Tensor(extrinsic), 5, 3), Tensor)
    scene = module.RaycastingScene()
    scene.add_triangles(*box())
    found = scene.cast_rays(create(20, [0.5, 0.5, 0.5], [0.5, 0.5, 5], [0, 1, 0], 8, 8))
    assert found["t_hit"][3:5, 3:5].ravel().tolist() == pytest.approx([4] * 4)


def test_bad_cameras_are_named(module: Any) -> None:
    create = module.RaycastingScene.create_rays_pinhole
    with pytest.raises(TypeError, match="expected intrinsic_matrix, extrinsic_matrix, width_px, height_px, or fov_deg"):
        create(90.0, [0, 0, 0])
    with pytest.raises(TypeError, match="expected intrinsic_matrix"):
        create(90.0, [0, 0, 0], [0, 0, 1], [0, 1, 0], 5, tall=3)
    with pytest.raises(ValueError, match=r"extrinsic_matrix: expected shape \(4, 4\), got \(3, 3\)"):
        create(np.eye(3), np.eye(3), 5, 3)
    for center, up in (([0, 0, 1], [0, 1, 0]), ([0, 0, 0], [0, 0, 1])):
        with pytest.raises(ValueError, match="apart from eye"):
            create(90.0, center, [0, 0, 1], up, 5, 3)


def test_scenes_are_copied(module: Any) -> None:
    scene = module.RaycastingScene()
    scene.add_triangles(*box())
    scene.cast_rays(RAYS)
    for made in (module.RaycastingScene(scene), module.RaycastingScene(other=scene), copy.deepcopy(scene)):
        assert made.add_triangles(*box(8.5, 9.5)) == 1
        assert made.cast_rays(RAYS)["geometry_ids"].tolist() == [0, 0, 1]
    assert scene.cast_rays(RAYS)["geometry_ids"].tolist() == [0, 0, scene.INVALID_ID]


@pytest.mark.parametrize("value", [2**32 + 2, 2**63, -1, 1.5])
def test_indices_that_are_none_are_refused(module: Any, value: Any) -> None:
    scene = module.RaycastingScene()

    def add() -> None:
        scene.add_triangles(box()[0], np.array([[0, 1, value]]))
        scene.cast_rays(RAYS)

    with pytest.raises(ValueError, match=r"index out of range|expected whole numbers"):
        add()

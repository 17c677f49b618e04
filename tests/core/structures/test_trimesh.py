# SPDX-License-Identifier: GPL-3.0-or-later
"""The intersector for trimesh: its methods, its results, and places far from the origin."""

from __future__ import annotations

import copy
import pickle
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from scripts.dev import foreign_tests


@pytest.fixture(scope="module")
def module() -> Any:
    """The module of the Python package, by its file."""
    name = "trimesh_intersector"
    yield foreign_tests.module(name)
    del sys.modules[name]


def sheets(count: int, offset: float = 0.0) -> SimpleNamespace:
    """Squares of two triangles at heights offset, offset + 1, ...; those at height h have indices 2 h and 2 h + 1."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    vertices = np.concatenate([square + np.array([offset, offset, offset + height]) for height in range(count)])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * height for height in range(count)])
    return SimpleNamespace(vertices=vertices, faces=faces)


UP = np.array([[0.5, 0.25, -1.0], [5.0, 0.0, -1.0], [0.5, 0.25, 1.5]]), np.array([[0, 0, 3.0]] * 3)


@pytest.mark.parametrize("offset", [0.0, 1e6, -3e9])
def test_hits_are_grouped_by_ray_nearest_first_wherever_the_mesh_is(module: Any, offset: float) -> None:
    intersector = module.RayMeshIntersector(sheets(4, offset))
    rays = UP[0] + offset, UP[1]
    triangles, indices, points = intersector.intersects_id(*rays, return_locations=True)
    assert triangles.tolist() == [0, 2, 4, 6, 4, 6]
    assert indices.tolist() == [0, 0, 0, 0, 2, 2]
    assert (triangles.dtype, indices.dtype, points.dtype) == (np.int64, np.int64, np.float64)
    # The mesh's own coordinates are rounded to float64 at this place.
    tolerance = max(1e-6, 4 * np.spacing(abs(offset)))
    wanted = np.array([[0.5, 0.25, z] for z in (0, 1, 2, 3, 2, 3)]) + offset
    np.testing.assert_allclose(points, wanted, rtol=0, atol=tolerance)
    points, by_ray, again = intersector.intersects_location(*rays, multiple_hits=False)
    assert (again.tolist(), by_ray.tolist(), points.shape) == ([0, 4], [0, 2], (2, 3))
    assert intersector.intersects_id(*rays, max_hits=2)[0].tolist() == [0, 2, 4, 6]
    assert intersector.intersects_first(*rays).tolist() == [0, -1, 4]
    assert intersector.intersects_any(*rays).tolist() == [True, False, True]


def test_a_mesh_that_has_changed_is_built_again(module: Any) -> None:
    class Mesh(SimpleNamespace):
        is_watertight = False

        def __hash__(self) -> int:
            return hash(self.vertices.tobytes())

    mesh = Mesh(**vars(sheets(1)))
    intersector = module.RayMeshIntersector(mesh, structure="kd")
    assert intersector.intersects_first(*UP).tolist() == [0, -1, -1]
    mesh.vertices = mesh.vertices + np.array([0, 0, 2.0])
    assert intersector.intersects_first(*UP).tolist() == [0, -1, 0]


def test_an_intersector_can_be_copied_and_pickled(module: Any) -> None:
    intersector = module.RayMeshIntersector(sheets(2), False, structure="bih")
    intersector.intersects_any(*UP)
    pickled = pickle.loads(pickle.dumps(intersector))
    for other in (copy.copy(intersector), copy.deepcopy(intersector), pickled):
        assert (other.structure, other.scale_to_box) == ("bih", False)
        assert other.intersects_first(*UP).tolist() == [0, -1, -1]


def test_rays_of_different_shapes_are_refused_and_none_are_answered(module: Any) -> None:
    intersector = module.RayMeshIntersector(sheets(1))
    with pytest.raises(ValueError, match=r"differ in shape: \(3, 3\) and \(2, 3\)"):
        intersector.intersects_any(UP[0], UP[1][:2])
    empty = np.zeros((0, 3))
    assert [len(part) for part in intersector.intersects_id(empty, empty, return_locations=True)] == [0, 0, 0]
    nothing = module.RayMeshIntersector(SimpleNamespace(vertices=empty, faces=np.zeros((0, 3), int)))
    assert nothing.intersects_first(*UP).tolist() == [-1, -1, -1]


def test_a_ray_through_an_edge_hits_once_and_the_triangle_of_the_smallest_index(module: Any) -> None:
    intersector = module.RayMeshIntersector(sheets(3))
    # Both triangles of each square meet at its diagonal.
    diagonal = np.array([[0.5, 0.5, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    assert intersector.intersects_id(*diagonal)[0].tolist() == [0, 2, 4]
    assert intersector.intersects_id(*diagonal, max_hits=2)[0].tolist() == [0, 2]
    assert intersector.intersects_id(*diagonal, multiple_hits=False)[0].tolist() == [0]


def test_a_folder_without_tests_of_trimesh_is_named(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert foreign_tests.main([str(tmp_path)]) == 2
    assert str(tmp_path) in capsys.readouterr().err


def test_our_module_takes_the_place_of_the_one_for_embree(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "trimesh.ray.ray_pyembree"
    monkeypatch.setitem(sys.modules, name, ModuleType(name))
    assert foreign_tests.module(name).RayMeshIntersector.__module__ == "halfspace.trimesh"
    assert sys.modules[name].__file__ == str(foreign_tests.INTERSECTOR)


def ball(count: int = 12) -> tuple[Any, Any]:
    """Vertices and faces of a sphere of radius 1."""
    theta, phi = np.linspace(0, np.pi, count), np.linspace(0, 2 * np.pi, 2 * count, endpoint=False)
    ring = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    rows = [np.c_[np.sin(angle) * ring, np.full(2 * count, np.cos(angle))] for angle in theta]
    a = np.add.outer(np.arange(count - 1) * 2 * count, np.arange(2 * count))
    b = np.add.outer(np.arange(count - 1) * 2 * count, (np.arange(2 * count) + 1) % (2 * count))
    below = 2 * count
    quads = np.stack([a, a + below, b + below, b], axis=-1).reshape(-1, 4)
    return np.concatenate(rows), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


@pytest.mark.parametrize("distance", [10.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e20])
def test_rays_that_begin_far_away_hit_as_those_nearby(module: Any, distance: float, scale: float) -> None:
    rng = np.random.default_rng(5)
    vertices, faces = ball()
    ways = rng.normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    aims = rng.uniform(-0.57, 0.57, size=(2000, 3))  # within the sphere
    intersector = module.RayMeshIntersector(SimpleNamespace(vertices=scale * vertices, faces=faces))
    hit = intersector.intersects_any(scale * (aims - distance * ways), scale * ways)
    assert hit.sum() == 2000
    assert not intersector.intersects_any(scale * (aims + distance * ways), ways).any()
    assert not intersector.intersects_any(scale * (aims + 4 * np.cross(ways, aims) - distance * ways + 9), ways).all()
    _, rays, points = intersector.intersects_id(
        scale * (aims - distance * ways), ways, max_hits=1, return_locations=True
    )
    # The points lie on their rays, up to the roundings of an origin far away.
    off = points / scale - aims[rays]
    away = np.linalg.norm(off - (off * ways[rays]).sum(axis=1, keepdims=True) * ways[rays], axis=1)
    assert away.max() < max(1e-5, 4e-15 * distance)


@pytest.mark.parametrize("value", [1e9, -1e300, np.nan, np.inf])
def test_vertices_that_no_face_uses_change_nothing(module: Any, value: float) -> None:
    mesh = sheets(2)
    mesh.vertices = np.concatenate([mesh.vertices, [[value, 0, 0]]])
    intersector = module.RayMeshIntersector(mesh)
    assert intersector.intersects_id(*UP)[0].tolist() == [0, 2]
    # A face that uses it is left out, or is where it is; the others stay.
    mesh.faces = np.concatenate([mesh.faces, [[0, 1, 8]]])
    found = module.RayMeshIntersector(mesh).intersects_id(*UP)[0].tolist()
    assert found == [0, 2] or np.isfinite(value)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["ray_origins", "ray_directions"])
def test_rays_that_are_not_finite_are_refused_by_name(module: Any, value: float, column: str) -> None:
    rays = {"ray_origins": UP[0].copy(), "ray_directions": UP[1].copy()}
    rays[column][1, 2] = value
    intersector = module.RayMeshIntersector(sheets(1))
    for query in (intersector.intersects_any, intersector.intersects_first, intersector.intersects_id):
        with pytest.raises(ValueError, match=rf"{column}\[1\]: expected finite numbers"):
            query(**rays)


@pytest.mark.parametrize("length", [0, 1e-320, 1e-200, 1e200, 1e308])
def test_directions_have_any_length(module: Any, length: float) -> None:
    found = module.RayMeshIntersector(sheets(4)).intersects_first(UP[0], np.array([[0, 0, length]] * 3))
    assert found.tolist() == ([0, -1, 4] if length else [-1, -1, -1])


@pytest.mark.parametrize(
    "faces", [[[0, 1, 2**32 + 2]], [[0, 1, -1]], np.array([[0, 1, 2**64 - 1]], np.uint64), [[0, 1, 2.5]], [[0, 1]]]
)
def test_rejects_faces_that_are_no_indices(module: Any, faces: Any) -> None:
    mesh = sheets(1)
    for kind in (np.uint8, np.int16, np.uint64, np.float64):  # whole numbers of any type are
        own = SimpleNamespace(vertices=mesh.vertices, faces=mesh.faces.astype(kind))
        assert module.RayMeshIntersector(own).intersects_any(*UP).tolist() == [True, False, False]
    mesh.faces = faces
    with pytest.raises(ValueError, match=r"index|expected whole numbers|expected shape"):
        module.RayMeshIntersector(mesh).intersects_any(*UP)

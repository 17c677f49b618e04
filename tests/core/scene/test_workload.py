# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene files: what is read, and what is refused in one line."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.scene import rays, workload
from addon.core.scene.workload import WorkloadError
from addon.lab.bench import ray_files

GOOD: dict[str, Any] = {
    "vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64),
    "triangles": np.array([[0, 1, 2]], np.int64),
    "camera_eye": np.array([0.0, 0.0, 3.0]),
    "camera_target": np.zeros(3),
    "camera_up": np.array([0.0, 1.0, 0.0]),
    "camera_vfov_deg": np.float64(40.0),
}


def save(folder: Path, **changes: Any) -> Path:
    path = folder / "scene.npz"
    np.savez(path, **{key: value for key, value in {**GOOD, **changes}.items() if value is not None})
    return path


def test_a_file_is_read(tmp_path: Path) -> None:
    found = workload.load_npz(save(tmp_path))
    assert (found.name, found.vertices.dtype, found.triangles.dtype) == ("scene", np.float32, np.int32)
    assert found.view.vertical_fov == 40.0
    assert found.diagonal() == pytest.approx(2**0.5)


def test_the_published_part_of_a_scene_is_read_on_request(tmp_path: Path) -> None:
    path = save(
        tmp_path,
        triangles=np.array([[0, 1, 2], [2, 1, 0], [1, 2, 0]]),
        triangle_from_quadric=np.array([0, 1, 0], np.uint8),
        camera_crop=np.array([0.25, 0.5, 0.0, 0.75]),
    )
    whole, published = workload.load_npz(path), workload.load_npz(path, published=True)
    assert (len(whole.triangles), whole.view.crop, whole.notes) == (3, None, ())
    assert published.triangles.tolist() == [[0, 1, 2], [1, 2, 0]]
    assert published.notes == (
        "triangles that replace quadrics are left out: 1",
        "only 25% by 75% of the film is visible, as published",
    )
    assert len({one.fingerprint() for one in (whole, published, replace(published, view=whole.view))}) == 3


def test_a_crop_is_a_part_of_the_rays_of_the_whole_film(tmp_path: Path) -> None:
    crop = np.array([0.25, 0.5, 0.0, 0.75])
    whole = rays.pinhole(workload.load_npz(save(tmp_path)).view, (64, 64), 1.0).reshape(64, 64, 3)
    for right, part in ([1.0, 0.0, 0.0], whole[:48, 16:32]), ([-1.0, 0.0, 0.0], whole[:48, 32:48]):
        path = save(tmp_path, camera_crop=crop, camera_right=np.array(right))
        view = workload.load_npz(path, published=True).view
        # Whatever the shape of its pixels would be, the picture shows the crop.
        np.testing.assert_allclose(rays.pinhole(view, (16, 48), 5.0), part.reshape(-1, 3), atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"triangle_from_quadric": np.zeros(2, np.uint8)}, "triangle_from_quadric: expected 1 whole numbers"),
        ({"triangle_from_quadric": np.zeros(1)}, "triangle_from_quadric: expected 1 whole numbers"),
        ({"triangle_from_quadric": np.ones(1, np.uint8)}, "no triangles"),
        ({"camera_crop": np.array([0.5, 0.5, 0.0, 1.0])}, "camera_crop: expected parts of the film"),
        ({"camera_crop": np.array([0.0, 1.0, 0.0])}, "camera_crop: expected 4 finite numbers"),
        ({"camera_crop": np.array([0.0, 1.0, 0.0, np.nan])}, "camera_crop: expected 4 finite numbers"),
        ({"camera_crop": np.array([0, 0.5, 0, 1]), "camera_right": np.array(["x"])}, "camera_right: expected numbers"),
    ],
)
def test_rejects_a_wrong_published_part(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    workload.load_npz(save(tmp_path, **changes))
    with pytest.raises(WorkloadError, match=message) as caught:
        workload.load_npz(save(tmp_path, **changes), published=True)
    assert "scene" in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"triangles": None}, "the key 'triangles' is missing"),
        ({"camera_up": None}, "the key 'camera_up' is missing"),
        ({"triangles": np.array([[0, 1, 3]])}, "out of range for 3 vertices"),
        ({"triangles": np.array([[0, 1, -1]])}, "out of range"),
        ({"triangles": np.array([[0, 1, -(2**40)]])}, "triangles: an index is out of range for 3 vertices"),
        ({"triangles": np.array([[0, 1, 2**63]], np.uint64)}, "triangles: an index is out of range for 3 vertices"),
        ({"triangles": np.array([[0.0, 1.0, 2.0]])}, "whole numbers"),
        ({"triangles": np.zeros((0, 3), np.int32)}, "no triangles"),
        ({"triangles": np.array([0, 1, 2])}, r"expected shape \(m, 3\)"),
        ({"vertices": np.zeros((3, 2))}, r"expected shape \(n, 3\)"),
        ({"vertices": np.full((3, 3), np.nan)}, "none is finite"),
        ({"camera_vfov_deg": np.float64(180.0)}, "between 0 and 180"),
        ({"camera_eye": np.array([0.0, np.nan, 0.0])}, "three finite numbers"),
        ({"camera_eye": np.array([0.0, 0.0, 1e300])}, "camera_eye: .* finite numbers of at most 1e.37, got"),
        ({"camera_target": np.array([0.0, 0.0, -1e38])}, "camera_target: expected three finite numbers of at most"),
        ({"camera_eye": np.zeros(3)}, "its own place"),
        ({"camera_up": np.array([0.0, 0.0, 1.0])}, "up direction"),
    ],
)
def test_rejects_wrong_files_in_one_line(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(WorkloadError, match=message) as caught:
        workload.load_npz(save(tmp_path, **changes))
    assert "scene.npz" in str(caught.value) or "scene:" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_file_is_refused(tmp_path: Path, share: float) -> None:
    path = save(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(WorkloadError, match=r"cannot be read as \.npz"):
        workload.load_npz(path)


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be changed")
@pytest.mark.parametrize("replaced", [False, True])
def test_a_file_that_changes_while_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, replaced: bool
) -> None:
    # More than the buffer of a file holds.
    vertices = np.random.default_rng(1).random((200_000, 3))
    path, load = save(tmp_path, vertices=vertices), np.load

    def changing(raw: Any, **named: Any) -> Any:
        file = load(raw, **named)
        if replaced:
            other = tmp_path / "other.npz"
            other.write_bytes(b"of another program")
            other.replace(path)
        else:
            os.truncate(path, path.stat().st_size // 3)
        return file

    monkeypatch.setattr(np, "load", changing)
    if not replaced:
        with pytest.raises(WorkloadError, match=r"scene\.npz: cannot be read as \.npz"):
            workload.load_npz(path)
        return
    # What was opened is read as it was.
    assert np.array_equal(workload.load_npz(path).vertices, vertices.astype(np.float32))


def test_objects_in_a_file_are_never_loaded(tmp_path: Path) -> None:
    path = save(tmp_path, vertices=np.array([{"a": 1}], dtype=object))
    words = r"cannot be read as \.npz: vertices: expected numbers, got objects"
    with pytest.raises(WorkloadError, match=words) as error:
        workload.load_npz(path)
    assert "pickle" not in str(error.value)


@pytest.mark.parametrize(
    "content", [b"", b"v 0 0 0\n", b"ply\nformat ascii 1.0\n", b"\x93NUMPY\x01\x00", b"\x80\x04N.", "é".encode()]
)
def test_another_file_of_this_name_is_refused_without_advice(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "text.npz"
    path.write_bytes(content)
    with pytest.raises(WorkloadError) as error:
        workload.load_npz(path)
    assert str(error.value) == f"{path}: cannot be read as .npz: it is no NumPy archive"


def test_the_framing_view_sees_everything() -> None:
    rng = np.random.default_rng(0)
    vertices = (rng.normal(size=(50, 3)) * [10, 1, 3] + 100).astype(np.float32)
    view = workload.framing_view(vertices, np.arange(48, dtype=np.int32).reshape(-1, 3))
    forward = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    to = vertices - view.eye
    angles = np.degrees(np.arccos((to @ forward) / np.linalg.norm(to, axis=1)))
    assert angles.max() <= view.vertical_fov / 2


def rays_of(tmp_path: Path, **arrays: Any) -> tuple[rays.RaySet, ...]:
    """The sets of a file of two rays with these arrays changed; None leaves one out."""
    good: dict[str, Any] = {"origins": np.eye(3)[:2], "directions": np.array([[0.0, 0.0, -2.0], [1.0, 0.0, 0.0]])}
    path = tmp_path / "my (rays).npz"
    np.savez(path, **{key: value for key, value in {**good, **arrays}.items() if value is not None})
    return tuple(one.rays for one in ray_files.load({path: []}, 1 << 20))


def test_rays_of_a_file_begin_at_their_least_distance(tmp_path: Path) -> None:
    (one,) = rays_of(tmp_path)
    assert (one.name, one.any_hit, one.order, one.t_max.tolist()) == ("my _rays_", False, "none", [np.inf, np.inf])
    assert {array.dtype for array in (one.origins, one.directions, one.t_max)} == {np.dtype(np.float32)}
    (moved,) = rays_of(tmp_path, t_min=np.array([0.25, 0.0]), t_max=4, any=np.int64(1))
    assert moved.any_hit
    assert moved.t_max.tolist() == [3.75, 4.0]
    assert np.array_equal(moved.origins, one.origins + np.array([0.25, 0.0], np.float32)[:, None] * one.directions)


def test_sets_of_a_file_are_named(tmp_path: Path) -> None:
    recorded = {
        name: {
            "origins": np.eye(3, dtype=np.float32),
            "directions": np.eye(3, dtype=np.float32),
            "any": any_hit,
            "t_min": np.zeros(3, np.float32),
            "t_max": np.ones(3, np.float32),
            "traced": 12,
        }
        for name, any_hit in (("camera", False), ("shadow 0", True))
    }
    paths = tmp_path / "a.npz", tmp_path / "b.npz"
    for path in paths:
        path.write_bytes(ray_files.packed(recorded, np.array([1.0, 2.0, 3.0])))
    alone, both = ray_files.load({paths[0]: []}, 1 << 20), ray_files.load(dict.fromkeys(paths, ()), 1 << 20)
    assert [(one.rays.name, one.rays.any_hit) for one in alone] == [("camera", False), ("shadow 0", True)]
    assert [one.rays.name for one in both] == ["a camera", "a shadow 0", "b camera", "b shadow 0"]
    whole = workload.load_npz(save(tmp_path))
    seen = ray_files.added(whole, alone)
    assert seen.fingerprint() != whole.fingerprint()
    np.testing.assert_array_equal(seen.extra[0].origins, np.eye(3) + np.array([1.0, 2.0, 3.0]))
    with pytest.raises(WorkloadError, match="two of its ray sets are called 'camera'"):
        ray_files.added(seen, alone)
    (shadow,) = ray_files.load({paths[0]: ["shadow 0"]}, 1 << 20)
    assert (shadow.rays.name, shadow.rays.any_hit) == ("shadow 0", True)
    with pytest.raises(WorkloadError, match=r"a\.npz: two ray sets are called 'camera'"):
        ray_files.load({paths[0]: ["camera", "camera"]}, 1 << 20)
    with pytest.raises(WorkloadError, match=r"a\.npz: there is no ray set 'lens'; there are camera, shadow 0"):
        ray_files.load({paths[0]: ["lens"]}, 1 << 20)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"origins": None, "directions": None}, "the key 'origins' is missing"),
        ({"origins": None, "directions": None, "a/origins": np.eye(3)}, "the key 'a/directions' is missing"),
        ({"tmax": 3.0}, "the key 'tmax' is unknown; there are origins, directions, t_min, t_max, any"),
        ({"origins": np.zeros((0, 3)), "directions": np.zeros((0, 3))}, "origins: there are no rays"),
        ({"origins": np.eye(3)}, "directions: expected one for each of the 3 origins, got 2"),
        ({"origins": np.zeros(3)}, r"origins: expected shape \(n, 3\), got \(3,\)"),
        ({"origins": np.array([[0, 0, 0], [0, np.nan, 0]])}, "origins: ray 1 is not finite"),
        ({"origins": np.full((2, 3), 1e300)}, "origins: ray 0 is not finite in f32"),
        ({"origins": np.zeros((2, 3), complex)}, "origins: expected numbers, got complex128"),
        ({"origins": np.array([["a"] * 3] * 2)}, "origins: expected numbers, got <U1"),
        ({"origins": np.array([{}], dtype=object)}, "origins: expected numbers, got objects of Python"),
        ({"directions": np.array([[1, 0, 0], [0, 0, 0]])}, "directions: ray 1 has none"),
        ({"t_min": np.array([0.0, np.inf])}, "t_min: expected a finite number of at most t_max, got inf and inf"),
        ({"t_min": 2.0, "t_max": np.array([3.0, 1.0])}, "at most t_max, got 2 and 1 for ray 1"),
        ({"t_max": np.array([1.0, np.nan])}, "t_max: ray 1 has no number"),
        ({"t_max": np.ones(3)}, "t_max: expected one number for each of 2 rays"),
        ({"t_min": 3e38, "directions": np.full((2, 3), 9.0)}, "t_min: ray 0 begins beyond"),
        ({"any": np.array([True, False])}, "any: expected one truth value for all rays, got bool"),
        ({"any": 2}, "any: expected one truth value"),
        ({"origins": np.zeros((99_999, 3))}, "needs 2,400,[0-9]+ bytes of memory, of 262,144 that are free"),
    ],
)
def test_wrong_rays_are_refused_in_one_line(tmp_path: Path, arrays: dict[str, Any], message: str) -> None:
    with pytest.raises(WorkloadError, match=message) as caught:
        rays_of(tmp_path, **arrays)
    assert "my (rays).npz: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_fingerprint_changes_with_every_array(tmp_path: Path) -> None:
    base = workload.load_npz(save(tmp_path)).fingerprint()
    assert workload.load_npz(save(tmp_path)).fingerprint() == base
    for change in ({"vertices": GOOD["vertices"] + 1}, {"camera_eye": np.array([0.0, 0.0, 4.0])}):
        assert workload.load_npz(save(tmp_path, **change)).fingerprint() != base

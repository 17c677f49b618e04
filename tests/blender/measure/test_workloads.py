# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the benchmark out of Blender: its own files, and every format that it imports."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import workloads
from addon.core.scene.workload import WorkloadError
from addon.lab.bench import mesh_files
from tests.blender import shapes

SIZE = (64, 32)


@pytest.fixture
def cube(scene: Any) -> Any:
    """A cube of side 2 at x = 100, with a camera that looks at it from below -Y."""
    item = shapes.place("Cube", shapes.cube(), location=(100.0, 0.0, 0.0))
    item.data.uv_layers.remove(item.data.uv_layers[0])  # files would hold a vertex for each corner
    shapes.look(SIZE, (100.0, -8.0, 0.0), np.pi / 2, sensor_fit="VERTICAL", angle=np.radians(40.0))
    bpy.context.view_layer.update()
    return item


EXPORTERS = {
    ".obj": lambda path: bpy.ops.wm.obj_export(filepath=path),
    ".ply": lambda path: bpy.ops.wm.ply_export(filepath=path),
    ".stl": lambda path: bpy.ops.wm.stl_export(filepath=path),
    ".glb": lambda path: bpy.ops.export_scene.gltf(filepath=path),
    ".usd": lambda path: bpy.ops.wm.usd_export(filepath=path),
}


@pytest.mark.parametrize("suffix", sorted(EXPORTERS))
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # Blender's own importers, written in Python.
def test_files_exported_by_blender_come_back(cube: Any, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cube{suffix}"
    EXPORTERS[suffix](str(path))
    found = workloads.load(path, SIZE)
    assert (found.name, len(found.triangles)) == ("cube", 12)
    assert found.diagonal() == pytest.approx(12**0.5, rel=1e-5)


@pytest.mark.parametrize("suffix", sorted(mesh_files.READERS))
def test_a_mesh_read_without_blender_is_the_one_that_blender_reads(cube: Any, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cube{suffix}"
    EXPORTERS[suffix](str(path))
    ours, theirs = mesh_files.load(path), workloads.load(path, SIZE)
    # Blender's scene frame has its origin at the scene's centre, and the triangles of a square may differ.
    centred = ours.vertices - (ours.vertices.min(axis=0) + ours.vertices.max(axis=0)) / 2
    expected = theirs.vertices - (theirs.vertices.min(axis=0) + theirs.vertices.max(axis=0)) / 2
    assert len(ours.triangles) == len(theirs.triangles)
    assert {tuple(corner) for corner in centred.round(4)} == {tuple(corner) for corner in expected.round(4)}
    assert ours.vertices[:, 0].mean() == pytest.approx(100.0)


def test_a_blend_file_brings_its_camera_and_its_materials(cube: Any, tmp_path: Path) -> None:
    path = tmp_path / "cube.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    found = workloads.load(path, SIZE)
    # The scene frame has its origin at the scene's centre.
    np.testing.assert_allclose(found.vertices.mean(axis=0) - found.view.eye, [0.0, 8.0, 0.0], atol=1e-5)
    forward = (found.view.target - found.view.eye) / np.linalg.norm(found.view.target - found.view.eye)
    np.testing.assert_allclose(forward, [0.0, 1.0, 0.0], atol=1e-6)
    assert found.view.vertical_fov == pytest.approx(40.0, rel=1e-5)
    assert found.render_scene is not None
    assert found.notes == ()


def test_without_a_camera_the_whole_is_seen_and_that_is_said(cube: Any) -> None:
    bpy.context.scene.camera = None
    found = workloads.current("cube", SIZE)
    assert "No perspective camera" in found.notes[0]
    assert np.linalg.norm(found.view.target - found.vertices.mean(axis=0)) < 1e-5


def test_a_shifted_lens_is_said(cube: Any) -> None:
    camera = bpy.context.scene.camera.data
    camera.shift_y = 0.3
    assert [line for line in workloads.current("cube", SIZE).notes if "lens shift" in line]
    camera.shift_y = 0
    assert workloads.current("cube", SIZE).notes == ()


@pytest.mark.parametrize("suffix", [".blend", ".obj", ".ply", ".stl", ".glb", ".usd"])
@pytest.mark.parametrize("content", [b"", b"rubbish" * 99, b"glTF\x02\x00\x00\x00xx"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_rejects_an_unreadable_file_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(content)
    with pytest.raises(WorkloadError, match="broken") as caught:
        workloads.load(path, SIZE)
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)


def test_a_truncated_blend_file_is_refused(cube: Any, tmp_path: Path) -> None:
    path = tmp_path / "cube.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 3])
    with pytest.raises(WorkloadError, match=r"cube.blend"):
        workloads.load(path, SIZE)


def test_an_empty_scene_is_refused(scene: Any) -> None:
    with pytest.raises(WorkloadError, match="nothing: the scene has no triangles"):
        workloads.current("nothing", SIZE)

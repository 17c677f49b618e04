# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations of .blend files, frame by frame."""

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.core.base import native
from addon.lab.commands import bench
from addon.lab.motion import blend_file, frames, motion


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with a cube that moves from frame 1 to 5, and a plane that renders only from frame 4 on."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame, x in ((1, 0.0), (5, 4.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -2.0))
    plane = bpy.context.object
    for frame, hidden in ((1, True), (4, False)):
        plane.hide_viewport = plane.hide_render = hidden
        plane.keyframe_insert("hide_viewport", frame=frame)
        plane.keyframe_insert("hide_render", frame=frame)
    bpy.context.scene.frame_set(1)
    path = tmp_path / "moving.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_frames_have_the_triangles_of_the_file(file: Path) -> None:
    frame, _ = blend_file.load(file)
    first, triangles = frame(1)
    last, more = frame(5)
    assert len(triangles) == 12
    assert len(more) == 14
    # The vertices of all frames are in one space.
    widths = [np.ptp(vertices[:, 0]) for vertices in (first, frame(3)[0])]
    assert widths == pytest.approx([2.0, 2.0])
    assert frame(3)[0][:, 0].mean() - first[:, 0].mean() > 1.0
    assert np.ptp(last[:, 0]) == pytest.approx(20.0)


def test_objects_that_appear_are_rebuilt(file: Path) -> None:
    module: Any = native.load()
    animation = motion.find(str(file))
    chosen = [frames.Method("bvh-sah", "refit")]
    rows = list(frames.measure(module, animation, range(1, 6), chosen, size=(64, 64)))
    assert [row["done"] for row in rows] == ["built", "refitted", "refitted", "rebuilt", "refitted"]
    assert rows[3]["why"] == "other triangles"
    assert not any(row["wrong"] for row in rows)


def test_two_files_are_measured_each_under_its_name(file: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    other = file.with_name("sphere.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(other))
    asked = [str(file), str(other), "--frames=1-2", "--size=64x64", "--structures=bih", f"--out={file.parent}"]
    assert bench.main(asked) == 0
    rows = json.loads((file.parent / motion.NUMBERS).read_text())["frames"]
    assert {(row["animation"], row["triangles"]) for row in rows} == {("moving", 12), ("sphere", 224)}

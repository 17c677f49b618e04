# SPDX-License-Identifier: GPL-3.0-or-later
"""The vector pass compared with that of Cycles: a moving camera, and objects that move and deform."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.exr_files import both, exr
from tests.blender.shapes import cube, grid, look

CHANNELS = ("Vector.X", "Vector.Y", "Vector.Z", "Vector.W")


def animate(item: Any, name: str, *values: tuple[float, ...]) -> None:
    """Set a property in the frames before, at and after the picture."""
    for frame, value in zip((9, 10, 11), values, strict=True):
        setattr(item, name, value)
        item.keyframe_insert(name, frame=frame)


@pytest.fixture
def track(add: Any, scene: Any) -> Any:
    """A cube that turns, one that deforms by a shape key, a floor at rest, and a camera that follows."""
    atlas.with_cycles(scene)
    turning = add("Turning", cube("Turning"), location=(-1.6, 0, 0))
    animate(turning, "rotation_euler", (0.3, 0.2, 0.0), (0.3, 0.2, 0.1), (0.3, 0.2, 0.3))
    animate(turning, "location", (-1.8, 0, 0), (-1.6, 0, 0), (-1.5, 0.1, 0.2))
    bending = add("Bending", cube("Bending"), location=(1.6, 1, 0), rotation_euler=(0.1, 0.2, 0.5))
    bending.shape_key_add(name="Rest")
    key = bending.shape_key_add(name="Bent")
    for point in key.data:
        point.co.z *= 1.5
    animate(key, "value", 0.0, 0.2, 0.7)
    add("Floor", grid(2), location=(0, 0, -1.3), scale=(4, 4, 1))
    camera = look((60, 40), (0, -8, 4), 1.1)
    animate(camera, "location", (-0.1, -8, 4), (0, -8, 4), (0.2, -8.1, 4))
    animate(camera.data, "lens", 49.0, 50.0, 52.0)
    scene.frame_set(10)
    bpy.context.view_layer.use_pass_vector = True
    atlas.configure(scene, 64, 0)
    return scene


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_vectors_are_those_of_cycles(track: Any, tmp_path: Path, kind: str) -> None:
    old = bpy.app.version < (5, 0)
    if old and kind == "ORTHO":
        pytest.skip("Cycles of Blender 4.5 projects the vectors of orthographic cameras as if in perspective")
    track.camera.data.type, track.camera.data.ortho_scale = kind, 9.0
    ours, theirs = (np.stack([one[name].ravel() for name in CHANNELS], axis=1) for one in both(track, tmp_path))
    if old:
        # Cycles of Blender 4.5 leaves out the motion of the background.
        seen = (theirs != 0).any(axis=1)
        ours, theirs = ours[seen], theirs[seen]
    assert len(theirs) > 1000
    assert (np.abs(theirs).max(axis=0) > 0.5).all()
    assert (np.abs(theirs - ours).mean(axis=0) < 0.02 * np.abs(theirs).max(axis=0)).all()
    # Apart from edges, where samples see one surface or the other, each pixel has the same vector.
    assert (np.abs(theirs - ours).max(axis=1) < 0.05).mean() > 0.9
    assert track.frame_current == 10


def test_other_numbers_of_triangles_have_no_motion_of_their_own(track: Any, tmp_path: Path) -> None:
    """A modifier that grows: only the camera moves the pixels of its object."""
    layers = bpy.data.objects["Turning"].modifiers.new("Layers", "ARRAY")
    for frame, count in ((9, 1), (10, 2), (11, 3)):
        layers.count = count
        layers.keyframe_insert("count", frame=frame)
    track.render.engine = ENGINE
    channels = exr(track, tmp_path / "picture.exr")
    assert all(np.isfinite(channels[name]).all() for name in CHANNELS)
    assert atlas.report(track).triangles == 12 * 2 + 12 + 8


def test_a_mesh_mirrored_in_another_frame_moves_alike_in_both_layouts(track: Any, tmp_path: Path) -> None:
    animate(bpy.data.objects["Turning"], "scale", (-1, 1, 1), (1, 1, 1), (1, -1, 0.5))
    track.render.engine = ENGINE
    flat, kept = (_with_layout(track, layout, tmp_path) for layout in ("flatten", "two-level"))
    assert all(np.array_equal(flat[name], kept[name]) for name in CHANNELS)


def _with_layout(scene: Any, layout: str, folder: Path) -> Any:
    scene.halfspace.instancing = layout
    return exr(scene, folder / f"{layout}.exr")

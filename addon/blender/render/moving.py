# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of final renders: the camera's poses, and the scene at several times while the shutter is open."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...core.base.arrays import F64
from ...core.base.equality import same
from ...core.base.notes import Notes
from ...core.scene.scene import Camera, Scene
from ...core.session.session import Cancelled
from ..read.standing import moves
from . import shutter

Cameras = Mapping[str, Camera]
"""The camera of each view, by its name."""


@dataclass(frozen=True, eq=False)
class Still:
    """The scene as read at the frame, and the notes on it."""

    scene: Scene
    cameras: Cameras
    notes: Notes


def read(
    engine: Any,
    depsgraph: Any,
    still: Still,
    read_scene: Callable[[], Scene],
    read_cameras: Callable[[], Cameras],
    keep_going: Callable[[], bool],
) -> tuple[Cameras, tuple[Scene, ...]]:
    """The cameras with their poses, and the scenes of the times that samples take in turn; none if only cameras move.

    read_scene and read_cameras: read them again, at another time, in the scene frame of `still`. Leaves the depsgraph
    at the frame. Raises Cancelled.
    """
    span = shutter.interval(depsgraph.scene_eval) if depsgraph.view_layer_eval.use_motion_blur else None
    if span is None:
        if depsgraph.scene_eval.render.use_motion_blur and depsgraph.view_layer_eval.use_motion_blur:
            still.notes.add(
                "Motion blur with a shutter that never opens, rendered without motion", depsgraph.scene.name
            )
        return still.cameras, ()
    frame = depsgraph.scene_eval.frame_float
    steps = depsgraph.scene_eval.halfspace.motion_steps

    def at(moment: float, what: Callable[[], Any]) -> Any:
        if not keep_going():
            raise Cancelled
        return shutter.at(engine, moment, what)

    try:
        camera = depsgraph.scene_eval.camera
        times = shutter.moments(span, shutter.POSES) if camera is None or moves(camera) else ()
        poses = [at(moment, read_cameras) for moment in times]
        # A scene that stands still while the shutter is open needs one structure, that of the frame.
        ends = [at(moment, read_scene) for moment in span]
        standing = all(same(still.scene, end) for end in ends)
        scenes = () if standing else tuple(at(moment, read_scene) for moment in shutter.middles(span, steps))
    finally:
        shutter.at(engine, frame, lambda: None)
    moved = {name: _posed(camera, [pose[name].to_world for pose in poses]) for name, camera in still.cameras.items()}
    return moved, scenes


def _posed(camera: Camera, poses: Sequence[F64]) -> Camera:
    """The camera with its transforms while the shutter is open, if they differ."""
    if all((pose == poses[0]).all() for pose in poses):
        return camera
    return replace(camera, poses=tuple(tuple(map(tuple, pose.tolist())) for pose in poses))

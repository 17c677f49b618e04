# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of final renders: the camera's poses, and the scene at several times while the shutter is open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ...core.base.equality import same
from ...core.base.notes import Notes
from ...core.scene.instances import Layout
from ...core.scene.scene import Camera, Scene
from ...core.session.session import Cancelled
from ..read import extract
from . import shutter

ReadCamera = Callable[[Any], Camera]
"""Reads the camera for an origin of the scene frame."""


@dataclass(frozen=True, eq=False)
class Still:
    """What was read at the frame, and the notes on it."""

    scene: Scene
    camera: Camera
    layout: Layout
    notes: Notes


def read(
    engine: Any,
    depsgraph: Any,
    still: Still,
    read_camera: ReadCamera,
    keep_going: Callable[[], bool],
) -> tuple[Camera, tuple[Scene, ...]]:
    """The camera with its poses, and the scenes of the times that samples take in turn; none if only the camera moves.

    Leaves the depsgraph at the frame. Raises Cancelled.
    """
    scene, camera, layout = still.scene, still.camera, still.layout
    span = shutter.interval(depsgraph.scene_eval)
    if span is None:
        if depsgraph.scene_eval.render.use_motion_blur:
            still.notes.add(
                "Motion blur with a shutter that never opens, rendered without motion", depsgraph.scene.name
            )
        return camera, ()
    frame, origin = depsgraph.scene_eval.frame_current_final, scene.geometry.origin
    steps = depsgraph.scene_eval.halfspace.motion_steps

    def at(moment: float, what: Callable[[], Any]) -> Any:
        if not keep_going():
            raise Cancelled
        return shutter.at(engine, moment, what)

    def moved() -> Scene:
        found = extract.find(depsgraph, Notes(), uvs=_with_uvs(scene), keep_going=keep_going)
        return found.instanced(origin) if layout.two_level else found.flattened(uvs=_with_uvs(scene), origin=origin)

    try:
        poses = [at(moment, lambda: read_camera(origin).to_world) for moment in shutter.moments(span, shutter.POSES)]
        # A scene that stands still while the shutter is open needs one structure, that of the frame.
        ends = [at(moment, moved) for moment in span]
        standing = all(same(scene, end) for end in ends)
        scenes = () if standing else tuple(at(moment, moved) for moment in shutter.middles(span, steps))
    finally:
        shutter.at(engine, frame, lambda: None)
    if any((pose != poses[0]).any() for pose in poses):
        camera = replace(camera, poses=tuple(tuple(map(tuple, pose.tolist())) for pose in poses))
    return camera, scenes


def _with_uvs(scene: Scene) -> bool:
    return getattr(scene.geometry, "uvs", None) is not None

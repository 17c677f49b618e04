# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur of final renders: the camera's poses, and the scene at several times while the shutter is open."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...core.base.arrays import F64
from ...core.base.equality import same
from ...core.base.notes import Notes
from ...core.scene.scene import Camera, Scene
from ...core.session.session import Cancelled
from ..read import between
from ..read.standing import moves
from . import shutter

if TYPE_CHECKING:
    from ..read.extract import Found

T = TypeVar("T")

Cameras = Mapping[str, Camera]
"""The camera of each view, by its name."""

CLOSE = 0.2
"""Largest distance of a place in the middle of two keys from the interpolated one, relative to the distance that its
instance goes between two times that the samples take in turn (chosen). Of smooth motion, with the middles as further
keys, about a quarter of it remains, which no picture shows.
"""


@dataclass(frozen=True, eq=False)
class Moving:
    """Motion while the shutter is open. span: the frames at which it opens and closes; None if nothing is blurred.

    times: number of times that samples take in turn; 0 if nothing but cameras moves. keys: the scene at equal
    intervals from the first to the last moment, if only places differ and lie between those of the keys. uneven: see
    `shutter.curve`. rolling: see `shutter.rolling`; times are even then, and cameras carry the curve.
    """

    span: tuple[float, float] | None = None
    times: int = 0
    keys: tuple[Found, ...] = ()
    uneven: F64 | None = None
    frame: Found | None = None
    """The scene at the frame, whose meshes other times share."""
    rolling: float | None = None

    @property
    def spread(self) -> F64 | None:
        """The curve by which scenes and poses are spread over the time; None if evenly."""
        return self.uneven if self.rolling is None else None

    def between(self) -> Iterator[Found]:
        """The scenes at the middles of `times` equal parts of the light."""
        for moment in shutter.middles((0.0, len(self.keys) - 1.0), self.times, self.spread):
            first = min(int(moment), len(self.keys) - 2)
            yield between.interpolated(self.keys[first], self.keys[first + 1], moment - first)


class Times:
    """Reads a render's scene at other times, and returns to the frame. Raises Cancelled where `keep_going` returns
    False.
    """

    def __init__(
        self, engine: Any, depsgraph: Any, cameras: Callable[[], Cameras], keep_going: Callable[[], bool]
    ) -> None:
        """cameras: reads them, in world space."""
        self._engine, self._depsgraph, self._keep_going = engine, depsgraph, keep_going
        self._read_cameras = cameras
        self._cameras: dict[float, Cameras] = {}
        """Those of each time that was read."""

    def look(self, found: Found, find: Callable[[], Found], notes: Notes) -> Moving:
        """The motion of a scene that is `found` at the frame; find: reads it."""
        depsgraph, blurred = self._depsgraph, self._depsgraph.view_layer_eval.use_motion_blur
        span = shutter.interval(depsgraph.scene_eval) if blurred else None
        if span is None:
            if depsgraph.scene_eval.render.use_motion_blur and blurred:
                text = "Motion blur with a shutter that never opens, rendered without motion"
                notes.add(text, depsgraph.scene.name)
            return Moving()
        frame, steps = depsgraph.scene_eval.frame_float, depsgraph.scene_eval.halfspace.motion_steps
        self._cameras[frame] = self._read_cameras()
        uneven, rolling = shutter.curve(depsgraph.scene_eval), shutter.rolling(depsgraph.scene_eval)

        def at(moment: float) -> Found:
            if moment == frame:
                return found
            return between.sharing(found, self._at(moment, find))

        try:
            keys = [at(moment) for moment in span]
            if all(_stands(found, key) for key in keys):
                return Moving(span, uneven=uneven, rolling=rolling)
            return Moving(span, steps, self._keys(keys, span, steps, at), uneven, found, rolling)
        finally:
            shutter.at(self._engine, frame, lambda: None)

    def _keys(
        self, keys: list[Found], span: tuple[float, float], steps: int, at: Callable[[float], Found]
    ) -> tuple[Found, ...]:
        """Enough keys for all places between, from those of both ends; none if other things differ, or if reading every
        time needs no more of them.
        """
        while 2 * len(keys) - 1 <= steps and all(between.differs_by_places(keys[0], key) for key in keys[1:]):
            # Halve the intervals, and compare what is read there with what is interpolated.
            middles = [at(moment) for moment in shutter.middles(span, len(keys) - 1)]
            pairs = list(itertools.pairwise(keys))
            if not all(between.differs_by_places(keys[0], middle) for middle in middles):
                break
            allowed = CLOSE / steps * np.sum([_farthest(*pair) for pair in pairs], axis=0)
            right = all(
                (_farthest(between.interpolated(*pair, 0.5), middle) <= allowed).all()
                for pair, middle in zip(pairs, middles, strict=True)
            )
            keys = [one for pair in zip(keys, [*middles, None], strict=True) for one in pair if one is not None]
            if right:
                return tuple(keys)
        return ()

    def scenes(self, moving: Moving, place: Callable[[Found], Scene], find: Callable[[], Found]) -> tuple[Scene, ...]:
        """The scenes of the times that samples take in turn, none if only cameras move. Returns to the frame."""
        if moving.span is None or not moving.times:
            return ()
        if moving.keys:
            return tuple(place(found) for found in moving.between())
        frame = self._depsgraph.scene_eval.frame_float
        try:
            assert moving.frame is not None, "something moves"
            middles = shutter.middles(moving.span, moving.times, moving.spread)
            return tuple(place(between.sharing(moving.frame, self._at(moment, find))) for moment in middles)
        finally:
            shutter.at(self._engine, frame, lambda: None)

    def posed(self, moving: Moving, cameras: Cameras, origin: F64) -> Cameras:
        """The cameras of the frame, in the scene frame with this origin, with their poses while the shutter is open."""
        if moving.span is not None and moving.rolling is not None:
            curve = () if moving.uneven is None else tuple(moving.uneven.tolist())
            own = {"rolling_shutter": moving.rolling, "shutter_curve": curve}
            cameras = {name: replace(one, **own) for name, one in cameras.items()}
        camera = self._depsgraph.scene_eval.camera
        if moving.span is None or (camera is not None and not moves(camera)):
            return cameras
        poses = shutter.POSES if moving.spread is None else shutter.UNEVEN_POSES
        moments = shutter.moments(moving.span, poses, moving.spread)
        frame, unread = self._depsgraph.scene_eval.frame_float, [one for one in moments if one not in self._cameras]
        try:
            for moment in unread:
                self._at(moment, lambda: None)
        finally:
            if unread:
                shutter.at(self._engine, frame, lambda: None)
        seen = [self._cameras[moment] for moment in moments]
        return {name: _posed(one, [_moved(pose[name], origin) for pose in seen]) for name, one in cameras.items()}

    def _at(self, moment: float, read: Callable[[], T]) -> T:
        """The result of `read` at another time, whose cameras are kept."""
        if not self._keep_going():
            raise Cancelled

        def both() -> T:
            self._cameras[moment] = self._read_cameras()
            return read()

        return shutter.at(self._engine, moment, both)


def _stands(found: Found, other: Found) -> bool:
    """Whether nothing differs between two scenes."""
    pairs = zip(found.placements, other.placements, strict=False)
    return between.differs_by_places(found, other) and all(same(a.matrices, b.matrices) for a, b in pairs)


def _farthest(a: Found, b: Found) -> F64:
    """The largest distance between the places of each instance in two scenes, (k,)."""
    pairs = zip(a.placements, b.placements, strict=True)
    return np.concatenate([np.zeros(0), *(between.farthest(*pair) for pair in pairs)])


def _moved(camera: Camera, origin: F64) -> F64:
    """The transform of a camera in world space, in the scene frame with this origin."""
    to_world = camera.to_world.copy()
    to_world[:3, 3] -= origin
    return to_world


def _posed(camera: Camera, poses: Sequence[F64]) -> Camera:
    """The camera with its transforms while the shutter is open, if they differ."""
    if all((pose == poses[0]).all() for pose in poses):
        return camera
    return replace(camera, poses=tuple(tuple(map(tuple, pose.tolist())) for pose in poses))

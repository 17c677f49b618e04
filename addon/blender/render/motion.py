# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vector pass needs: the triangles and the cameras one frame before this picture and one frame after."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.notes import Notes
from ..read import extract

if TYPE_CHECKING:
    from ...core.base.arrays import F32, F64
    from ...core.scene.scene import Camera, Geometry

Cameras = Callable[[Any], Mapping[str, "Camera"]]
"""Returns the camera of each view in the frame with this origin."""


@dataclass(frozen=True, eq=False)
class _Side:
    """The geometry of another frame, and its cameras, in the scene frame with this origin."""

    geometry: Geometry
    cameras: Mapping[str, Camera]
    origin: F64


@dataclass(frozen=True, eq=False)
class Motion:
    """The frames before and after."""

    sides: tuple[_Side, _Side]

    def corners(self, geometry: Geometry) -> tuple[F32, F32]:
        """Where the corners of this frame's triangles are in the other two, (m, 3, 3) each, in its scene frame."""
        before, after = (_corners(side.geometry, geometry) for side in self.sides)
        return before, after

    def cameras(self, view: str, origin: F64) -> tuple[Camera, Camera]:
        """The cameras of a view in the other two, in the scene frame with this origin."""
        before, after = (_moved(side.cameras[view], side.origin - origin) for side in self.sides)
        return before, after


def read(engine: Any, depsgraph: Any, cameras: Cameras) -> Motion:
    """Read the frames before and after, and return to this one. What was read from the depsgraph before is invalid."""
    scene = depsgraph.scene
    frame, part = scene.frame_current, scene.frame_subframe
    sides = []
    try:
        for offset in (-1, 1):
            engine.frame_set(frame + offset, part)
            found = extract.find(depsgraph, Notes(), sky=extract.NO_WORLD).flattened()
            origin = found.geometry.origin
            sides.append(_Side(found.geometry, cameras(origin), origin))
    finally:
        engine.frame_set(frame, part)
    before, after = sides
    return Motion((before, after))


def _corners(other: Geometry, geometry: Geometry) -> F32:
    """The corners in another frame of each object's triangles; where they are now, if it has others there."""
    found: F32 = geometry.vertices[geometry.triangles]
    apart = (other.origin - geometry.origin).astype(np.float32)
    # Take the runs of an object in their order, because instances have the same name.
    places: dict[tuple[int, str], list[int]] = {}
    start = 0
    for count, name in other.runs():
        places.setdefault((count, name), []).append(start)
        start += count
    start = 0
    for count, name in geometry.runs():
        if there := places.get((count, name)):
            first = there.pop(0)
            found[start : start + count] = other.vertices[other.triangles[first : first + count]] + apart
        start += count
    return np.ascontiguousarray(found)


def _moved(camera: Camera, by: F64) -> Camera:
    """A camera in another scene frame."""
    to_world = camera.to_world.copy()
    to_world[:3, 3] += by
    return replace(camera, to_world=to_world)

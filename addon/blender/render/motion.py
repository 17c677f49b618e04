# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of the vector pass: the triangles and the cameras one frame before this picture and one frame after."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.notes import Notes
from ...core.scene.instances import AnyGeometry, InstancedGeometry
from ...core.scene.scene import Geometry
from ..read import extract

if TYPE_CHECKING:
    from ...core.base.arrays import F32, F64, I64
    from ...core.scene.scene import Camera, Moved

Cameras = Callable[[Any], Mapping[str, "Camera"]]
"""Returns the camera of each view in the frame with this origin."""


@dataclass(frozen=True, eq=False)
class _Side:
    """Another frame: what is there, and its cameras in world space."""

    found: extract.Found
    cameras: Mapping[str, Camera]


@dataclass(frozen=True, eq=False)
class Motion:
    """The frames before and after."""

    sides: tuple[_Side, _Side]

    def of(self, geometry: AnyGeometry) -> tuple[Moved, Moved]:
        """Where this frame's triangles are in the other two, in its scene frame."""
        if isinstance(geometry, InstancedGeometry):
            moved = partial(_instances, geometry=geometry)
        else:
            moved = partial(_corners, geometry=geometry)
        before, after = (moved(side.found) for side in self.sides)
        return before, after

    def cameras(self, view: str, origin: F64) -> tuple[Camera, Camera]:
        """The cameras of a view in the other two, in the scene frame with this origin."""
        before, after = (_moved(side.cameras[view], -origin) for side in self.sides)
        return before, after


def read(engine: Any, depsgraph: Any, cameras: Cameras) -> Motion:
    """Read the frames before and after, and return to this one. What was read from the depsgraph before is invalid."""
    scene = depsgraph.scene
    frame, part = scene.frame_current, scene.frame_subframe
    sides = []
    try:
        for offset in (-1, 1):
            engine.frame_set(frame + offset, part)
            found = extract.find(depsgraph, Notes(), sky=extract.NO_WORLD)
            sides.append(_Side(found, cameras(np.zeros(3))))
    finally:
        engine.frame_set(frame, part)
    before, after = sides
    return Motion((before, after))


def _partners(other: AnyGeometry, geometry: AnyGeometry) -> Iterator[tuple[int, int, int]]:
    """Each run of triangles that exists in both geometries: its numbers there and here, and its triangles. Runs of an
    object are taken in their order, because instances have the same name.
    """
    there: dict[tuple[int, str], deque[int]] = {}
    for number, run in enumerate(other.runs()):
        there.setdefault(run, deque()).append(number)
    for number, run in enumerate(geometry.runs()):
        if numbers := there.get(run):
            yield numbers.popleft(), number, run[0]


def _corners(found: extract.Found, geometry: Geometry) -> F32:
    """The corners in another frame of each object's triangles, (m, 3, 3); where they are now, if not there."""
    other = found.flattened(origin=geometry.origin).geometry
    assert isinstance(other, Geometry)
    corners: F32 = geometry.vertices[geometry.triangles]
    firsts = [np.cumsum([0, *(count for count, _ in each.runs())]).tolist() for each in (other, geometry)]
    for there, here, count in _partners(other, geometry):
        first, start = firsts[0][there], firsts[1][here]
        triangles, own = other.triangles[first : first + count], geometry.triangles[start : start + count]
        # An instance that is mirrored in one of the frames only has its corners in the other order there.
        turned = triangles[:, [0, 2, 1]]
        if count and np.array_equal(turned - turned.min(), own - own.min()):
            triangles = turned
        corners[start : start + count] = other.vertices[triangles]
    return np.ascontiguousarray(corners)


def _instances(found: extract.Found, geometry: InstancedGeometry) -> tuple[F32, I64, F64]:
    """Meshes and instances of another frame, see `Moved`: an instance that is not there stays."""
    other = found.instanced(origin=geometry.origin).geometry
    assert isinstance(other, InstancedGeometry)
    # Append the meshes of this frame, for what is not there.
    corners = [mesh.vertices[mesh.triangles] for mesh in (*other.meshes, *geometry.meshes)]
    firsts = np.cumsum([0, *(len(each) for each in corners)])
    here = np.cumsum([0, *(len(mesh.triangles) for mesh in geometry.meshes)])[geometry.mesh]
    shifts = np.full(len(geometry.mesh), firsts[len(other.meshes)], np.int64)
    matrices = geometry.matrices[:, :3].copy()
    for there, number, _ in _partners(other, geometry):
        shifts[number] = firsts[other.mesh[there]] - here[number]
        matrices[number] = other.matrices[there, :3]
    return np.ascontiguousarray(np.concatenate(corners)), shifts, matrices


def _moved(camera: Camera, by: F64) -> Camera:
    """A camera in another scene frame."""
    to_world = camera.to_world.copy()
    to_world[:3, 3] += by
    return replace(camera, to_world=to_world)

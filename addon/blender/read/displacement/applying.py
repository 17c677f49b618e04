# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose vertices the displacement of their materials has moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....core.base import native
from ....core.base.arrays import F32, F64, I32
from ....core.base.steps import Steps
from ..layers import Key
from ..meshes import UNBOUNDED, MeshArrays
from .programs import Displacement

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ....core.base.notes import Notes
    from ....core.scene.scene import Image
    from ..materials import Palette
    from ..meshes import Placement
    from ..object_values import Value

FLAT = 1e-3
"""Largest distance between the unit normals of a triangle's corners and its own at which it is flat."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Inputs of a displacement apart from the mesh.

    matrix: (4, 4), the object to the world. values: other values of the object, see `object_values`. layers: the keys
    of all layers by number. images: by number.
    """

    matrix: F64
    values: tuple[Value, ...]
    layers: Sequence[Key]
    images: Sequence[Image]


class Displacer:
    """Displaces meshes by their materials where the first instance is, as in Cycles."""

    def __init__(self, palette: Palette, notes: Notes) -> None:
        self._palette, self._notes = palette, notes
        self._images: dict[frozenset[int], tuple[Image, ...]] = {}

    def read(self, placement: Placement) -> Steps[None]:
        """Read the images that displace the mesh of a placement."""
        slots = self._palette.displacements(placement.materials.tolist())
        used = _images(slots)
        if any(slots) and used not in self._images:
            self._images[used] = yield from self._palette.gallery.read(set(used), self._notes)

    def mesh(self, placement: Placement) -> MeshArrays:
        """The displaced mesh of a placement, or its own. From any thread, after `read`."""
        slots = self._palette.displacements(placement.materials.tolist())
        if not any(slots):
            return placement.mesh
        keys, images = self._palette.layers.keys, self._images[_images(slots)]
        around = Surroundings(placement.transforms[0], placement.values[0], keys, images)
        mesh, lost = displaced(placement.mesh, slots, around)
        if lost:
            self._notes.add("Not displaced, vertices that would leave the scene", placement.names[0], lost)
        return mesh


def _images(slots: Sequence[Displacement | None]) -> frozenset[int]:
    """The numbers of the images that displacements read."""
    return frozenset().union(*(one.images for one in slots if one is not None))


def displaced(mesh: MeshArrays, slots: Sequence[Displacement | None], around: Surroundings) -> tuple[MeshArrays, int]:
    """The mesh with each vertex moved by the displacement of the material of the first triangle that has it.

    slots: the displacement of each material slot, the last one for all beyond. As in Cycles, the normals of the
    vertices become the means of the triangles' new normals. Returns also the number of vertices that stay since the
    displacement would move them out of bounds.
    """
    corner, used = _first_corners(mesh)
    normals = vertex_normals(mesh.positions, mesh.triangles, weighted=True)
    numbers = np.zeros(len(mesh.triangles), np.int32) if mesh.slots is None else mesh.slots
    slot_of = np.clip(numbers, 0, len(slots) - 1)[corner // 3]
    finite = np.isfinite(mesh.positions).all(axis=1)
    moved = mesh.positions.astype(np.float64)
    for number, displacement in enumerate(slots):
        rows = np.flatnonzero(used & finite & (slot_of == number))
        if displacement is not None and len(rows):
            moved[rows] += _offsets(mesh, displacement, around, rows, corner[rows], normals[rows])
    # Keep vertices where they are if they would leave the scene.
    lost = finite & ~(np.abs(moved) < float(UNBOUNDED)).all(axis=1)
    moved[lost] = mesh.positions[lost]
    positions = moved.astype(np.float32)
    return _with_normals(replace(mesh, positions=positions), mesh), int(lost.sum())


def _first_corners(mesh: MeshArrays) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The first corner of the triangles at each vertex, (n,), and whether there is one."""
    count = len(mesh.positions)
    corners = mesh.triangles.reshape(-1)
    first = np.zeros(count, np.int64)
    first[corners[::-1]] = np.arange(len(corners) - 1, -1, -1)
    used = np.zeros(count, bool)
    used[corners] = True
    return first, used


def _offsets(
    mesh: MeshArrays,
    displacement: Displacement,
    around: Surroundings,
    rows: NDArray[np.int64],
    corners: NDArray[np.int64],
    normals: F64,
) -> F64:
    """The displacement at some vertices, in object space. corners: one corner of the triangles for each of them."""
    # Go to the world, relative to the object's location.
    linear = around.matrix[:3, :3]
    inverse = np.linalg.inv(linear)
    origin = around.matrix[:3, 3]
    outward = normals @ inverse
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-30)
    layers = [_at_corners(mesh.layers.get(key), corners) for key in around.layers]
    frame = {
        "to_object": np.column_stack([inverse, np.zeros(3)]).tolist(),
        "generated": mesh.box,
        "values": around.values,
    }
    images = [
        image.as_dict() if number in displacement.images else {"name": image.name, "pixels": image.pixels[:0, :0]}
        for number, image in enumerate(around.images)
    ]
    request: Mapping[str, Any] = {
        "positions": (mesh.positions[rows].astype(np.float64) @ linear.T).astype(np.float32),
        "normals": outward.astype(np.float32),
        "program": displacement.program,
        "result": displacement.result,
        "images": images,
        "layers": layers,
        "objects": [frame],
        "origin": origin.tolist(),
    }
    vectors = native.load().evaluate_program(request)[:, :3].astype(np.float64)
    offsets: F64 = vectors @ inverse.T
    return offsets


def _at_corners(values: F32 | None, corners: NDArray[np.int64]) -> F32 | None:
    """A layer at some corners, three times each."""
    if values is None:
        return None
    rows = values.reshape(-1, values.shape[2])[corners]
    return np.ascontiguousarray(np.repeat(rows[:, None], 3, axis=1), np.float32)


def vertex_normals(positions: F32, triangles: I32, *, weighted: bool) -> F64:
    """The mean of the unit normals of the triangles at each vertex, weighted by their angles there or not, unit."""
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        faces = _unit(np.cross(b - a, c - a))
        total = np.zeros((len(positions), 3))
        for k, (corner, next_, last) in enumerate(((a, b, c), (b, c, a), (c, a, b))):
            angle = np.ones(len(triangles))
            if weighted:
                cosine = (_unit(next_ - corner) * _unit(last - corner)).sum(axis=1)
                angle = np.arccos(np.clip(cosine, -1, 1))
            part = np.nan_to_num(faces * angle[:, None])
            for axis in range(3):
                total[:, axis] += np.bincount(triangles[:, k], part[:, axis], minlength=len(positions))
        return np.nan_to_num(_unit(total))


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: F64 = vectors / np.where(length > 0, length, 1)
    return result


def _with_normals(moved: MeshArrays, before: MeshArrays) -> MeshArrays:
    """The moved mesh with new normals: flat triangles stay flat, all others take those of their vertices."""
    if before.normals is None or before.normal_rows is None:
        return moved
    normals = vertex_normals(moved.positions, moved.triangles, weighted=False).astype(np.float32)
    rows = moved.triangles.astype(np.int64)
    # Compare the old normals of corners with those of their triangles.
    stored = before.normals[before.normal_rows]
    faces = _faces(before.positions, before.triangles)
    flat = np.flatnonzero((np.abs(stored - faces[:, None]) < FLAT).all(axis=(1, 2)))
    if len(flat) and not _is_plane(before, stored):
        rows[flat] = len(normals) + np.arange(len(flat))[:, None]
        normals = np.concatenate([normals, _faces(moved.positions, moved.triangles[flat])])
    return replace(moved, normals=normals, normal_rows=rows)


def _is_plane(mesh: MeshArrays, stored: F32) -> bool:
    """Whether smooth shading looks like flat: all triangles that meet in a vertex have one plane there."""
    smooth = vertex_normals(mesh.positions, mesh.triangles, weighted=True)[mesh.triangles]
    return bool((np.abs(stored - smooth) < FLAT).all())


def _faces(positions: F32, triangles: I32) -> F32:
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(_unit(np.cross(b - a, c - a))).astype(np.float32)

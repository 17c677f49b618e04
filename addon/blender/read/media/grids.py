# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects: their grids as dense voxels, and the box around them as a mesh."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ....core.base.arrays import F64
from ....core.scene.scene import Voxels
from ..bundled import bundled
from ..meshes import MeshArrays
from ..nodes import Unsupported

if TYPE_CHECKING:
    from ....core.base.notes import Notes

CHANNELS = {"FLOAT": 1, "DOUBLE": 1, "INT": 1, "INT64": 1, "MASK": 1, "BOOLEAN": 1, "VECTOR_FLOAT": 3}
"""Kinds of grids that are read, with the numbers of a voxel."""

MOST_VOXELS = 1 << 28
"""Largest number of numbers of a dense grid: 1 GiB."""

MOST_OF_ALL = 1 << 29
"""Largest number of numbers of all grids of a scene."""

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    np.int32,
)
"""The corners of a box and its twelve triangles, which face outwards."""


@dataclass(frozen=True, eq=False)
class Grids:
    """The grids of a volume. box: the mesh around all of them, in object space. voxels: by name."""

    box: MeshArrays | None
    voxels: Mapping[str, Voxels]


def occur(depsgraph: Any) -> bool:
    """Whether the depsgraph shows volumes: as data blocks, or made by the modifiers of other objects."""
    volumes = modified = False
    for block in depsgraph.ids:
        volumes |= isinstance(block, bpy.types.Volume)
        modified |= isinstance(block, bpy.types.Object) and any(one.type == "NODES" for one in block.modifiers)
    # What modifiers make is not among the data blocks.
    return volumes or (modified and any(placed.object.type == "VOLUME" for placed in depsgraph.object_instances))


def read_volume(data: Any, name: str, notes: Notes, taken: int = 0) -> Grids:
    """The grids of an evaluated volume; those that cannot be read are noted for the object `name`. taken: number of
    numbers of the scene's other grids.
    """
    grids = data.grids
    if not grids.is_loaded and not grids.load():
        notes.add(f"The volume could not be loaded ({grids.error_message})", name)
        return Grids(None, {})
    found: dict[str, Voxels] = {}
    corners: list[F64] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(grids.frame_filepath)
        # Volumes that modifiers made have no file.
        if not path.is_file():
            path = Path(folder) / "grids.vdb"
            if not len(grids) or not grids.save(filepath=str(path)):
                return Grids(None, {})
        for grid in grids:
            try:
                voxels, box = _dense(str(path), grid, MOST_OF_ALL - taken)
            except (Unsupported, OSError, RuntimeError, ValueError) as error:
                notes.add(f"The grid {grid.name!r} is left out ({error})", name)
                continue
            if box is not None:
                found[grid.name] = voxels
                taken += voxels.values.size
                corners.append(box)
    if not corners:
        return Grids(None, {})
    every = np.concatenate(corners)
    low, high = every.min(axis=0), every.max(axis=0)
    positions = (low + CORNERS * (high - low)).astype(np.float32)
    size = high - low
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1), 1)
    box = MeshArrays(positions, FACES, None, None, None, None, {}, (tuple((-low).tolist()), tuple(scale.tolist())))
    return Grids(box, found)


class Volumes:
    """Reads volume objects during one pass over the depsgraph's instances, each data block once. voxels: all grids."""

    def __init__(self, notes: Notes) -> None:
        self.voxels: list[Voxels] = []
        self._notes = notes
        self._known: dict[int, tuple[MeshArrays | None, dict[str, float]]] = {}

    def of(self, item: Any) -> tuple[MeshArrays | None, Mapping[str, float]]:
        """The box around the grids of a volume, None if it has none, and the number of each grid by name, from 1."""
        key = item.data.as_pointer()
        if key not in self._known:
            taken, first = sum(one.values.size for one in self.voxels), len(self.voxels) + 1
            found = read_volume(item.data, item.name_full, self._notes, taken)
            self._known[key] = found.box, {name: float(first + i) for i, name in enumerate(found.voxels)}
            self.voxels += found.voxels.values()
        return self._known[key]


def density_scale(matrix: F64, data: Any) -> float:
    """The factor that keeps a volume as opaque whatever its object's scale, as in Cycles; 1 in world space."""
    if data.render.space != "OBJECT":
        return 1.0
    length = float(np.linalg.norm(matrix[:3, :3] @ np.full(3, 3**-0.5)))
    return 1.0 / length if length > 0 else 1.0


def _dense(path: str, grid: Any, left: int) -> tuple[Voxels, F64 | None]:
    """The active voxels of a grid, and the corners of their box in object space; None if there are none. left: number
    of numbers that the scene's grids may still have.
    """
    channels = CHANNELS.get(grid.data_type)
    if channels is None:
        raise Unsupported(f"its type {grid.data_type} is not supported yet")
    sparse = bundled("openvdb").read(path, grid.name)
    nothing = Voxels(np.zeros((0, 0, 0, channels), np.float32), np.zeros((3, 4)).tolist())
    if sparse.activeVoxelCount() == 0:
        return nothing, None
    low, high = (np.array(end) for end in sparse.evalActiveVoxelBoundingBox())
    size = high - low + 1
    needed = np.prod(size.astype(float)) * channels
    if needed > min(MOST_VOXELS, left):
        why = "is too large" if needed > MOST_VOXELS else "is too large together with the scene's other grids"
        raise Unsupported(f"its box of {' × '.join(map(str, size))} voxels {why}")
    shape = tuple(size.tolist()) if channels == 1 else (*size.tolist(), channels)
    values = np.zeros(shape, np.float32)
    sparse.copyToArray(values, ijk=tuple(low.tolist()))
    # Positions in the array count from the lowest voxel.
    to_object = np.array(grid.matrix_object, np.float64)
    shift = np.eye(4)
    shift[:3, 3] = low
    to_index = np.linalg.inv(to_object @ shift)[:3]
    # Interpolated values reach one voxel beyond the active ones.
    ends = (low - 1) + CORNERS * (size + 1)
    box = ends @ to_object[:3, :3].T + to_object[:3, 3]
    if not (np.isfinite(to_index).all() and np.isfinite(box).all()):
        raise Unsupported("its transform is not finite")
    return Voxels(values.reshape(*size.tolist(), channels), to_index.tolist()), box

# SPDX-License-Identifier: GPL-3.0-or-later
"""One layer of the cells of a grid, because the walls of all its cells hide each other and the scene: its walls as
lines, and its cells with triangles as squares, like a plan of one storey.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import colours
from ..base.arrays import F32, F64, I32
from . import planes, sight
from .planes import Planes

if TYPE_CHECKING:
    from ..base.interface import Structure

PLACES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
"""Shares of the grid's extent at which a layer may lie."""

ASIDE = 0.125
"""Smallest distance of the layer from the viewer, as a share of the grid's extent: within it, it would be fog."""

SLANT = 0.45
"""Distance of the layer from the viewer, as a share of the grid's extent, below which it is seen from the side."""

LEVEL = 1.5
"""Factor by which a level layer, across Z, is preferred: it lies in the scene like a floor."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Walls of a grid. walls: ascending positions along each axis, the ends of the box included, scene frame.

    depths: of the levels that divide along each axis. box: (2, 3), lower and upper corner. cells: (c, 2, 3) float32,
    corners of the cells with triangles. count: (c,), their triangles.
    """

    walls: tuple[F64, F64, F64]
    depths: tuple[int, int, int]
    box: F64
    cells: F32
    count: I32

    @cached_property
    def filled(self) -> tuple[NDArray[np.int64], ...]:
        """Numbers of cells with triangles in each layer across each axis."""
        middles = self.cells.astype(np.float64).mean(axis=1)
        return tuple(
            np.bincount(
                np.clip(np.searchsorted(walls, middles[:, axis]) - 1, 0, len(walls) - 2), minlength=len(walls) - 1
            )
            for axis, walls in enumerate(self.walls)
        )


MOST_CELLS = 400_000
"""Largest number of cells with triangles that are read."""


def find(found: Any) -> Grid | None:
    """The grid whose walls are the first polygons of each axis; None if they are no walls through the whole box.

    found: as `Structure.split_polygons` returns it.
    """
    kinds, depths, vertices = found["kind"], found["depth"].astype(int), found["vertices"].astype(np.float64)
    firsts = vertices[found["offsets"][:-1].astype(np.int64)]
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    walls: list[F64] = []
    levels: list[int] = []
    for axis in range(3):
        rows = np.flatnonzero(kinds == axis)
        level = int(depths[rows].min()) if len(rows) else 0
        inner = np.unique(firsts[rows[depths[rows] == level], axis])
        walls.append(np.unique(np.concatenate([box[:, axis], inner])))
        levels.append(level)
    used = {level for level, own in zip(levels, walls, strict=True) if len(own) > 2}
    # In a grid each axis has a level of its own; other trees of planes divide cells of one level along several axes.
    if len(used) != sum(len(own) > 2 for own in walls) or not used:
        return None
    return Grid((walls[0], walls[1], walls[2]), (levels[0], levels[1], levels[2]), box, *_NO_CELLS)


_NO_CELLS = np.zeros((0, 2, 3), np.float32), np.zeros(0, np.int32)


def with_cells(grid: Grid, structure: Structure) -> Grid:
    """The same grid with the cells that hold triangles."""
    found = structure.leaf_cells(1, MOST_CELLS)
    starts = found["offsets"].astype(np.int64)[found["cells"].astype(np.int64)]
    if len(starts) < 2:
        return grid
    low, high = (reduce.reduceat(found["vertices"], starts[:-1], axis=0) for reduce in (np.minimum, np.maximum))
    return replace(grid, cells=np.stack([low, high], axis=1), count=found["count"].astype(np.int32))


def choose(grid: Grid, eye: F64) -> tuple[int, int]:
    """The axis across which the layer lies that a viewer at `eye` (3,) sees best, and its place along that axis: it
    covers many directions, and neither all nor none of its cells hold triangles.
    """
    found: list[tuple[float, int, int]] = []
    size = grid.box[1] - grid.box[0]
    for axis in range(3):
        walls = grid.walls[axis]
        for share in PLACES:
            place = min(int(share * (len(walls) - 1)), len(walls) - 2)
            middle = (walls[place] + walls[place + 1]) / 2
            seen = _seen(grid, axis, middle, eye) * (LEVEL if axis == 2 else 1.0) * _varied(grid, (axis, place))
            away = abs(eye[axis] - middle)
            slant = min(away / max(SLANT * size[axis], np.finfo(np.float64).tiny), 1.0)
            found.append((seen * slant if away >= ASIDE * size[axis] else 0.0, axis, place))
    _, axis, place = max(found)
    return axis, place


def within(grid: Grid, layer: tuple[int, int]) -> NDArray[np.int64]:
    """Rows of the cells with triangles that lie in a layer."""
    axis, place = layer
    middle = grid.walls[axis][place : place + 2].mean()
    return np.flatnonzero((grid.cells[:, 0, axis] <= middle) & (middle < grid.cells[:, 1, axis]))


def _varied(grid: Grid, layer: tuple[int, int]) -> float:
    """1 for a layer of which half of the cells hold triangles, less for one that is fuller or emptier."""
    others = [len(walls) - 1 for axis, walls in enumerate(grid.walls) if axis != layer[0]]
    share = min(float(grid.filled[layer[0]][layer[1]]) / max(others[0] * others[1], 1), 1.0)
    return 0.05 + 0.95 * 2.0 * float(np.sqrt(share * (1.0 - share)))


def _seen(grid: Grid, axis: int, middle: float, eye: F64) -> float:
    """Steradians that a plane through the whole grid covers."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    ring = np.tile(grid.box[0], (4, 1))
    ring[1:3, first], ring[2:, second], ring[:, axis] = grid.box[1, first], grid.box[1, second], middle
    return float(sight.solid_angles(ring, np.array([0, 4]), eye)[0])


def cut(grid: Grid, layer: tuple[int, int], kinds: Sequence[str]) -> Planes:
    """The walls of these kinds between the cells of a layer, as from `choose`: strips as high as the layer."""
    across, place = layer
    rings: list[F32] = []
    owners: list[int] = []
    low, high = grid.walls[across][place : place + 2]
    for axis in range(3):
        if axis == across or planes.KINDS[axis] not in kinds:
            continue
        along = 3 - across - axis
        ring = np.zeros((len(grid.walls[axis]), 4, 3))
        ring[:, :, axis] = grid.walls[axis][:, None]
        ring[:, :, along] = grid.box[[0, 1, 1, 0], along]
        ring[:, :, across] = [low, low, high, high]
        rings.append(ring.astype(np.float32))
        owners += [axis] * len(ring)
    order = np.argsort([grid.depths[axis] for axis in owners], kind="stable")
    corners = np.concatenate(rings)[order] if rings else np.zeros((0, 4, 3), np.float32)
    kind = np.array(owners, np.int32)[order]
    depth = np.array(grid.depths, np.int32)[kind] if len(kind) else np.zeros(0, np.int32)
    offsets = np.arange(0, 4 * len(corners) + 1, 4, dtype=np.int32)
    return Planes(corners.reshape(-1, 3), offsets, depth, kind, hidden=0, complete=True, across=across)


def squares(grid: Grid, layer: tuple[int, int]) -> tuple[Planes, F32]:
    """The cells of a layer that hold triangles as squares at half of its height, and the colour of each, (p, 3)."""
    axis, _ = layer
    rows = within(grid, layer)
    cells, count = grid.cells[rows], grid.count[rows]
    rings = np.repeat(cells[:, :1], 4, axis=1)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rings[:, 1:3, first], rings[:, 2:, second] = cells[:, 1:, first], cells[:, 1:, second]
    rings[:, :, axis] = cells[:, :, axis].mean(axis=1, keepdims=True)
    kind = np.full(len(rows), axis, np.int32)
    offsets = np.arange(0, 4 * len(rows) + 1, 4, dtype=np.int32)
    depth = np.full(len(rows), max(grid.depths), np.int32)
    made = Planes(rings.reshape(-1, 3), offsets, depth, kind, hidden=0, complete=True, across=axis)
    return made, colours.of_counts(count)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The 64 rays of one tile, the cells they visit, and the work that a tile traversal saves over single rays.

Each ray is traced alone to find the cells it visits; the structure's own traversal then traces the tile as a whole, and
the steps and tests of both are reported. Cells visited by more rays are brighter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import colours
from ..base.arrays import F32, F64
from . import cells, planes
from .cells import Cells
from .planes import Level, Shape

if TYPE_CHECKING:
    from ..base.interface import Structure

SIDE = 8
"""Rays along each side of a tile, the same as in the native tile traversals."""

CORNERS = (0, SIDE - 1, SIDE * SIDE - 1, SIDE * SIDE - SIDE)
"""Indices of the corner rays, counter-clockwise."""

SIDE_FILL = (0.10, 0.16)
"""Opacity of the beam's sides at their centre and at their rim, relative to that of its edges."""


def tile(origin: F64, direction: F64, up: F64, spacing: float, *, parallel: bool, side: int = SIDE) -> tuple[F64, F64]:
    """Origins and directions, (side², 3) each, of the tile around a ray, in row-major order.

    spacing: distance between neighbours of the 8 along each side, of directions scaled to length one from one
    origin, or of origins if `parallel`. side: number of rays along each side, which fill the same tile.
    """
    # Build an orthonormal frame around the ray; `up` parallel to it is replaced by the least aligned axis.
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
    right /= np.linalg.norm(right)
    # Place the rays on a centred grid in the plane across the ray.
    steps = spacing * np.linspace(-(SIDE - 1) / 2, (SIDE - 1) / 2, side)
    across = steps[None, :, None] * right + steps[:, None, None] * np.cross(right, forward)
    across = across.reshape(-1, 3)
    if parallel:
        return origin + across, np.tile(forward, (len(across), 1))
    return np.tile(origin, (len(across), 1)), forward + across


@dataclass(frozen=True, eq=False)
class Beam:
    """The result of tracing a tile.

    origins, directions: (64, 3) float64, scene frame. t: (64,), inf for a miss. cells: each leaf that some ray tests,
    with the number of those rays as its count. hits: (h, 3, 3), the distinct triangles hit. visits: leaf visits of
    single rays, in total. alone, together: steps and tests of the 64 single rays, and of the structure's tile
    traversal.
    """

    origins: F64
    directions: F64
    t: F64
    cells: Cells
    hits: F32
    visits: int
    alone: tuple[int, int]
    together: tuple[int, int]

    def lines(self) -> list[str]:
        """The counts as lines of text."""
        lines = [
            f"{len(self.t)} rays visit {len(self.cells):,} leaves, {self.visits:,} times",
            f"One by one: {self.alone[0]:,} steps, {self.alone[1]:,} tests",
        ]
        if self.together == self.alone:
            return [*lines, "This traversal traces each ray separately"]
        return [*lines, f"Together: {self.together[0]:,} steps, {self.together[1]:,} tests"]


def follow(structure: Structure, origins: F64, directions: F64) -> Beam:
    """Trace the rays of a tile through a native structure, one by one and together."""
    known: dict[bytes, list[Any]] = {}
    hits: dict[int, F32] = {}
    distances, visits, steps, tests = [], 0, 0, 0
    # Trace each ray alone; a leaf is identified by the bytes of its faces, because paths carry no node ids.
    for origin, direction in zip(origins, directions, strict=True):
        path = cells.follow(structure, origin.tolist(), direction.tolist())
        distances.append(path.t)
        steps, tests = steps + path.steps, tests + path.tests
        visits += int(path.tested.sum())
        for number in np.flatnonzero(path.tested):
            faces = _faces(path.cells, int(number))
            known.setdefault(faces[0].tobytes(), [faces, 0])[1] += 1
        if path.triangle >= 0:
            hits[path.triangle] = path.corners[path.ids == path.triangle][0]
    # Trace the tile once with the structure's own traversal to count the shared work.
    counters = structure.closest(
        origins.astype(np.float32), directions.astype(np.float32), order="tile8", counters=True, threads=1
    ).counters
    assert counters is not None, "they were requested"
    return Beam(
        origins,
        directions,
        np.array(distances, np.float64),
        _gathered(list(known.values())),
        np.array(list(hits.values()), np.float32).reshape(-1, 3, 3),
        visits,
        (steps, tests),
        (int(counters["steps"].sum()), int(counters["tests"].sum())),
    )


def _faces(found: Cells, number: int) -> tuple[F32, Any]:
    """The vertices of one cell's faces, and the number of vertices of each face."""
    starts = found.offsets[found.cells[number] : found.cells[number + 1] + 1]
    return found.vertices[starts[0] : starts[-1]], np.diff(starts)


def _gathered(found: list[list[Any]]) -> Cells:
    """The cells with their visit counts, most visited first. found: pairs of faces, as from `_faces`, and a count."""
    found = sorted(found, key=lambda one: -one[1])
    # Concatenate the faces of all cells, and convert sizes to offsets.
    sizes = [sizes for (_, sizes), _ in found]
    return Cells(
        np.concatenate([np.zeros((0, 3), np.float32), *(corners for (corners, _), _ in found)]),
        np.concatenate([[0], np.cumsum(np.concatenate([[], *sizes]))]).astype(np.int32),
        np.concatenate([[0], np.cumsum([len(one) for one in sizes])]).astype(np.int32),
        np.array([count for _, count in found], np.int32),
        hidden=0,
    )


def levels(beam: Beam, opacity: float, width: float) -> list[Level]:
    """The levels to draw: cells, faintest where one ray visits, then the triangles hit, then the beam.

    opacity, width: of the beam's edges; width in pixels.
    """
    made: list[Level] = []
    found = beam.cells
    # Map the share of rays that visit a cell to colour and strength.
    if len(found):
        share = found.count / len(beam.t)
        rgb = colours.false_colour(colours.CELLS_FROM + (1 - colours.CELLS_FROM) * share)
        strength = (opacity * (0.35 + 0.55 * share)).astype(np.float32)
        made.append(found.level(rgb, strength, width))
    if len(beam.hits):
        made.append(cells.triangles(beam.hits, cells.HIT_RGB, opacity, 1.0, 0.8))
    made.append(_sides(beam, opacity, width))
    return made


def ends(beam: Beam) -> F64:
    """(4, 3) end points of the beam's corner rays: their hits, or the distance of the farthest hit for
    rays that miss.
    """
    met = beam.t[np.isfinite(beam.t)]
    far = float(met.max()) if len(met) else 1.0
    corners = list(CORNERS)
    t = np.where(np.isfinite(beam.t[corners]), beam.t[corners], far)
    end: F64 = beam.origins[corners] + t[:, None] * beam.directions[corners]
    return end


def _sides(beam: Beam, opacity: float, width: float) -> Level:
    """The four quadrilaterals between neighbouring corner rays."""
    near, far = beam.origins[list(CORNERS)], ends(beam)
    quads = [(near[i], far[i], far[j], near[j]) for i, j in zip(range(4), (1, 2, 3, 0), strict=True)]
    shape = Shape(
        np.array(quads, np.float32).reshape(-1, 3),
        np.arange(0, 17, 4, dtype=np.int32),
        np.tile(np.array(cells.RAY_RGB, np.float32), (4, 1)),
        np.full(4, opacity, np.float32),
    )
    return planes.level(shape, np.arange(4), 0, max(0.8 * width, 1.0), SIDE_FILL)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Beams of polygons on their way through an octree, as the native traversal records it: where each cell clips, splits
or hands on a beam, and where it ends (González López and Gisbert Cantó, figures 2 and 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..base import native
from ..base.arrays import F32, F64, I32
from . import cells, planes
from .planes import Level, Shape

if TYPE_CHECKING:
    from ..base.interface import BeamPath, Structure

ENDED, SINGLES, HANDED_ON, CLIPPED, SPLIT, LEFT = range(6)
"""The actions of `BeamPath.action`."""

RGB = (cells.HIT_RGB, cells.RAY_RGB, (0.30, 0.93, 0.82), (1.0, 0.72, 0.16), (0.86, 0.46, 1.0), cells.PASSED_RGB)
"""The colour of each action: pink, white, turquoise, gold, violet and grey."""

SIDE = 48
"""Rays along each side of the beam, enough for beams to stay together through several cells."""

MOST_SINGLES = 400
"""Number of single rays that are drawn."""

LEAST = 1 / 24
"""Share of the rays that a part of the beam has if its polygon is drawn: smaller ones hide each other."""

WALLS, FACE_FILL, CELL_STRENGTH = (0.16, 0.10), (0.42, 0.30), 0.35
"""Opacity of a beam's sides and of its polygons, at their centre and at their rim, relative to that of their lines, and
opacity of the cells' lines relative to that of the polygons'.
"""

CUBE = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
"""Corners of the faces of a box: bit `k` of a corner's number stands for the upper end along axis `k`."""


@dataclass(frozen=True, eq=False)
class PolygonBeam:
    """The result of tracing a tile as beams of polygons.

    origins, directions: (n, 3) float64, scene frame. t: (n,), inf for a miss. path: the steps. hits: (h, 3, 3), the
    distinct triangles hit.
    """

    origins: F64
    directions: F64
    t: F64
    path: BeamPath
    hits: F32

    @property
    def parallel(self) -> bool:
        """Whether the rays share their direction and not their origin."""
        return bool((self.origins != self.origins[0]).any())

    @property
    def drawn(self) -> npt.NDArray[np.bool_]:
        """Which steps have enough rays to be drawn."""
        drawn: npt.NDArray[np.bool_] = np.diff(self.path["ray_offsets"]) >= LEAST * len(self.t)
        return drawn

    def count(self, action: int) -> int:
        """Number of steps with this action."""
        return int((self.path["action"] == action).sum())

    def lines(self) -> list[str]:
        """The counts as lines of text."""
        counters = self.path["hits"].counters
        assert counters is not None, "they are recorded"
        singles, inner = int(counters["beam_singles"].sum()), self.path["action"] != LEFT
        return [
            f"{len(self.t):,} rays go through {len(np.unique(self.path['node'][inner])):,} cells as polygons",
            f"{self.count(HANDED_ON):,} handed on, {self.count(CLIPPED):,} clipped, {self.count(SPLIT):,} split",
            f"{int(self.path['tested'].sum()):,} tested, {self.count(ENDED):,} ended, {self.count(LEFT):,} left",
            f"{singles:,} rays went on singly from {self.count(SINGLES):,}",
            f"{int((~self.drawn).sum()):,} parts of fewer than {int(np.ceil(LEAST * len(self.t)))} rays are not drawn",
        ]


def traces(structure: Structure) -> bool:
    """Whether a native structure traces camera rays as polygons."""
    return native.load().effective(structure.spec).get("traversal") == "polygon"


def follow(structure: Structure, origins: F64, directions: F64, vertices: F32, triangles: I32) -> PolygonBeam:
    """Trace the rays of a tile through a structure that traces polygons. vertices, triangles: those of its scene."""
    path = structure.trace_beam(origins.astype(np.float32), directions.astype(np.float32))
    found = np.unique(path["hits"].triangle)
    hits = vertices[triangles[found[found >= 0]]].astype(np.float32)
    return PolygonBeam(origins, directions, path["hits"].t.astype(np.float64), path, hits)


def levels(beam: PolygonBeam, opacity: float, width: float) -> list[Level]:
    """The levels to draw: the cells, the sides of the beams from face to face in the colour of what becomes of them
    between, their polygons in the faces, the triangles hit, and the rays that went on singly.

    opacity, width: of the polygons' lines; width in pixels.
    """
    # Most rays may go on singly from the root on, or leave it at once.
    kept = np.flatnonzero(np.isin(beam.path["action"], (HANDED_ON, CLIPPED, ENDED)) & beam.drawn)
    made = [_cells(beam.path, kept, CELL_STRENGTH * opacity)] if len(kept) else []
    for polygons, fill, wide in ((_sides(beam), WALLS, 0.4 * width), (_sections(beam), FACE_FILL, width)):
        if polygons:
            made.append(_level(polygons, opacity, max(wide, 1.0), fill))
    if len(beam.hits):
        made.append(cells.triangles(beam.hits, cells.HIT_RGB, 0.6 * opacity, 1.0, 0.25))
    singles = _singles(beam)
    if len(singles):
        made.append(cells.segments(singles, 0.5 * opacity, 1.0))
    return made


def _level(polygons: list[tuple[int, F64]], opacity: float, width: float, fill: tuple[float, float]) -> Level:
    """Polygons, each with the action that colours it."""
    sizes = [len(polygon) for _, polygon in polygons]
    shape = Shape(
        np.concatenate([polygon for _, polygon in polygons]).astype(np.float32),
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32),
        np.array(RGB, np.float32)[[action for action, _ in polygons]],
        np.full(len(polygons), opacity, np.float32),
    )
    return planes.level(shape, np.arange(len(polygons)), 0, width, fill)


def _cells(path: BeamPath, steps: npt.NDArray[np.intp], strength: float) -> Level:
    """The boxes of the leaves of some steps, those with tests in the colour of tested triangles."""
    inside = steps[np.unique(path["node"][steps], return_index=True)[1]]
    # Take each corner's coordinates from the low or the high end of the box.
    upper = (np.arange(8)[:, None] >> np.arange(3) & 1).astype(bool)
    corners = np.where(upper, path["high"][inside, None], path["low"][inside, None])
    count = 6 * len(inside)
    rgb = np.where(path["tested"][inside, None], cells.TESTED_RGB, cells.PASSED_RGB).astype(np.float32)
    shape = Shape(
        corners[:, CUBE].reshape(-1, 3).astype(np.float32),
        np.arange(0, 4 * count + 1, 4, dtype=np.int32),
        np.repeat(rgb, 6, axis=0),
        np.full(count, strength, np.float32),
    )
    return planes.level(shape, np.arange(count), 0, 1.0, (0.0, 0.04))


def _polygon(path: BeamPath, step: int) -> F64:
    found: F64 = path["vertices"][path["offsets"][step] : path["offsets"][step + 1]]
    return found


def _sections(beam: PolygonBeam) -> list[tuple[int, F64]]:
    """The polygon of each step whose rays do not go on singly, and its action; the parts of a beam that is split,
    in one face, in place of the whole, and in its colour.
    """
    action, parent = beam.path["action"], beam.path["parent"]
    colour = np.where((parent >= 0) & (action[parent] == SPLIT), SPLIT, action)
    steps = np.flatnonzero((action != SPLIT) & (action != SINGLES) & beam.drawn).tolist()
    found = ((int(colour[step]), _polygon(beam.path, step)) for step in steps)
    return [(shade, polygon) for shade, polygon in found if len(polygon) > 2]


def _sides(beam: PolygonBeam) -> list[tuple[int, F64]]:
    """The sides of each part of a beam, from the face where the beam enters a node to that where the part leaves it,
    and the action there; of a beam that begins from its origin on.
    """
    path, made = beam.path, []
    for step in map(int, np.flatnonzero(beam.drawn)):
        far, parent = _polygon(path, step), path["parent"][step]
        if len(far) < 3 or (parent < 0 and beam.parallel):
            continue
        near = _towards(beam, far, int(parent))
        if np.abs(far - near).max() > 1e-9 * np.abs(far).max():
            action = SINGLES if parent < 0 else int(path["action"][parent])
            ahead = np.roll(np.arange(len(far)), -1)
            made += [(action, quad) for quad in np.stack([near, far, far[ahead], near[ahead]], axis=1)]
    return made


def _towards(beam: PolygonBeam, points: F64, step: int) -> F64:
    """Where the rays through points in faces, (n, 3), cross the face of an earlier step; -1 = their origin."""
    origin, face = beam.origins[0], -1 if step < 0 else int(beam.path["face"][step])
    back = np.broadcast_to(-beam.directions[0], points.shape) if beam.parallel else origin - points
    if face < 0:
        return np.broadcast_to(origin, points.shape) if not beam.parallel else points
    axis, plane = face // 2, _plane(beam.path, step)
    share = (plane - points[:, axis]) / np.where(back[:, axis] == 0, np.inf, back[:, axis])
    found: F64 = points + share[:, None] * back
    return found


def _plane(path: BeamPath, step: int) -> float:
    """Coordinate of the face of a step along its axis."""
    face = int(path["face"][step])
    return float(path["high" if (face % 2 == 1) else "low"][step, face // 2])


def _singles(beam: PolygonBeam) -> F64:
    """(m, 2, 3), rays that went on singly, from the face where they did to their hits; those that miss to the farthest
    hit of all.
    """
    path = beam.path
    steps = np.flatnonzero((path["action"] == SINGLES) & (path["face"] >= 0))
    rays, starts = [np.zeros(0, np.int64)], [np.zeros(0)]
    for step in map(int, steps):
        own = path["rays"][path["ray_offsets"][step] : path["ray_offsets"][step + 1]]
        axis = int(path["face"][step]) // 2
        with np.errstate(divide="ignore", invalid="ignore"):
            starts.append((_plane(path, step) - beam.origins[own, axis]) / beam.directions[own, axis])
        rays.append(own.astype(np.int64))
    every, start = np.concatenate(rays), np.concatenate(starts)
    # Draw some of many, all alike.
    taken = np.unique(np.linspace(0, len(every) - 1, min(len(every), MOST_SINGLES)).astype(int))
    every, start = every[taken], start[taken]
    met = beam.t[np.isfinite(beam.t)]
    end = np.where(np.isfinite(beam.t[every]), beam.t[every], float(met.max(initial=0.0)))
    kept = np.isfinite(start) & (start < end)
    every, ends = every[kept], np.stack([start, end], axis=1)[kept]
    found: F64 = beam.origins[every, None] + ends[..., None] * beam.directions[every, None]
    return found

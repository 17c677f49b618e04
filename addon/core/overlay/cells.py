# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf cells and the traversal of one ray, as coloured lines and surfaces for a viewport."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base import colours
from ..base.arrays import F32, F64, I32
from . import planes
from .planes import Level, Shape

if TYPE_CHECKING:
    from ..base.interface import Structure

FACES = 6
"""Assumed number of polygons per cell, to convert a polygon limit into a cell limit."""

FAINTEST = 0.25
"""Strength of the emptiest cells relative to the fullest."""

CELL_FILL = (0.22, 0.30)
"""Opacity of a cell's faces at their centre and at their rim, relative to that of its lines."""

BUNDLES = 8
"""Number of levels that cells are drawn in: the emptiest first, the fullest over them."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Leaf cells, fullest first.

    vertices: (v, 3) float32, scene frame. offsets: (f + 1,) int32, first vertex of each face. cells: (c + 1,) int32,
    first face of each cell. count: (c,) triangles in each. hidden: number of matching cells that exceed the limit.
    """

    vertices: F32
    offsets: I32
    cells: I32
    count: I32
    hidden: int

    def __len__(self) -> int:
        return len(self.count)

    def shape(self, rgb: F32, strength: F32) -> Shape:
        """The polygons in the colour, (c, 3), and the strength, (c,), of their cells."""
        faces = np.diff(self.cells)
        return Shape(self.vertices, self.offsets, np.repeat(rgb, faces, axis=0), np.repeat(strength, faces))

    def level(self, rgb: F32, strength: F32, width: float) -> Level:
        """The cells along rays as one level. width: of the strongest lines of the picture, in pixels."""
        polygons = np.arange(self.cells[-1])
        return planes.level(self.shape(rgb, strength), polygons, 0, max(0.6 * width, 1.0), (0.05, 0.1))


def choose(structure: Structure, least: int, most: int) -> Cells:
    """The leaves of a native structure with at least `least` triangles; `most` limits their polygons in total."""
    found = structure.leaf_cells(least, max(most // FACES, 1))
    return Cells(
        np.ascontiguousarray(found["vertices"], np.float32),
        found["offsets"].astype(np.int32),
        found["cells"].astype(np.int32),
        found["count"].astype(np.int32),
        found["hidden"],
    )


def levels(cells: Cells, opacity: float, width: float) -> list[Level]:
    """The cells in levels: those with few triangles first and faint, those with many last and strong.

    opacity, width: of the lines of the fullest cells; width in pixels.
    """
    if not len(cells):
        return []
    # Fade cells with few triangles, and all cells when there are many.
    rgb = colours.of_counts(cells.count)
    share = colours.shares(cells.count)
    crowd = min(1.0, planes.CROWD / len(cells)) ** (planes.CROWD_FADE / 2)
    strength = (opacity * crowd * (FAINTEST + (1 - FAINTEST) * share)).astype(np.float32)
    shape = cells.shape(rgb, strength)
    # Draw from the emptiest bundle to the fullest; cells are sorted in the opposite order.
    made = []
    for part in reversed(np.array_split(np.arange(len(cells)), min(BUNDLES, len(cells)))):
        polygons = np.arange(cells.cells[part[0]], cells.cells[part[-1] + 1])
        made.append(planes.level(shape, polygons, 0, max(width * float(share[part[0]]), 1.0), CELL_FILL))
    return made


@dataclass(frozen=True, eq=False)
class Path:
    """The traversal of one ray, as recorded by the native module.

    origin, direction: (3,) float64, scene frame. any_hit: whether the ray ends at any hit, as shadow rays do. t,
    triangle: of the nearest hit, or of the one that ended the ray; triangle is -1 for a miss. steps, tests: the
    traversal's own counters. cells: leaves along the ray, with their numbers of triangles. enter, leave: (c,)
    parameters of the ray in each cell. tested: (c,) bool. reached: (c,), inner nodes that the traversal had counted
    when it tested a leaf. corners: (t, 3, 3), the distinct triangles of all tested leaves; ids: (t,). crossings: the
    planes crossed, kinds as in planes.KINDS.
    """

    origin: F64
    direction: F64
    any_hit: bool
    t: float
    triangle: int
    steps: int
    tests: int
    cells: Cells
    enter: F64
    leave: F64
    tested: NDArray[np.bool_]
    reached: NDArray[np.uint32]
    corners: F32
    ids: I32
    crossings: planes.Planes

    def lines(self) -> list[str]:
        """The counts as lines of text."""
        full, empty = int(self.tested.sum()), int((~self.tested).sum())
        met = f"triangle {self.triangle:,} at {self.t:.4g}" if self.triangle >= 0 else "nothing"
        return [
            f"{self.steps:,} inner nodes, {len(self.crossings):,} planes crossed",
            f"{full:,} {'leaf' if full == 1 else 'leaves'} tested, {empty:,} others passed",
            f"{self.tests:,} triangles tested, {len(self.ids):,} different",
            f"Ends at {met}" if self.any_hit and self.triangle >= 0 else f"Hits {met}",
        ]


def follow(
    structure: Structure,
    origin: Sequence[float],
    direction: Sequence[float],
    t_max: float = np.inf,
    *,
    any_hit: bool = False,
) -> Path:
    """Trace a ray through a native structure and record its traversal; t in [0, t_max], in units of the direction.

    any_hit: end the ray at the first hit that is found, as shadow rays end.
    """
    found = structure.trace_path(list(origin), list(direction), 0.0, t_max, any_hit=any_hit)
    visits, crossed = found["visits"], found["crossings"]
    offsets = visits["triangle_offsets"].astype(np.int64)
    tested = np.asarray(visits["tested"], bool)
    # Keep each triangle of the tested leaves once.
    kept = np.repeat(tested, np.diff(offsets))
    ids, first = np.unique(visits["triangles"].astype(np.int32)[kept], return_index=True)
    corners = visits["corners"].reshape(-1, 3, 3)[kept][first]
    # Convert the native arrays; counts are differences of offsets.
    cells = Cells(
        np.asarray(visits["vertices"], np.float32),
        visits["offsets"].astype(np.int32),
        visits["cells"].astype(np.int32),
        np.diff(offsets).astype(np.int32),
        hidden=0,
    )
    crossings = planes.Planes(
        np.asarray(crossed["vertices"], np.float32),
        crossed["offsets"].astype(np.int32),
        crossed["depth"].astype(np.int32),
        crossed["kind"].astype(np.int32),
        hidden=0,
        complete=True,
    )
    counters = found["counters"]
    return Path(
        np.array(origin, np.float64),
        np.array(direction, np.float64),
        any_hit,
        found["t"],
        found["triangle"],
        counters["steps"],
        counters["tests"],
        cells,
        visits["enter"],
        visits["leave"],
        tested,
        visits["steps"],
        corners,
        ids,
        crossings,
    )


PASSED_RGB = (0.55, 0.60, 0.66)
TESTED_RGB = (1.0, 0.62, 0.25)
HIT_RGB = (1.0, 0.2, 0.45)
RAY_RGB = (1.0, 1.0, 1.0)
"""Colours of cells that are passed without a test, triangles tested, the triangle hit, and the ray."""


def path_levels(path: Path, tints: Mapping[str, Sequence[float]], opacity: float, width: float) -> list[Level]:
    """The levels of a ray's traversal: planes faintest, then cells coloured in visiting order, triangles, the hit, the
    ray.

    tints: red, green and blue of each kind of plane. opacity, width: of the strongest lines; width in pixels.
    """
    made: list[Level] = []
    # Add the crossed planes, tinted by kind.
    crossings = path.crossings
    if len(crossings):
        table = np.array([tints[kind] for kind in planes.KINDS], np.float32)
        shape = Shape(
            crossings.vertices,
            crossings.offsets,
            table[crossings.kind],
            np.full(len(crossings), 0.35 * opacity, np.float32),
        )
        made.append(planes.level(shape, np.arange(len(crossings)), 0, 1.0, (0.0, 0.1)))
    # Add the cells; their brightness shows the order in which they are tested.
    cells = path.cells
    if len(cells):
        order = np.cumsum(path.tested) / max(int(path.tested.sum()), 1)
        rgb = np.where(
            path.tested[:, None],
            colours.false_colour(colours.CELLS_FROM + (1 - colours.CELLS_FROM) * order),
            np.array(PASSED_RGB, np.float32),
        ).astype(np.float32)
        strength = np.where(path.tested, 0.9 * opacity, 0.3 * opacity).astype(np.float32)
        made.append(cells.level(rgb, strength, width))
    # Add the tested triangles, with the hit on top.
    if len(path.ids):
        made.append(triangles(path.corners, TESTED_RGB, 0.8 * opacity, 1.0, 0.35))
        hit = path.corners[path.ids == path.triangle]
        if len(hit):
            made.append(triangles(hit, HIT_RGB, opacity, width, 0.9))
    made.append(_ray(path, opacity, width))
    return made


def triangles(corners: F32, rgb: Sequence[float], strength: float, width: float, fill: float) -> Level:
    """A level of (n, 3, 3) triangles in one colour."""
    count = len(corners)
    shape = Shape(
        np.ascontiguousarray(corners.reshape(-1, 3)),
        np.arange(0, 3 * count + 1, 3, dtype=np.int32),
        np.tile(np.array(rgb, np.float32), (count, 1)),
        np.full(count, strength, np.float32),
    )
    return planes.level(shape, np.arange(count), 0, width, (fill, fill))


def ends(path: Path) -> tuple[float, float]:
    """Ray parameters at which the drawn ray starts and ends: at its hit, or just beyond the last cell."""
    known = path.leave[np.isfinite(path.leave)]
    last = float(known.max()) if len(known) else 0.0
    return 0.0, path.t if np.isfinite(path.t) else last * 1.05


def segments(lines: F64, opacity: float, width: float) -> Level:
    """A level of (n, 2, 3) lines in the colour of rays."""
    nothing = np.zeros((0, 3), np.float32)
    colour = np.tile(np.array([*RAY_RGB, opacity], np.float32), (2 * len(lines), 1))
    return Level(0, width, lines.reshape(-1, 3).astype(np.float32), colour, nothing, np.zeros((0, 4), np.float32))


def _ray(path: Path, opacity: float, width: float) -> Level:
    line = np.array([path.origin + t * path.direction for t in ends(path)])
    return segments(line[None], opacity, 1.2 * width)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of planes of a structure, and the levels of it that are shown at first, which can be seen through."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32
from . import layers, planes, sight
from .layers import Grid

if TYPE_CHECKING:
    from ..base.interface import Structure

FETCHED, DEEPEST = 60_000, 60
"""Number of polygons, shallowest first, and depth, by which a structure is judged."""

MOST_PLANES, MOST_FACES, MOST_BESIDE = 140, 440, 60
"""Numbers of planes and of faces of boxes up to which levels are shown at first, and of slabs or of polygons beside
marked ones.
"""

MOST_OBLIQUE, HIGHEST = 16, 128
"""Number of oblique planes that are marked, the largest, and number of highest ones that they are chosen from."""


@dataclass(frozen=True)
class First:
    """The first view: levels low to high, or, of a grid, the layer (axis, place) of its cells. marked: whether what the
    structure has besides planes across axes, or besides boxes parallel to them, is shown apart from its levels.
    """

    low: int
    high: int
    layer: tuple[int, int] | None = None
    marked: bool = False


@dataclass(frozen=True, eq=False)
class Survey:
    """kinds: names of planes that occur, in the order of KINDS. counts: (depths,), number of polygons of each depth.

    vertices, offsets, depth: polygons of the levels that may be shown at first. box: (2, 3), lower and upper corner of
    all polygons. grid: its walls, if the first level alone would hide the scene. oblique: the highest oblique planes of
    a tree that has planes across axes, too. turned: whether boxes are turned.
    """

    kinds: tuple[str, ...]
    counts: NDArray[np.int64]
    vertices: F32
    offsets: I32
    depth: NDArray[np.int64]
    box: F64
    grid: Grid | None = None
    oblique: planes.Planes | None = None
    turned: bool = False

    @property
    def most(self) -> int:
        """Number of polygons of the levels that are shown at first."""
        if self.turned or self.oblique is not None or "SLABS" in self.kinds:
            return MOST_BESIDE
        return MOST_FACES if "BOXES" in self.kinds else MOST_PLANES

    def first(self, eye: F64) -> First:
        """The first view of a viewer at `eye`, (3,) in the scene frame: the levels from the root on of which a line
        of sight crosses up to CLEAR surfaces in the mean and that have up to `most` polygons together, fewer boxes from
        inside, but at least the first level that has polygons.
        """
        if not len(self.counts):
            return First(0, 0)
        if self.grid is not None:
            layer = layers.choose(self.grid, eye)
            return First(0, len(self.counts) - 1, layer)
        inside = bool(((eye >= self.box[0]) & (eye <= self.box[1])).all())
        most = min(self.most, MOST_BESIDE) if inside and "BOXES" in self.kinds else self.most
        faces = np.cumsum(self.faces(eye))
        clear = (faces <= planes.CLEAR) & (np.cumsum(self.counts[: len(faces)]) <= most)
        last = len(clear) - 1 if clear.all() else int(np.argmin(clear)) - 1
        marked = self.turned or self.oblique is not None
        return First(0, max(last, int(np.argmax(self.counts > 0))), marked=marked)

    def faces(self, eye: F64) -> F64:
        """(levels,), number of surfaces of each level that a line of sight from `eye` crosses, in the mean over all
        lines that meet the structure. Polygons too near for a surface do not count, nor do the faces of boxes that are
        turned away: half of them.
        """
        angles = sight.solid_angles(self.vertices, self.offsets, eye)
        angles[angles > sight.NEAR] = 0.0
        sides = 2.0 if "BOXES" in self.kinds else 1.0
        found: F64 = np.bincount(self.depth, angles) / (sides * sight.whole(self.box, eye))
        return found


def survey(structure: Structure) -> Survey:
    """Look at the shallow planes of a native structure."""
    found = structure.split_polygons(DEEPEST, FETCHED)
    kinds, depths = found["kind"], found["depth"].astype(np.int64)
    if not len(kinds):
        nothing = np.zeros(0, np.int64)
        return Survey((), nothing, np.zeros((0, 3), np.float32), np.zeros(1, np.int32), nothing, np.zeros((2, 3)))
    occurring = {int(kind) for kind in np.unique(kinds)}
    if found["hidden"] and structure.statistics["nodes_oblique"]:
        occurring.add(planes.KINDS.index("OBLIQUE"))
    names = tuple(planes.KINDS[kind] for kind in sorted(occurring))
    counts = np.bincount(depths)
    # Keep the levels that may be shown at first, whose polygons come first.
    occupied = int(np.argmax(counts > 0))
    kept = int(counts[: occupied + 1].sum())
    kept = max(kept, int(counts[np.cumsum(counts) <= MOST_FACES].sum()))
    offsets = found["offsets"][: kept + 1].astype(np.int32)
    vertices = found["vertices"]
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64)
    return Survey(
        names,
        counts,
        np.ascontiguousarray(vertices[: offsets[-1]], np.float32),
        offsets,
        depths[:kept],
        box,
        _grid(structure, found, occupied),
        _highest_oblique(found),
        turned={"OBLIQUE", "BOXES"} <= set(names),
    )


def _highest_oblique(found: Any) -> planes.Planes | None:
    """The largest of the highest oblique planes, highest first; None unless there are planes across axes, too."""
    oblique = np.flatnonzero(found["kind"] == planes.KINDS.index("OBLIQUE"))[:HIGHEST]
    if not len(oblique) or not (found["kind"] < planes.KINDS.index("OBLIQUE")).any():
        return None
    highest = planes.taken(found, oblique)
    area = planes.crossings(highest.vertices, highest.offsets)
    return planes.taken(found, oblique[np.sort(np.argsort(-area, kind="stable")[:MOST_OBLIQUE])])


def _grid(structure: Structure, found: Any, occupied: int) -> Grid | None:
    """The grid of these polygons, if the walls of its first level hide each other from everywhere."""
    level = found["depth"] == occupied
    each = planes.crossings(found["vertices"], found["offsets"])
    grid = layers.find(found) if float(each[level].sum()) > planes.CLEAR else None
    return layers.with_cells(grid, structure) if grid is not None else None

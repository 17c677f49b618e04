# SPDX-License-Identifier: GPL-3.0-or-later
"""Split planes of a structure as coloured lines and triangles for a viewport."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32
from ..tree.regions import areas
from . import sight

if TYPE_CHECKING:
    from ..base.interface import Structure

KINDS = ("X", "Y", "Z", "OBLIQUE", "SLABS", "OCTANTS", "BOXES")
"""Names of the native module's polygon kinds, indexed by their number."""

MOST_FETCHED = 400_000
"""Largest number of polygons fetched from a structure before kinds and depths are filtered: 30 MB."""

FADE = 0.84
"""Factor on the opacity from each level to the next deeper one."""

FAINTEST = 0.3
"""Smallest product of these factors."""

THINNING = 0.8
"""Factor on the line width from each level to the next deeper one; lines are at least one pixel wide."""

CROWD, CROWD_FADE = 150, 0.5
"""Number of polygons of a level from which its opacity falls, and the power of that fall: a thousand opaque lines would
merge into one area.
"""

SHEET = 40
"""Number of walls of a grid's layer from which its lines are thinner, and somewhat fainter."""

CLEAR, FOG = 4.5, 0.7
"""Numbers of surfaces behind each other: up to which levels are shown at first, and from which all surfaces are fainter
(chosen by looking at pictures).
"""

INSIDE = 0.5
"""Factor on FOG for a viewer inside the structure, who has nothing but surfaces around."""

PANE = (0.0, 0.11)
"""Opacity of a surface at its centre and at its rim, relative to that of its lines: the rims stay visible, and dozens
of stacked surfaces still let the scene show through.
"""


@dataclass(frozen=True, eq=False)
class Planes:
    """Selected polygons, shallowest first.

    vertices: (v, 3) float32, scene frame. offsets: (p + 1,) int32, first vertex of each polygon. depth, kind: (p,)
    int32. hidden: number of matching polygons beyond the limit. complete: False if there may be more than `hidden`.
    across: the axis across which they are one layer of a grid's cells, or -1.
    """

    vertices: F32
    offsets: I32
    depth: I32
    kind: I32
    hidden: int
    complete: bool
    across: int = -1

    def __len__(self) -> int:
        return len(self.depth)

    @property
    def levels(self) -> range:
        """The range of depths that occur."""
        return range(int(self.depth.min()), int(self.depth.max()) + 1) if len(self) else range(0)


def choose(structure: Structure, depths: tuple[int, int], kinds: Sequence[str], most: int) -> Planes:
    """Split planes of a native structure at depths in [low, high] and of these kinds, at most `most`."""
    low, high = depths
    found = structure.split_polygons(max(high, 0), MOST_FETCHED)
    wanted = (found["depth"] >= low) & (found["depth"] <= high)
    wanted &= np.isin(found["kind"], [KINDS.index(kind) for kind in kinds])
    # Gather the vertices of the first polygons, which are the shallowest.
    chosen = np.flatnonzero(wanted)
    shown = chosen[:most]
    starts = found["offsets"].astype(np.int32)
    sizes = np.diff(starts)[shown]
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    rows = np.repeat(starts[shown] - offsets[:-1], sizes) + np.arange(offsets[-1], dtype=np.int32)
    return Planes(
        np.ascontiguousarray(found["vertices"][rows], np.float32),
        offsets,
        found["depth"][shown].astype(np.int32),
        found["kind"][shown].astype(np.int32),
        hidden=len(chosen) - len(shown),
        complete=not found["hidden"],
    )


@dataclass(frozen=True, eq=False)
class Level:
    """The polygons of one depth, ready to draw.

    lines: (2e, 3) float32, two ends of each edge; line_colours (2e, 4). triangles: (3e, 3) float32, the centre of a
    polygon and two ends of an edge; fill_colours (3e, 4). width: of the lines, in pixels.
    """

    depth: int
    width: float
    lines: F32
    line_colours: F32
    triangles: F32
    fill_colours: F32


@dataclass(frozen=True, eq=False)
class Panes:
    """The drawing of the surfaces of planes. bare: (p,) bool, polygons without a surface. strength: of the others, 0 to
    1.
    """

    bare: NDArray[np.bool_]
    strength: float

    def key(self) -> tuple[bytes, float]:
        """Equal for panes that look the same."""
        return self.bare.tobytes(), self.strength


def panes(planes: Planes, eye: F64 | None = None) -> Panes:
    """The surfaces as a viewer at `eye`, (3,) in the scene frame, sees them: none of boxes around the viewer and none
    so near that it would veil the view, none of a grid's layer, and the others fainter the more of them lie behind each
    other.

    Without a viewer, as random lines through the structure meet them.
    """
    if eye is None or not len(planes):
        behind, bare = float(crossings(planes.vertices, planes.offsets).sum()), np.zeros(len(planes), bool)
        return Panes(bare, _step(min(1.0, FOG / behind)) if behind > 0 else 1.0)
    angles = sight.solid_angles(planes.vertices, planes.offsets, eye)
    bare = (angles > sight.NEAR) | (planes.across >= 0)
    bare |= sight.around(planes.vertices, planes.offsets, planes.kind == KINDS.index("BOXES"), eye)
    box = np.stack([planes.vertices.min(axis=0), planes.vertices.max(axis=0)]).astype(np.float64)
    directions = sight.whole(box, eye)
    behind = float(angles[~bare].sum()) / directions
    limit = FOG * INSIDE if directions == 4 * np.pi else FOG
    return Panes(bare, _step(min(1.0, limit / behind)) if behind > 0 else 1.0)


def _step(strength: float) -> float:
    """A strength rounded down to a sixteenth of an octave, so that small moves of the viewer change nothing."""
    return float(2.0 ** (np.floor(16 * np.log2(strength)) / 16))


def levels(
    planes: Planes,
    colours: Mapping[str, Sequence[float]],
    opacity: float,
    width: float,
    seen: Panes | None = None,
) -> list[Level]:
    """The polygons by depth, deepest first, so that fainter levels are drawn before stronger ones.

    colours: red, green and blue of each kind. opacity, width: of the shallowest level's lines; width in pixels. seen:
    their surfaces, by default as from no certain place.
    """
    table = np.array([colours[kind] for kind in KINDS], np.float32)
    seen = panes(planes) if seen is None else seen
    pane = (PANE[0], PANE[1] * seen.strength)
    made = []
    for depth in reversed(planes.levels):
        polygons = np.flatnonzero(planes.depth == depth)
        if not len(polygons):
            continue
        step = depth - planes.levels.start
        strength = opacity * max(FADE**step, FAINTEST) * min(1.0, CROWD / len(polygons)) ** CROWD_FADE
        wide = width * THINNING**step
        if planes.across >= 0:
            sheet = min(1.0, SHEET / len(planes))
            strength, wide = opacity * sheet ** (CROWD_FADE / 2), width * sheet
        strengths = np.full(len(planes), strength, np.float32)
        shape = Shape(planes.vertices, planes.offsets, table[planes.kind], strengths, ~seen.bare)
        made.append(level(shape, polygons, depth, max(wide, 1.0), pane))
    return made


@dataclass(frozen=True, eq=False)
class Shape:
    """Coloured polygons. vertices, offsets: as in Planes. rgb: (p, 3) float32. strength: (p,) float32, opacity of the
    lines. filled: (p,) bool, whether each has a surface; by default all have one.
    """

    vertices: F32
    offsets: I32
    rgb: F32
    strength: F32
    filled: NDArray[np.bool_] | None = None


def level(shape: Shape, polygons: NDArray[Any], depth: int, width: float, fill: tuple[float, float]) -> Level:
    """Polygons with consecutive numbers, ready to draw. fill: opacity of surfaces at their centre and at their rim,
    relative to that of the lines.
    """
    # Look up the ends and the polygon of each edge.
    ends, owners = _edges(shape.offsets, polygons)
    lines, rgb, strength = shape.vertices[ends], shape.rgb[owners], shape.strength[owners]
    # Triangulate each polygon that has a surface as a fan around its centre.
    fans = np.empty((len(owners), 3, 3), np.float32)
    fans[:, 0], fans[:, 1:] = _centres(shape, polygons)[owners - polygons[0]], lines.reshape(-1, 2, 3)
    centre, rim = fill
    alpha = strength[:, None] * np.array([centre, rim, rim], np.float32)
    filled = np.full(len(owners), True) if shape.filled is None else shape.filled[owners]
    return Level(
        depth,
        width,
        lines,
        _with_alpha(np.repeat(rgb, 2, axis=0), np.repeat(strength, 2)),
        fans[filled].reshape(-1, 3),
        _with_alpha(np.repeat(rgb[filled], 3, axis=0), alpha[filled].reshape(-1)),
    )


def crossings(vertices: NDArray[Any], offsets: NDArray[Any]) -> F64:
    """(p,), probability that a random line through the box around all polygons crosses each: 2 A / S.

    Their sum is the number of surfaces that lie behind each other. vertices, offsets: as in Planes.
    """
    if len(offsets) < 2:
        return np.zeros(0)
    points = vertices.astype(np.float64)
    x, y, z = points.max(axis=0) - points.min(axis=0)
    surface = max(2.0 * (x * y + y * z + z * x), np.finfo(np.float64).tiny)
    found: F64 = 2.0 * areas(points, offsets.astype(np.int64)) / surface
    return found


def _edges(offsets: I32, polygons: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows of the two ends of all edges of these polygons, (2e,), and the polygon of each edge, (e,)."""
    sizes = np.diff(offsets)[polygons]
    owner = np.repeat(polygons, sizes)
    start = offsets[owner]
    within = np.arange(len(owner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    ends = np.stack([start + within, start + (within + 1) % np.repeat(sizes, sizes)], axis=1)
    return ends.reshape(-1), owner


def _centres(shape: Shape, polygons: NDArray[Any]) -> F32:
    """(n, 3) mean of the vertices of each of these consecutive polygons."""
    first, last = polygons[0], polygons[-1]
    begins = shape.offsets[first : last + 1]
    corners = shape.vertices[begins[0] : shape.offsets[last + 1]]
    sums = np.add.reduceat(corners.astype(np.float64), begins - begins[0], axis=0)
    return (sums / np.diff(shape.offsets)[first : last + 1, None]).astype(np.float32)


def _with_alpha(rgb: F32, alpha: F32) -> F32:
    return np.concatenate([rgb, alpha[:, None]], axis=1)

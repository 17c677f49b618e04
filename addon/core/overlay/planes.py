# SPDX-License-Identifier: GPL-3.0-or-later
"""The split planes of a structure as lines and triangles with colours: what a viewport can draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, I32

if TYPE_CHECKING:
    from ..base.interface import Structure

KINDS = ("X", "Y", "Z", "OBLIQUE", "SLABS", "OCTANTS", "BOXES")
"""What the native module's numbers of kinds mean, in their order."""

MOST_ASKED = 400_000
"""So many polygons are asked of a structure at most, before kinds and depths are chosen from them: 30 MB."""

FADE = 0.84
"""How much fainter each level is than the one above it."""

FAINTEST = 0.3
"""No level is fainter than this."""

THINNING = 0.8
"""How much thinner the lines of each level are than those of the level above; never thinner than a pixel."""

CROWD, CROWD_FADE = 150, 0.5
"""A level of more polygons than this is fainter by this power of how many times more it has: a thousand strong lines
would be one blot."""

PANE = (0.0, 0.11)
"""How much of a line's opacity a surface has at its centre and at its rim: panes show where they end, and dozens of
them, one behind another, still let the scene through."""


@dataclass(frozen=True, eq=False)
class Planes:
    """Chosen polygons, the shallowest first.

    vertices: (v, 3) float32, scene frame. offsets: (p + 1,) int32, where each polygon begins. depth, kind: (p,) int32.
    hidden: polygons of the choice that are not here. complete: False when there may be still more than `hidden`.
    """

    vertices: F32
    offsets: I32
    depth: I32
    kind: I32
    hidden: int
    complete: bool

    def __len__(self) -> int:
        return len(self.depth)

    @property
    def levels(self) -> range:
        """The depths that occur, from the first to the last."""
        return range(int(self.depth.min()), int(self.depth.max()) + 1) if len(self) else range(0)


def choose(structure: Structure, depths: tuple[int, int], kinds: Sequence[str], most: int) -> Planes:
    """The split planes of a native structure between two depths, both inclusive, of these kinds, at most `most`."""
    low, high = depths
    found = structure.split_polygons(max(high, 0), MOST_ASKED)
    wanted = (found["depth"] >= low) & (found["depth"] <= high)
    wanted &= np.isin(found["kind"], [KINDS.index(kind) for kind in kinds])
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


def levels(planes: Planes, colours: Mapping[str, Sequence[float]], opacity: float, width: float) -> list[Level]:
    """The polygons by depth, deepest first, so that the faint is drawn before the strong.

    colours: red, green and blue of each kind. opacity: of the shallowest level's lines. width: pixels of the shallowest
    level's lines.
    """
    table = np.array([colours[kind] for kind in KINDS], np.float32)
    made = []
    for depth in reversed(planes.levels):
        polygons = np.flatnonzero(planes.depth == depth)
        if not len(polygons):
            continue
        step = depth - planes.levels.start
        strength = opacity * max(FADE**step, FAINTEST) * min(1.0, CROWD / len(polygons)) ** CROWD_FADE
        strengths = np.full(len(planes), strength, np.float32)
        shape = Shape(planes.vertices, planes.offsets, table[planes.kind], strengths)
        made.append(level(shape, polygons, depth, max(width * THINNING**step, 1.0), PANE))
    return made


@dataclass(frozen=True, eq=False)
class Shape:
    """Coloured polygons. vertices, offsets: as in Planes. rgb: (p, 3) float32. strength: (p,) float32, of the lines."""

    vertices: F32
    offsets: I32
    rgb: F32
    strength: F32


def level(shape: Shape, polygons: NDArray[Any], depth: int, width: float, fill: tuple[float, float]) -> Level:
    """Polygons with consecutive numbers, ready to draw. fill: opacity of surfaces at their centre and at their rim, as
    a share of that of the lines.
    """
    ends, owners = _edges(shape.offsets, polygons)
    lines, rgb, strength = shape.vertices[ends], shape.rgb[owners], shape.strength[owners]
    fans = np.empty((len(owners), 3, 3), np.float32)
    fans[:, 0], fans[:, 1:] = _centres(shape, polygons)[owners - polygons[0]], lines.reshape(-1, 2, 3)
    centre, rim = fill
    alpha = strength[:, None] * np.array([centre, rim, rim], np.float32)
    return Level(
        depth,
        width,
        lines,
        _with_alpha(np.repeat(rgb, 2, axis=0), np.repeat(strength, 2)),
        fans.reshape(-1, 3),
        _with_alpha(np.repeat(rgb, 3, axis=0), alpha.reshape(-1)),
    )


def _edges(offsets: I32, polygons: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows of the two ends of all edges of these polygons, (2e,), and the polygon of each edge, (e,)."""
    sizes = np.diff(offsets)[polygons]
    owner = np.repeat(polygons, sizes)
    start = offsets[owner]
    within = np.arange(len(owner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    ends = np.stack([start + within, start + (within + 1) % np.repeat(sizes, sizes)], axis=1)
    return ends.reshape(-1), owner


def _centres(shape: Shape, polygons: NDArray[Any]) -> F32:
    """The mean of the corners of each polygon from the first of these to the last, which follow each other."""
    first, last = polygons[0], polygons[-1]
    begins = shape.offsets[first : last + 1]
    corners = shape.vertices[begins[0] : shape.offsets[last + 1]]
    sums = np.add.reduceat(corners.astype(np.float64), begins - begins[0], axis=0)
    return (sums / np.diff(shape.offsets)[first : last + 1, None]).astype(np.float32)


def _with_alpha(rgb: F32, alpha: F32) -> F32:
    return np.concatenate([rgb, alpha[:, None]], axis=1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Split planes of a structure as coloured lines and triangles for a viewport."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32
from ..tree.regions import areas
from . import cuts, sight
from .cuts import Cuts

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
"""Number of walls of a grid's layer from which its lines are thinner and somewhat fainter; most that are drawn along an
axis.
"""

WALLS = 0.22
"""Factor on the opacity of the walls of a grid's layer, whose cells with triangles are filled."""

PARENTS = 0.45
"""Factor on the opacity of boxes that contain smaller boxes that are shown."""

MARKED_FILL, TURNED_FILL, CELL_FILL = (0.10, 0.22), (0.03, 0.12), (0.55, 0.65)
"""Opacity of the surfaces of marked planes, of turned boxes, and of a grid's filled cells, at their centre and at their
rim.
"""

CUT_FADE, CUT_WIDTH, BESIDE_CUTS = 0.92, 1.3, 0.6
"""Lines where planes cut the scene: ratio of the opacities of successive levels, ratio of their width to that of edges,
and factor on the opacity of edges where such lines are drawn.
"""

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
    across: the axis across which they are one layer of a grid's cells, or -1. body: (p,) int32, the box that each is a
    face of, or -1; None if there are no boxes. marked: number of polygons at the end that are drawn as strongly as the
    shallowest. rgb: (marked, 3) their colours, None for those of their kinds. cuts: where they cut the scene.
    """

    vertices: F32
    offsets: I32
    depth: I32
    kind: I32
    hidden: int
    complete: bool
    across: int = -1
    body: I32 | None = None
    marked: int = 0
    rgb: F32 | None = None
    cuts: Cuts | None = None

    def __len__(self) -> int:
        return len(self.depth)

    @property
    def bodies(self) -> I32:
        """(p,), the box that each polygon is a face of, or -1."""
        return np.full(len(self), -1, np.int32) if self.body is None else self.body

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
    chosen = np.flatnonzero(wanted)
    return taken(found, chosen[:most], hidden=max(len(chosen) - most, 0))


def taken(found: Any, rows: NDArray[Any], hidden: int = 0) -> Planes:
    """These polygons of what a structure's `split_polygons` returned, in this order. hidden: as in Planes."""
    starts = found["offsets"].astype(np.int64)
    sizes = np.diff(starts)[rows]
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    corners = np.repeat(starts[rows] - offsets[:-1], sizes) + np.arange(offsets[-1])
    kind = found["kind"][rows].astype(np.int32)
    # The faces of a box follow each other.
    boxes = kind == KINDS.index("BOXES")
    body = np.where(boxes, (np.cumsum(boxes) - 1) // 6, -1).astype(np.int32)
    return Planes(
        np.ascontiguousarray(found["vertices"][corners], np.float32),
        offsets,
        found["depth"][rows].astype(np.int32),
        kind,
        hidden=hidden,
        complete=not found["hidden"],
        body=body if boxes.any() else None,
    )


def joined(first: Planes, marked: Planes, rgb: F32 | None = None) -> Planes:
    """Polygons, and others after them that are marked. rgb: as in Planes."""
    bodies = None
    if first.body is not None or marked.body is not None:
        following = marked.bodies + np.where(marked.bodies < 0, 0, first.bodies.max(initial=-1) + 1)
        bodies = np.concatenate([first.bodies, following]).astype(np.int32)
    return replace(
        first,
        vertices=np.concatenate([first.vertices, marked.vertices]),
        offsets=np.concatenate([first.offsets, first.offsets[-1] + marked.offsets[1:]]),
        depth=np.concatenate([first.depth, marked.depth]),
        kind=np.concatenate([first.kind, marked.kind]),
        hidden=first.hidden + marked.hidden,
        body=bodies,
        marked=len(marked),
        rgb=rgb,
    )


def within(shown: Planes, vertices: F32, triangles: I32) -> Planes:
    """The planes of octants cut to the box of the triangles, beyond which they separate nothing.

    vertices, triangles: (n, 3) and (m, 3).
    """
    octants = shown.kind == KINDS.index("OCTANTS")
    if not octants.any() or not len(triangles):
        return shown
    box = scene_box(vertices, triangles)
    rows = np.repeat(octants, np.diff(shown.offsets))
    points = shown.vertices.copy()
    points[rows] = np.clip(points[rows], box[0], box[1])
    # Drop the polygons that lie outside of it.
    area = areas(points.astype(np.float64), shown.offsets.astype(np.int64))
    kept = ~octants | (area > 1e-6 * float(area.max(initial=0.0)))
    found = {"vertices": points, "offsets": shown.offsets, "depth": shown.depth, "kind": shown.kind, "hidden": 0}
    return replace(taken(found, np.flatnonzero(kept), shown.hidden), complete=shown.complete)


def scene_box(vertices: F32, triangles: I32) -> F32:
    """(2, 3), lower and upper corner of the finite corners of triangles."""
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    used &= np.isfinite(vertices).all(axis=1)
    if not used.any():
        return np.zeros((2, 3), np.float32)
    return np.stack([vertices[used].min(axis=0), vertices[used].max(axis=0)])


def cut(shown: Planes, vertices: F32, triangles: I32) -> Planes:
    """The same planes with the lines where the first of them, the marked before the others, cut the triangles.

    Faces of boxes and the walls of a grid's layer have none.
    """
    plain = len(shown) - shown.marked
    order = np.concatenate([np.arange(plain, len(shown)), np.arange(plain)])
    order = order[shown.bodies[order] < 0] if shown.across < 0 else order[:0]
    if (shown.kind == KINDS.index("SLABS")).any():
        order = order[: cuts.MOST_SLABS]
    if not len(order) or not len(triangles):
        return shown
    return replace(shown, cuts=cuts.find(order, shown.vertices, shown.offsets, (vertices, triangles)))


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
    """The drawing of planes for a viewer. bare: (p,) bool, polygons without a surface. strength: of the other surfaces,
    0 to 1. weight: (p,) float32, factor on the opacity of each polygon.
    """

    bare: NDArray[np.bool_]
    strength: float
    weight: F32

    def key(self) -> tuple[bytes, float, bytes]:
        """Equal for panes that look the same."""
        return self.bare.tobytes(), self.strength, self.weight.tobytes()


def panes(planes: Planes, eye: F64 | None = None) -> Panes:
    """The surfaces as a viewer at `eye`, (3,) in the scene frame, sees them: none of boxes around the viewer and none
    so near that it would veil the view, none of a grid's layer, and the others fainter the more of them lie behind each
    other.

    Lines are fainter of small, slanted and distant polygons, see `sight.weights`, and of faces of boxes that are turned
    away. Without a viewer, as random lines through the structure meet them.
    """
    if eye is None or not len(planes):
        behind, bare = float(crossings(planes.vertices, planes.offsets).sum()), np.zeros(len(planes), bool)
        weight = np.ones(len(planes), np.float32)
        return Panes(bare, _step(min(1.0, FOG / behind)) if behind > 0 else 1.0, weight)
    angles = sight.solid_angles(planes.vertices, planes.offsets, eye)
    bare = (angles > sight.NEAR) | (planes.across >= 0)
    weight = sight.weights(planes.vertices, planes.offsets, eye)
    if planes.body is not None:
        inside, away = sight.turned_away(planes.vertices, planes.offsets, planes.body, eye)
        bare |= inside | away
        weight[planes.body >= 0] = np.maximum(weight[planes.body >= 0], sight.LEAST_FACE)
        weight[inside], weight[away] = sight.AROUND, sight.AWAY
    if planes.across >= 0:
        weight[:] = 1.0
        weight[: len(planes) - planes.marked] = np.arange(len(planes) - planes.marked) % left_out(planes) == 0
    if planes.marked:
        # Keep the marked ones visible; of turned boxes the faces towards the viewer.
        marked = np.arange(len(planes)) >= len(planes) - planes.marked
        bare[marked & (planes.bodies < 0)] = False
        strong = marked & ~bare
        weight[strong] = np.maximum(weight[strong], 0.6)
    box = np.stack([planes.vertices.min(axis=0), planes.vertices.max(axis=0)]).astype(np.float64)
    directions = sight.whole(box, eye)
    behind = float(angles[~bare].sum()) / directions
    limit = FOG * INSIDE if directions == 4 * np.pi else FOG
    return Panes(bare, _step(min(1.0, limit / behind)) if behind > 0 else 1.0, weight)


def left_out(planes: Planes) -> int:
    """The interval of the walls of a grid's layer that are drawn: lines of all walls would merge into an area."""
    walls = np.bincount(planes.kind[: len(planes) - planes.marked], minlength=1)
    return -(-int(walls.max()) // SHEET) or 1


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
    plain, tints = len(planes) - planes.marked, table[planes.kind]
    if planes.rgb is not None:
        tints = np.concatenate([tints[:plain], planes.rgb])
    made = []
    for depth in reversed(planes.levels):
        polygons = np.flatnonzero(planes.depth[:plain] == depth)
        if not len(polygons):
            continue
        step = depth - planes.levels.start
        strength = opacity * max(FADE**step, FAINTEST) * min(1.0, CROWD / len(polygons)) ** CROWD_FADE
        wide = width * THINNING**step
        # Of boxes within boxes the smallest are seen best; the walls of a grid's layer are seen behind its cells.
        if planes.body is not None:
            last = depth == planes.levels.stop - 1 and not planes.marked
            strength, wide = (opacity, 0.7 * width) if last else (PARENTS * opacity, 0.5 * width)
        if planes.cuts is not None and len(planes.cuts.owner):
            strength *= BESIDE_CUTS
        if planes.across >= 0:
            sheet = min(1.0, SHEET / max(plain, 1))
            strength, wide = WALLS * opacity * sheet ** (CROWD_FADE / 2), width * sheet
        strengths = strength * seen.weight
        shape = Shape(planes.vertices, planes.offsets, tints, strengths.astype(np.float32), ~seen.bare)
        made.append(level(shape, polygons, depth, max(wide, 1.0), pane))
    # Draw the marked polygons over the others, and where planes cut the scene over all.
    if planes.marked:
        shape = Shape(planes.vertices, planes.offsets, tints, (opacity * seen.weight).astype(np.float32), ~seen.bare)
        centre, rim = TURNED_FILL
        turned = centre * seen.strength, rim * seen.strength
        fill = CELL_FILL if planes.across >= 0 else MARKED_FILL if planes.body is None else turned
        wide = (0.4 if planes.across >= 0 else 0.8 if planes.body is None else 0.6) * width
        made.append(level(shape, np.arange(plain, len(planes)), int(planes.depth[-1]), max(wide, 1.0), fill))
    if planes.cuts is not None and len(planes.cuts.owner):
        made += _cut_lines(planes, planes.cuts, tints, opacity, width)
    return made


def _cut_lines(planes: Planes, cuts: Cuts, tints: F32, opacity: float, width: float) -> list[Level]:
    """The lines where planes cut the scene, those of the deepest first."""
    plain = np.arange(len(planes)) < len(planes) - planes.marked
    steps = np.where(plain, planes.depth - planes.levels.start, 0)[cuts.owner]
    made = []
    for step in range(int(steps.max(initial=0)), -1, -1):
        rows = np.flatnonzero(steps == step)
        if len(rows):
            rgb = np.repeat(tints[cuts.owner[rows]], 2, axis=0)
            strength = np.full(len(rgb), opacity * max(CUT_FADE**step, FAINTEST), np.float32)
            ends, nothing = cuts.ends[rows].reshape(-1, 3), (np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32))
            wide = max(CUT_WIDTH * width * THINNING ** (step / 2), 1.0)
            made.append(Level(step, wide, ends, _with_alpha(rgb, strength), *nothing))
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

# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a ray up to one of its steps, and the node of that step, as levels for a viewport."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..overlay import planes
from ..overlay.cells import Cells, Path
from ..overlay.planes import Level, Planes
from ..tree.table import Table
from .node_view import outline
from .replay import Replay

STEP_RGB = (0.45, 1.0, 0.55)
"""Colour of the node of the current step."""

STEP_FILL = (0.10, 0.22)


def upto(table: Table, path: Path, replay: Replay, step: int) -> Path:
    """The path as known after its first `step` steps: cells, triangles and planes of these; no hit before the last."""
    if step >= len(replay):
        return path
    done = replay.steps[:step]
    visits = sum(one.leaf >= 0 for one in done)
    cells = path.cells
    faces = int(cells.cells[visits])
    shown = Cells(
        cells.vertices[: cells.offsets[faces]],
        cells.offsets[: faces + 1],
        cells.cells[: visits + 1],
        cells.count[:visits],
        hidden=0,
    )
    # Keep the triangles of the leaves tested so far, and the planes crossed up to there.
    tested = [table.triangles_of(one.node) for one in done if one.tests]
    kept = np.isin(path.ids, np.concatenate(tested) if tested else [])
    reached = np.array([one.enter for one in done if np.isfinite(one.enter)])
    end = float(reached.max(initial=0.0))
    crossed = _within(path, end)
    return replace(
        path,
        t=end,
        triangle=-1,
        cells=shown,
        enter=path.enter[:visits],
        leave=path.leave[:visits],
        tested=path.tested[:visits],
        reached=path.reached[:visits],
        corners=path.corners[kept],
        ids=path.ids[kept],
        crossings=crossed,
    )


def _within(path: Path, end: float) -> Planes:
    """The planes that the path crosses up to a parameter, which are sorted by it."""
    crossings = path.crossings
    middles = np.add.reduceat(crossings.vertices, crossings.offsets[:-1]) if len(crossings) else np.zeros((0, 3))
    sizes = np.maximum(np.diff(crossings.offsets), 1)[:, None]
    # A plane's normal and a point on it give the parameter of its crossing.
    count = 0
    for number, middle in enumerate(middles / sizes):
        corners = crossings.vertices[crossings.offsets[number] : crossings.offsets[number + 1]].astype(np.float64)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0]) if len(corners) > 2 else np.zeros(3)
        speed = float(normal @ path.direction)
        if not speed or float(normal @ (middle - path.origin)) / speed > end:
            break
        count += 1
    offsets = crossings.offsets[: count + 1]
    vertices = crossings.vertices[: offsets[-1]]
    return planes.Planes(vertices, offsets, crossings.depth[:count], crossings.kind[:count], 0, complete=True)


def highlight(table: Table, replay: Replay, step: int, opacity: float, width: float) -> list[Level]:
    """The region of the node that the ray visits in this step, counted from 1; nothing for other numbers."""
    if not 1 <= step <= len(replay):
        return []
    return outline(table.node_faces(replay.steps[step - 1].node), STEP_RGB, opacity, 1.5 * width, STEP_FILL)

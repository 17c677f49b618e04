# SPDX-License-Identifier: GPL-3.0-or-later
"""From split planes to what can be drawn: choice, limits, lines, panes, colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.core.overlay import planes

COLOURS = {kind: (number / 10, 0.5, 1 - number / 10) for number, kind in enumerate(planes.KINDS)}

POLYGONS: list[tuple[int, int, list[list[float]]]] = [
    (0, 0, [[0, 0, 0], [0, 4, 0], [0, 4, 2], [0, 0, 2]]),
    (1, 1, [[0, 1, 0], [2, 1, 0], [2, 1, 2], [0, 1, 2]]),
    (1, 3, [[0, 0, 0], [1, 1, 0], [1, 1, 1]]),
    (2, 2, [[0, 0, 1], [1, 0, 1], [2, 1, 1], [1, 2, 1], [0, 2, 1]]),
]
"""Depth, kind, corners."""


class Tree:
    """Answers as the native module does."""

    hidden = 0
    asked: tuple[int, int] | None = None

    def split_polygons(self, max_depth: int, max_count: int) -> dict[str, Any]:
        self.asked = max_depth, max_count
        found = [polygon for polygon in POLYGONS if polygon[0] <= max_depth]
        corners = [corner for polygon in found for corner in polygon[2]]
        return {
            "vertices": np.array(corners, np.float32).reshape(-1, 3),
            "offsets": np.cumsum([0, *(len(polygon[2]) for polygon in found)]).astype(np.uint32),
            "depth": np.array([polygon[0] for polygon in found], np.uint32),
            "kind": np.array([polygon[1] for polygon in found], np.uint8),
            "hidden": self.hidden,
        }


def choose(depths: tuple[int, int] = (0, 9), kinds: tuple[str, ...] = planes.KINDS, most: int = 100) -> planes.Planes:
    return planes.choose(Tree(), depths, kinds, most)


def corners(chosen: planes.Planes) -> list[list[list[float]]]:
    parts = np.split(chosen.vertices, chosen.offsets[1:-1])
    return [part.tolist() for part in parts] if len(chosen) else []


def test_all_come_back_as_they_were() -> None:
    chosen = choose()
    assert corners(chosen) == [polygon[2] for polygon in POLYGONS]
    assert chosen.depth.tolist() == [0, 1, 1, 2]
    assert chosen.kind.tolist() == [0, 1, 3, 2]
    assert (chosen.hidden, chosen.complete) == (0, True)
    assert chosen.levels == range(3)


@pytest.mark.parametrize(
    ("depths", "kinds", "wanted"),
    [
        ((1, 1), planes.KINDS, [1, 2]),
        ((1, 2), ("Y", "Z"), [1, 3]),
        ((0, 9), ("OBLIQUE",), [2]),
        ((0, 9), (), []),
        ((5, 9), planes.KINDS, []),
        ((2, 1), planes.KINDS, []),
    ],
)
def test_depths_and_kinds_choose(depths: tuple[int, int], kinds: tuple[str, ...], wanted: list[int]) -> None:
    chosen = choose(depths, kinds)
    assert corners(chosen) == [POLYGONS[i][2] for i in wanted]
    assert chosen.hidden == 0
    assert len(planes.levels(chosen, COLOURS, 1.0, 2.0)) == len({POLYGONS[i][0] for i in wanted})


def test_the_limit_hides_the_deepest_and_counts_them() -> None:
    chosen = choose(most=1)
    assert corners(chosen) == [POLYGONS[0][2]]
    assert chosen.hidden == 3
    # The limit counts what was chosen, not what a structure lists before it.
    assert corners(choose((1, 2), most=1)) == [POLYGONS[1][2]]


def test_more_than_a_structure_lists_is_marked() -> None:
    tree = Tree()
    tree.hidden = 7
    assert not planes.choose(tree, (0, 2), planes.KINDS, 100).complete
    assert tree.asked == (2, planes.MOST_FETCHED)


def test_levels_come_deepest_first_with_every_edge_once() -> None:
    chosen = choose()
    made = planes.levels(chosen, COLOURS, 0.8, 4.0)
    assert [level.depth for level in made] == [2, 1, 0]
    for level in made:
        polygons = [np.array(polygon[2]) for polygon in POLYGONS if polygon[0] == level.depth]
        edges = np.concatenate([np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in polygons])
        assert level.lines.reshape(-1, 2, 3).tolist() == edges.tolist()
        assert level.lines.dtype == level.triangles.dtype == np.float32


def test_panes_cover_their_polygons_exactly() -> None:
    for level in planes.levels(choose(), COLOURS, 0.8, 4.0):
        triangles = level.triangles.reshape(-1, 3, 3).astype(float)
        areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        wanted = 0.0
        for polygon in (np.array(p[2]) for p in POLYGONS if p[0] == level.depth):
            spokes = polygon[1:] - polygon[0]
            wanted += float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)))
        assert areas.sum() == pytest.approx(wanted, rel=1e-6)


def test_colours_show_the_kind_and_strength_the_depth() -> None:
    made = planes.levels(choose(), COLOURS, 0.8, 4.0)
    for level in made:
        kinds = np.concatenate([[k] * len(p) for d, k, p in POLYGONS if d == level.depth])
        wanted = np.array([COLOURS[planes.KINDS[k]] for k in kinds], np.float32)
        assert np.array_equal(level.line_colours[::2, :3], wanted)
        assert np.array_equal(level.fill_colours[2::3, :3], wanted)
        assert level.line_colours[:, 3] == pytest.approx(0.8 * planes.FADE**level.depth)
        assert level.fill_colours[:, 3].max() < level.line_colours[:, 3].min()
    widths = [level.width for level in made]
    assert widths == sorted(widths)
    assert widths[-1] == 4.0
    assert planes.levels(choose(), COLOURS, 0.8, 1.0)[0].width == 1.0


def test_a_crowded_level_is_fainter() -> None:
    count = 4 * planes.CROWD
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    crowd = planes.Planes(
        np.tile(corner, (count, 1)),
        np.arange(0, 4 * count + 1, 4, dtype=np.int32),
        np.zeros(count, np.int32),
        np.full(count, 2, np.int32),
        hidden=0,
        complete=True,
    )
    (level,) = planes.levels(crowd, COLOURS, 0.8, 4.0)
    assert level.line_colours[:, 3] == pytest.approx(0.8 * 4**-planes.CROWD_FADE)
    assert len(level.lines) == 8 * count
    assert len(level.triangles) == 12 * count

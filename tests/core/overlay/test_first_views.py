# SPDX-License-Identifier: GPL-3.0-or-later
"""What first views show besides levels: lines where planes cut the scene, oblique planes, turned boxes, slices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from addon.core.overlay import cuts, depths, layers, legend, planes, turned
from addon.core.tree import table

native = pytest.importorskip("halfspace_native")

EYE = np.array([9.0, -7.0, 6.0])
COLOURS = dict.fromkeys(planes.KINDS, (1.0, 1.0, 1.0))


def sticks() -> tuple[Any, Any]:
    """Thin slanted sticks, of a grid of four by four triangles on each of four sides."""
    rng = np.random.default_rng(4)
    quads: list[Any] = []
    for _ in range(40):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        middle, half = 4 * rng.random(3), np.array([1.5, 0.05, 0.05])
        for side in range(4):
            ring = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
            for part in range(6):
                x = -1 + np.array([part, part, part + 1, part + 1]) / 3
                y, z = zip(ring[side], ring[(side + 1) % 4], ring[(side + 1) % 4], ring[side], strict=True)
                quads.append(middle + (np.stack([x, np.array(y), np.array(z)], axis=1) * half) @ turn)
    corners = np.array(quads, np.float32)
    triangles = np.arange(4 * len(corners), dtype=np.int32).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return corners.reshape(-1, 3), triangles


MESH = sticks()


def test_cuts_lie_on_triangles_in_the_plane_and_inside_its_polygon() -> None:
    chosen = planes.choose(native.build(*MESH, "kd"), (0, 3), planes.KINDS, 100)
    found = planes.cut(chosen, *MESH).cuts
    assert found is not None
    assert set(found.owner.tolist()) <= set(range(len(chosen)))
    assert len(set(found.owner.tolist())) > 3
    for number in set(found.owner.tolist()):
        ring = chosen.vertices[chosen.offsets[number] : chosen.offsets[number + 1]]
        ends = found.ends[found.owner == number].reshape(-1, 3)
        assert (ends >= ring.min(axis=0) - 1e-5).all()
        assert (ends <= ring.max(axis=0) + 1e-5).all()


def test_cuts_of_a_square_are_as_long_as_the_square_allows() -> None:
    ring = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], float)
    corners = np.array([[-1, 1, -1], [5, 1, -1], [2, 1, 9], [1, 1, 1], [1, 2, 1], [1, 2, 2], [np.nan, 0, 0]], float)
    triangles = np.array([[0, 1, 2], [3, 4, 5], [6, 0, 2]], np.int32)
    segments = cuts.clipped(cuts.crossed(corners, triangles, ring), ring)
    assert np.sort(segments[:, :, 0], axis=1).tolist() == [[pytest.approx(0), pytest.approx(2)]]
    assert segments[:, :, 1:].reshape(-1, 2) == pytest.approx(np.array([[1, 0], [1, 0]]))
    # A budget is kept, and a ring without area cuts nothing.
    assert not len(cuts.clipped(cuts.crossed(corners, triangles, 0 * ring), 0 * ring))
    few = cuts.find(np.arange(1), ring.astype(np.float32), np.array([0, 4], np.int32), (corners, triangles))
    assert few.owner.tolist() == [0]


def test_too_many_triangles_are_not_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cuts, "MOST_PAIRS", len(MESH[1]) - 1)
    chosen = planes.cut(planes.choose(native.build(*MESH, "kd"), (0, 3), planes.KINDS, 100), *MESH)
    assert chosen.cuts is not None
    assert not len(chosen.cuts.owner)
    # Edges are fainter only next to such lines.
    drawn, alone = (planes.levels(one, COLOURS, 1.0, 2.0) for one in (chosen, replace(chosen, cuts=None)))
    assert [level.line_colours.tolist() for level in drawn] == [level.line_colours.tolist() for level in alone]
    assert legend.CUTS not in [entry.text for entry in legend.of_planes(chosen, COLOURS)]


def test_the_first_view_of_split_planes_and_oblique_planes_has_both() -> None:
    structure = native.build(*MESH, "bsp-wn-plus-kd")
    survey = depths.survey(structure)
    first = survey.first(EYE)
    assert first.marked
    assert survey.oblique is not None
    assert 0 < len(survey.oblique) <= depths.MOST_OBLIQUE
    base = planes.choose(structure, (first.low, first.high), ("X", "Y", "Z"), 1000)
    assert 0 < len(base) <= depths.MOST_BESIDE
    both = planes.joined(base, survey.oblique)
    assert (both.kind[-both.marked :] == 3).all()
    made = planes.levels(both, COLOURS, 1.0, 2.0)
    # The marked planes are drawn over all others, as strongly as the root's.
    assert made[-1].line_colours[:, 3].min() == 1.0
    assert len(made[-1].lines) == 2 * int(survey.oblique.offsets[-1])
    assert not depths.survey(native.build(*MESH, "kd")).first(EYE).marked
    assert not depths.survey(native.build(*MESH, "bsp-wn")).first(EYE).marked


def test_the_first_view_of_oriented_boxes_has_the_outermost_turned_ones() -> None:
    structure = native.build(*MESH, "obb")
    survey = depths.survey(structure)
    assert survey.turned
    tree = table.read(structure, *MESH)
    found = turned.outermost(tree, 5)
    walled = np.flatnonzero(np.diff(tree.wall_offsets))
    outer = [node for node in walled if not set(tree.ancestors(int(node))[:-1]) & set(walled.tolist())]
    shown = len(set(found.bodies.tolist()))
    assert shown == min(5, len(outer))
    assert found.hidden == len(outer) - shown
    # The faces of each are closed: half of them is turned away from a viewer outside.
    alone = planes.panes(found, EYE)
    assert alone.bare.any()
    assert not alone.bare.all()
    # Next to other boxes they have the surfaces and the fog of all.
    base = planes.choose(structure, (1, 1), ("BOXES",), 1000)
    both = planes.joined(base, found)
    seen = planes.panes(both, EYE)
    assert seen.bare[-both.marked :].tolist() == alone.bare.tolist()
    clear, veiled = (
        planes.levels(both, COLOURS, 1.0, 2.0, replace(seen, strength=strength))[-1].fill_colours[:, 3]
        for strength in (1.0, 0.25)
    )
    assert veiled == pytest.approx(0.25 * clear)
    assert not depths.survey(native.build(*MESH, "bvh-sah")).turned


def test_planes_of_octants_end_where_the_triangles_end() -> None:
    chosen = planes.choose(native.build(*MESH, "octree-net"), (0, 2), planes.KINDS, 1000)
    box = planes.scene_box(*MESH)
    assert (chosen.vertices > box[1] + 1e-3).any() or (chosen.vertices < box[0] - 1e-3).any()
    within = planes.within(chosen, *MESH)
    assert 0 < len(within) <= len(chosen)
    assert (within.vertices <= box[1]).all()
    assert (within.vertices >= box[0]).all()


def test_a_slice_of_a_grid_has_a_square_for_each_cell_with_triangles() -> None:
    structure = native.build(*MESH, "grid")
    grid = layers.with_cells(layers.find(structure.split_polygons(60, 60_000)), structure)
    assert len(grid.count) == structure.statistics["leaves"] - structure.statistics["leaves_empty"]
    for axis in range(3):
        layer = (axis, (len(grid.walls[axis]) - 1) // 2)
        assert grid.filled[axis][layer[1]] == len(layers.within(grid, layer))
        squares, rgb = layers.squares(grid, layer)
        assert len(squares) == len(layers.within(grid, layer)) == len(rgb) > 0
        corners = squares.vertices.reshape(-1, 4, 3)
        low, high = grid.walls[axis][layer[1] : layer[1] + 2]
        assert corners[..., axis] == pytest.approx((low + high) / 2, abs=1e-4)
        both = planes.joined(layers.cut(grid, layer, planes.KINDS), squares, rgb)
        assert np.array_equal(planes.levels(both, COLOURS, 1.0, 2.0)[-1].line_colours[::8, :3], rgb)


@pytest.mark.parametrize(("count", "step"), [(planes.SHEET, 1), (planes.SHEET + 1, 2), (4 * planes.SHEET, 4)])
def test_of_many_walls_of_a_layer_some_are_drawn(count: int, step: int) -> None:
    walls = np.linspace(0, 1, count)
    two, none = np.array([0.0, 1.0]), (np.zeros((0, 2, 3), np.float32), np.zeros(0, np.int32))
    grid = layers.Grid((walls, two, two), (0, 1, 2), np.array([[0, 0, 0], [1, 1, 1.0]]), *none)
    chosen = layers.cut(grid, (2, 0), ("X",))
    assert planes.left_out(chosen) == step
    weight = planes.panes(chosen, np.array([0.5, 0.5, 3.0])).weight
    assert weight.sum() == -(-count // step) <= planes.SHEET
    texts = [entry.text for entry in legend.of_planes(chosen, COLOURS)]
    assert texts[-1] == "one layer of cells across Z" + (f", one in {step} walls drawn" if step > 1 else "")

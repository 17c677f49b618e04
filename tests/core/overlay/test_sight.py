# SPDX-License-Identifier: GPL-3.0-or-later
"""The first view of a structure lets the scene be seen: rays count the surfaces in front of pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.core.overlay import depths, layers, planes, sight

native = pytest.importorskip("halfspace_native")

COLOURS = dict.fromkeys(planes.KINDS, (1.0, 1.0, 1.0))

STRUCTURES = ["octree-net", "octree-param", "bvh-sah", "kd", "bih", "grid", "bsp-wn-plus-kd"]

SIZE = np.array([20.0, 12.0, 6.0])

EYES = {
    "in a corner": [1.5, 1.5, 1.7],
    "in the middle": [10.3, 6.2, 1.7],
    "under the ceiling": [14.0, 3.0, 5.2],
    "outside": [45.0, -30.0, 25.0],
    "above": [9.0, 5.0, 60.0],
}


def room() -> tuple[Any, Any]:
    """A closed hall whose walls consist of tiles, with columns and small things on the floor."""
    quads: list[np.ndarray[Any, Any]] = []

    def box(low: Any, high: Any, tiles: int) -> None:
        low, high = np.array(low, float), np.array(high, float)
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for end in (low, high):
                for i in range(tiles):
                    for j in range(tiles):
                        ring = np.zeros((4, 3))
                        ring[:, axis] = end[axis]
                        ring[:, u] = low[u] + (high[u] - low[u]) * (i + np.array([0, 1, 1, 0])) / tiles
                        ring[:, v] = low[v] + (high[v] - low[v]) * (j + np.array([0, 0, 1, 1])) / tiles
                        quads.append(ring)

    box((0, 0, 0), SIZE, 12)
    for x in range(3, 19, 3):
        for y in (3, 9):
            box((x - 0.3, y - 0.3, 0), (x + 0.3, y + 0.3, 6), 4)
    for x, y, z in np.random.default_rng(3).random((60, 3)) * [18, 10, 0.8]:
        box((x + 0.5, y + 0.5, z), (x + 0.8, y + 0.8, z + 0.3), 2)
    corners = np.array(quads, np.float32)
    triangles = np.arange(4 * len(corners), dtype=np.int32).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return corners.reshape(-1, 3), triangles


ROOM = room()


def built(spec: str) -> Any:
    return native.build(*ROOM, spec)


def rays(eye: Any, box: Any, side: int) -> list[np.ndarray[Any, Any]]:
    """Directions of the pixels of six pictures all around, of those that meet the box."""
    steps = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = (grid.ravel() for grid in np.meshgrid(steps, steps))
    pictures = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            made = np.ones((len(x), 3)) * sign
            made[:, (axis + 1) % 3], made[:, (axis + 2) % 3] = x, y
            near, far = (box[0] - eye) / made, (box[1] - eye) / made
            enter, leave = np.minimum(near, far).max(axis=1), np.maximum(near, far).min(axis=1)
            pictures.append(made[(leave > 0) & (leave >= enter)])
    return [picture for picture in pictures if len(picture)]


def met(triangles: Any, eye: Any, direction: Any) -> tuple[Any, Any]:
    """Which of these triangles, (t, 3, 3), a ray meets, and its weights of their corners there (Möller, Trumbore)."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(direction, f)
    det = (e * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = eye - a
        u = (s * p).sum(axis=1) / det
        q = np.cross(s, e)
        v, t = (q @ direction) / det, (f * q).sum(axis=1) / det
        hit = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (np.abs(det) > 1e-12))
    return hit, np.stack([1 - u[hit] - v[hit], u[hit], v[hit]], axis=1)


def shown(structure: Any, eye: Any) -> tuple[planes.Planes, depths.First, depths.Survey]:
    survey = depths.survey(structure)
    first = survey.first(eye)
    if first.layer is not None and survey.grid is not None:
        return layers.cut(survey.grid, first.layer, planes.KINDS), first, survey
    return planes.choose(structure, (first.low, first.high), planes.KINDS, 20_000), first, survey


def covered(levels: list[planes.Level], eye: Any, direction: Any) -> tuple[int, float]:
    """Number of surfaces in front of a pixel, and their opacity together."""
    count, clear = 0, 1.0
    for level in levels:
        fans = level.triangles.reshape(-1, 3, 3).astype(float)
        if not len(fans):
            continue
        hit, weights = met(fans, eye, direction)
        count += len(hit)
        clear *= float(np.prod(1 - (weights * level.fill_colours[:, 3].reshape(-1, 3)[hit]).sum(axis=1)))
    return count, 1 - clear


@pytest.mark.parametrize("spec", STRUCTURES)
@pytest.mark.parametrize("place", EYES)
def test_few_surfaces_and_little_opacity_are_in_front_of_pixels(spec: str, place: str) -> None:
    eye = np.array(EYES[place])
    chosen, _, survey = shown(built(spec), eye)
    assert len(chosen)
    levels = planes.levels(chosen, COLOURS, 1.0, 2.0, planes.panes(chosen, eye))
    counts, opacities = [], []
    for picture in rays(eye, survey.box, 4 if (survey.box[0] <= eye).all() and (eye <= survey.box[1]).all() else 30):
        found = [covered(levels, eye, direction) for direction in picture]
        counts += [count for count, _ in found]
        opacities += [opacity for _, opacity in found]
    assert np.mean(counts) <= 1.1 * planes.CLEAR
    assert np.mean(opacities) <= 0.06
    assert np.quantile(opacities, 0.95) <= 0.2


@pytest.mark.parametrize("place", EYES)
def test_all_walls_of_a_grid_would_be_fog(place: str) -> None:
    """Without the rule: the walls across X alone."""
    eye = np.array(EYES[place])
    chosen = planes.choose(built("grid"), (0, 0), planes.KINDS, 20_000)
    assert set(chosen.kind.tolist()) == {0}
    angles = sight.solid_angles(chosen.vertices, chosen.offsets, eye)
    box = np.stack([chosen.vertices.min(axis=0), chosen.vertices.max(axis=0)]).astype(float)
    assert angles.sum() / sight.whole(box, eye) > (0 if place == "above" else 1.2) * planes.CLEAR


@pytest.mark.parametrize("place", EYES)
def test_a_grid_shows_one_layer_of_its_cells_aside_of_the_viewer(place: str) -> None:
    eye = np.array(EYES[place])
    structure = built("grid")
    chosen, first, _ = shown(structure, eye)
    assert first.layer is not None
    across, _ = first.layer
    corners = chosen.vertices.reshape(-1, 4, 3)
    low, high = corners[..., across].min(), corners[..., across].max()
    # The layer is one cell high, its strips are walls of the grid along the other two axes.
    every = structure.split_polygons(2, 10**6)
    starts = every["vertices"][every["offsets"][:-1].astype(int)]
    for axis in range(3):
        walls = np.unique(starts[every["kind"] == axis, axis])
        if axis == across:
            assert not ((walls > low) & (walls < high)).any()
            assert {low, high} <= {*walls.tolist(), *every["vertices"][:, axis].tolist()}
        else:
            strips = np.unique(corners[chosen.kind == axis][:, 0, axis])
            assert set(walls.tolist()) <= set(strips.tolist())
            assert len(strips) == len(walls) + 2  # and the ends of the box
    assert not low - 0.4 <= eye[across] <= high + 0.4
    # From far above the floor is seen, not a line.
    if place == "above":
        assert across == 2
    # Its kinds are chosen as those of planes.
    assert layers.cut(depths.survey(structure).grid, first.layer, ()).kind.tolist() == []  # type: ignore[arg-type]


def test_boxes_around_the_viewer_have_no_surface() -> None:
    structure = built("bvh-sah")
    eye = np.array(EYES["in the middle"])
    chosen = planes.choose(structure, (0, 2), planes.KINDS, 20_000)
    seen = planes.panes(chosen, eye)
    boxes = chosen.vertices.reshape(-1, 24, 3)
    holds = ((boxes.min(axis=1) <= eye) & (eye <= boxes.max(axis=1))).all(axis=1)
    assert 0 < holds.sum() < len(holds)
    assert seen.bare.reshape(-1, 6)[holds].all()
    # Their edges are drawn, and the surfaces of the others.
    levels = planes.levels(chosen, COLOURS, 1.0, 2.0, seen)
    assert sum(len(level.lines) for level in levels) == 2 * 4 * len(chosen)
    assert sum(len(level.triangles) for level in levels) == 3 * 4 * int((~seen.bare).sum())
    # Faces of a box that are turned to the viewer have a surface, the others faint edges.
    eye = np.array(EYES["outside"])
    outside = planes.panes(chosen, eye)
    faces = chosen.vertices.reshape(-1, 6, 4, 3).astype(float)
    middle, centre = boxes.mean(axis=1).astype(float)[:, None], faces.mean(axis=2)
    axis = (np.arange(6) // 2)[None, :, None]
    out, to = (np.take_along_axis(way, axis, axis=2)[..., 0] for way in (centre - middle, eye - centre))
    solid = (np.ptp(boxes, axis=1) > 0).all(axis=1)
    assert solid.any()
    for found in (outside.bare, outside.weight < sight.LEAST_FACE):
        assert np.array_equal(found.reshape(-1, 6)[solid], (out * to < 0)[solid])


def test_small_slanted_and_distant_planes_are_fainter() -> None:
    def square(side: float, x: float, turn: float) -> Any:
        way = np.array([np.sin(turn), np.cos(turn), 0.0])
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        return np.array([[x, 0, 0] + side / 2 * (u * way + v * np.array([0, 0, 1.0])) for u, v in corners])

    cases = [square(2, 4, 0), square(0.2, 4, 0), square(2, 12, 0), square(2, 4, np.pi / 2)]
    vertices = np.concatenate(cases).astype(np.float32)
    near, small, far, edge = sight.weights(vertices, np.arange(0, 17, 4), np.zeros(3))
    assert near == 1.0
    assert max(small, far) < near
    assert edge <= sight.EDGE_ON + 1 / 16


def test_the_first_view_of_a_tree_of_both_kinds_has_the_highest_oblique_planes() -> None:
    survey = depths.survey(built("bsp-wn-plus-kd"))
    first = survey.first(np.array(EYES["in the middle"]))
    every = built("bsp-wn-plus-kd").split_polygons(60, 10**6)
    oblique = every["depth"][every["kind"] == 3]
    if not len(oblique):
        assert not first.marked
        assert survey.oblique is None
        return
    assert first.marked
    assert survey.oblique is not None
    assert set(survey.oblique.kind.tolist()) == {3}
    assert survey.oblique.depth.max() <= np.sort(oblique)[: depths.HIGHEST].max()


def test_solid_angles_are_shares_of_random_directions() -> None:
    rng = np.random.default_rng(2)
    ring = np.array([[2, -1, -1], [2.5, 2, -1], [2, 2, 1.5], [1.5, 0, 2], [1.4, -1, 1]], float)
    triangle = np.array([[-1, -2, -1], [-1, 3, -1], [-1, 0, 4]], float)
    flat = ring.copy()
    flat[:, 0] = 1.5
    vertices, offsets = np.concatenate([flat, triangle]), np.array([0, 5, 8])
    directions = rng.standard_normal((40_000, 3))
    found = sight.solid_angles(vertices, offsets, np.zeros(3))
    for number, corners in enumerate((flat, triangle)):
        fans = np.stack([np.tile(corners[0], (len(corners) - 2, 1)), corners[1:-1], corners[2:]], axis=1)
        share = np.mean([len(met(fans, np.zeros(3), direction)[0]) > 0 for direction in directions[:6000]])
        assert found[number] / (4 * np.pi) == pytest.approx(share, abs=0.02)
    box = np.array([[0, 0, 0], [1, 1, 1]], float)
    assert sight.whole(box, np.full(3, 0.5)) == pytest.approx(4 * np.pi)
    # A unit square seen from far away.
    assert sight.whole(box, np.array([0.5, 0.5, 100.0])) == pytest.approx(1 / 99.0**2, rel=1e-3)


def test_small_moves_change_nothing_and_parallel_lines_come_from_far_away() -> None:
    box = np.array([[0, 0, 0], [20, 12, 6]], float)
    eye = np.array([3.0, 4.0, 1.7])
    place = np.array(sight.rounded(eye, box))
    assert np.abs(place - eye).max() <= np.linalg.norm(box[1]) / sight.STEP
    assert sight.rounded(place + 1e-6, box) == tuple(place)
    far = sight.parallel(np.array([0.0, 0.0, -1.0]), box)
    assert far[2] > 1000
    chosen, first, _ = shown(built("grid"), far)
    assert first.layer is not None
    assert first.layer[0] == 2
    assert len(chosen)

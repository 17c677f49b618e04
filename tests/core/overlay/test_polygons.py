# SPDX-License-Identifier: GPL-3.0-or-later
"""Beams of polygons as the native traversal records them, against the rays that they contain, and as they are drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.core.overlay import beams, legend, polygons
from addon.core.overlay.polygons import CLIPPED, ENDED, HANDED_ON, LEFT, SINGLES, SPLIT
from tests.rooms_of_triangles import soup

native = pytest.importorskip("halfspace_native")

SOUP = soup(300, 3, box=[4, 3, 2], size=0.12)
MIDDLE = np.array([2.0, 1.5, 1.0])
POLYGON = "octree-beam:traversal=polygon"

VIEWS = {
    "from outside": ([9.0, -6.0, 4.0], False),
    "along an axis": ([2.0, 1.5, 9.0], False),
    "from inside": ([2.1, 1.4, 0.9], False),
    "parallel": ([7.0, 6.0, 5.0], True),
}
"""Place of the eye or of the rays' plane, and whether rays are parallel."""


def some_rays(view: str, side: int = 40, spacing: float = 0.12) -> tuple[Any, Any]:
    place, parallel = np.array(VIEWS[view][0]), VIEWS[view][1]
    spacing *= 4.0 if parallel else 1.0
    towards = MIDDLE + np.array([0.3, 0.1, 0.2]) - place
    return beams.tile(place, towards, np.array([0.0, 0.0, 1.0]), spacing, parallel=parallel, side=side)


def traced(spec: str, origins: Any, directions: Any) -> tuple[Any, Any, Any, Any]:
    """The structure, the rays in f32, and their record."""
    structure = native.build(*SOUP, spec)
    rays = origins.astype(np.float32), directions.astype(np.float32)
    return structure, *rays, structure.trace_beam(*rays)


def parts(path: Any, values: str, offsets: str) -> list[Any]:
    return np.split(path[values], path[offsets][1:-1])


@pytest.mark.parametrize("least", [1, 16, 200])
@pytest.mark.parametrize("view", VIEWS)
def test_the_record_is_what_the_rays_meet(view: str, least: int) -> None:
    structure, origins, directions, path = traced(f"{POLYGON},beam_min={least}", *some_rays(view))
    # The hits are those of all triangles, bit for bit.
    for other in (structure.closest(origins, directions, order="tile8"), native.build(*SOUP, "brute")):
        expected = other if hasattr(other, "triangle") else other.closest(origins, directions)
        for name in ("t", "triangle", "u", "v"):
            assert np.array_equal(getattr(path["hits"], name), getattr(expected, name)), name
    # Each ray is in one beam at most, and the rays of a step that go on are divided among those that come from it.
    own, steps = parts(path, "rays", "ray_offsets"), range(len(path["parent"]))
    assert (path["parent"] < np.arange(len(path["parent"]))).all()
    for step in (-1, *steps):
        children = np.flatnonzero(path["parent"] == step)
        rays = np.concatenate([np.zeros(0, np.int32), *(own[child] for child in children)])
        assert len(np.unique(rays)) == len(rays)
        if step < 0:
            continue
        assert np.isin(rays, own[step]).all()
        action, gone = path["action"][step], np.setdiff1d(own[step], rays)
        if action in (ENDED, SINGLES, LEFT):
            assert not len(children)
        if action == HANDED_ON:
            assert len(children) == 1
        if action in (HANDED_ON, CLIPPED, SPLIT):
            assert path["tested"][step] or not len(gone)
        if action != SPLIT and len(gone) and path["tested"][step]:
            # Rays that end in a leaf have hit something, and not behind it.
            assert action == SINGLES or (path["hits"].triangle[gone] >= 0).all()
    # A ray that has hit was tested where it did, unless it went on singly.
    alone = np.concatenate([np.zeros(0, np.int32), *(own[step] for step in steps if path["action"][step] == SINGLES)])
    told = np.zeros(len(origins), bool)
    for step in np.flatnonzero(path["tested"]):
        rays = own[step][path["hits"].triangle[own[step]] >= 0]
        points = origins[rays] + path["hits"].t[rays, None] * directions[rays].astype(np.float64)
        told[rays] |= ((points >= path["low"][step] - 1e-4) & (points <= path["high"][step] + 1e-4)).all(axis=1)
    told[alone] = True
    beamed = np.concatenate([own[step] for step in np.flatnonzero(path["parent"] < 0)])
    assert told[np.intersect1d(beamed, np.flatnonzero(path["hits"].triangle >= 0))].all()
    assert len(beamed) > 100
    counters = path["hits"].counters
    # Some rays of a step that goes on singly may have ended in its leaf before.
    assert (counters["beam_singles"].sum() > 0) == (len(alone) > 0)
    assert counters["beam_singles"].sum() <= len(alone)
    assert counters["beam_splits"].sum() >= (path["action"] == SPLIT).sum()


@pytest.mark.parametrize("view", VIEWS)
def test_polygons_lie_in_faces_and_contain_their_rays(view: str) -> None:
    _, origins, directions, path = traced(f"{POLYGON},beam_min=1", *some_rays(view))
    size = np.ptp(np.concatenate([path["low"], path["high"]]), axis=0).max()
    compared = 0
    for step, (corners, rays) in enumerate(
        zip(parts(path, "vertices", "offsets"), parts(path, "rays", "ray_offsets"), strict=True)
    ):
        face, low, high = path["face"][step], path["low"][step], path["high"][step]
        if face < 0:
            assert not len(corners)
            continue
        # The corners are exactly in the face.
        axis, plane = face // 2, (high if face % 2 else low)[face // 2]
        assert (corners[:, axis] == plane).all()
        assert ((corners >= low) & (corners <= high)).all()
        # The rays cross the face inside all edges.
        t = (plane - origins[rays, axis].astype(np.float64)) / directions[rays, axis]
        points = np.delete(origins[rays] + t[:, None] * directions[rays].astype(np.float64), axis, axis=1)
        flat = np.delete(corners, axis, axis=1)
        edges = np.roll(flat, -1, axis=0) - flat
        # An edge as short as the rounding has no direction.
        length = np.linalg.norm(edges, axis=1, keepdims=True)
        edges = np.where(length > 1e-5 * size, edges / np.maximum(length, 1e-12), 0.0)
        aside = points[:, None] - flat
        heights = edges[:, 0] * aside[..., 1] - edges[:, 1] * aside[..., 0]
        turn = np.sign(np.sum(flat[:, 0] * np.roll(flat[:, 1], -1) - np.roll(flat[:, 0], -1) * flat[:, 1]))
        assert (turn * heights > -1e-5 * size).all(), step
        compared += len(rays)
        # A beam enters through the plane through which the one before left, or which its child shares.
        parent = path["parent"][step]
        if parent >= 0 and path["action"][step] != LEFT:
            assert plane in (path["low"][parent][axis], path["high"][parent][axis])
    assert compared > 1000


def test_shadow_rays_are_recorded_from_their_light() -> None:
    structure = native.build(*SOUP, f"{POLYGON},shadow=beam")
    targets = (MIDDLE + np.random.default_rng(2).uniform(-1.5, 1.5, (900, 3))).astype(np.float32)
    directions = np.array([8, 7, 6], np.float32) - targets
    path = structure.trace_beam(targets, directions, 0.0, 1.0, any_hit=True)
    assert np.array_equal(path["hits"].triangle >= 0, structure.occluded(targets, directions, 0.0, 1.0))
    assert (path["action"] == CLIPPED).any()
    assert len(np.unique(path["rays"])) > 500


def test_rays_that_make_no_polygons_are_refused() -> None:
    origins, directions = (part.astype(np.float32) for part in some_rays("from outside", 8))
    structure = native.build(*SOUP, POLYGON)
    for spec in ("kd", "octree-net", "octree-beam"):
        with pytest.raises(native.SpecError, match=r"has no polygons; octree-beam with traversal=polygon has$"):
            native.build(*SOUP, spec).trace_beam(origins, directions)
    with pytest.raises(native.SpecError, match=r"traversal=polygon and shadow=beam has$"):
        structure.trace_beam(origins, directions, any_hit=True)
    with pytest.raises(native.NonFiniteError, match="origins"):
        structure.trace_beam(np.full_like(origins, np.nan), directions)
    with pytest.raises(native.ShapeError, match="one per origin"):
        structure.trace_beam(origins, directions[:3])
    many = np.zeros((524_289, 3), np.float32)
    with pytest.raises(native.ShapeError, match=r"^origins: 524289 rays, and at most 524288 are recorded$"):
        structure.trace_beam(many, many)
    monitor = native.Monitor()
    monitor.cancel()
    with pytest.raises(native.Cancelled):
        structure.trace_beam(origins, directions, monitor=monitor)
    for empty in (structure, native.build(np.zeros((0, 3)), np.zeros((0, 3), np.int32), POLYGON)):
        path = empty.trace_beam(origins[:0], directions[:0])
        assert len(path["parent"]) == 0
        assert path["ray_offsets"].tolist() == [0]


@pytest.mark.parametrize("view", VIEWS)
def test_beams_are_drawn_with_a_legend(view: str) -> None:
    structure = native.build(*SOUP, POLYGON)
    assert polygons.traces(structure)
    assert not any(polygons.traces(native.build(*SOUP, spec)) for spec in ("kd", "octree-beam", "octree-net"))
    beam = polygons.follow(structure, *some_rays(view), *SOUP)
    made = polygons.levels(beam, 0.9, 2.0)
    for level in made:
        for part in (level.lines, level.line_colours, level.triangles, level.fill_colours):
            assert np.isfinite(part).all()
        assert np.abs(level.lines).max() < 40
    shown = {entry.text for entry in legend.of_polygons(beam)}
    for action, text in legend.ACTIONS.items():
        assert (text in shown) == bool(beam.count(action))
    # The sides end at the polygons of what goes on, and begin in the face before.
    sides = polygons._sides(beam)
    assert len(sides) > 20
    hits = native.build(*SOUP, "brute").closest(*(part.astype(np.float32) for part in some_rays(view)))
    assert len(beam.hits) == len(np.unique(hits.triangle[hits.triangle >= 0]))
    assert all(len(line) <= 60 for line in beam.lines())


def test_no_rays_and_no_hits_are_drawn() -> None:
    structure = native.build(*SOUP, POLYGON)
    origins, directions = some_rays("from outside", 16)
    beam = polygons.follow(structure, origins, -directions, *SOUP)
    assert not len(beam.hits)
    assert all(np.isfinite(level.lines).all() for level in polygons.levels(beam, 1.0, 1.0))

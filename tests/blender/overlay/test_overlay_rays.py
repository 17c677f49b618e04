# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves, picked rays and beams drawn offscreen, against what the walks tell of them."""

import math
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from addon.blender.overlay import choosing, picking
from addon.blender.overlay import drawing as overlay
from addon.blender.session import building, trees
from addon.blender.settings import presets
from addon.core.base import colours, native
from addon.core.overlay import beams, legend, polygons
from tests.blender.drawn import (
    HEIGHT,
    STRUCTURES,
    WIDTH,
    boxes,
    build,
    distances,
    everywhere,
    far_away,
    inside,
    pane,
    pick_a_box,
    picture,
    show,
    some_triangles,
)
from tests.blender.layouts import Window, operator


@everywhere
def test_leaves_cover_their_cells_and_the_fullest_is_brightest(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    look = {"parts": {"CELLS"}, "style": "FILL", "opacity": 1.0, "max_count": 120}
    tree, drawn, *view = show(canvas, scene, structure, **look)
    found = tree.structure.leaf_cells(1, 20)
    assert len(overlay.shown(scene, "CELLS")) == len(found["count"])
    polygons = np.split(found["vertices"].astype(np.float64) + tree.origin, found["offsets"][1:-1].astype(int))
    flat = [pane(polygon, *view) for polygon in polygons]
    covered, edge = np.any([inside(polygon) for polygon in flat], axis=0), distances(flat)
    lit = drawn[..., :3].max(axis=2) > 0.01
    assert not lit[~covered & (edge > 1.5)].any()
    within = covered & (edge > 1.5)
    assert lit.any()
    if not within.any():
        return
    assert lit[within].mean() > 0.99
    # Every pixel has a hue of the scale: each colour is a mix of those of the counts.
    hues = colours.of_counts(found["count"].astype(np.int64))
    lowest, highest = (hues / hues.max(axis=1, keepdims=True)).min(axis=0), hues.max(axis=0) / hues.max(axis=1).min()
    pure = drawn[within][:, :3]
    pure = pure / pure.max(axis=1, keepdims=True)
    assert (pure > lowest - 0.03).all()
    assert (pure < highest + 0.03).all()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_picked_ray_shows_its_cells_its_triangles_and_its_hit(
    scene: Any, add: Any, canvas: Any, structure: str
) -> None:
    far_away(add)
    tree, drawn, *view = show(canvas, scene, structure, parts={"RAY"}, opacity=1.0, line_width=3.0)
    assert not drawn.any()
    start, way = pick_a_box(scene)
    drawn = picture(canvas, scene, *view)
    path = overlay.shown(scene, "RAY")
    assert path.triangle >= 0
    expected = tree.structure.closest(np.array([start - Vector(tree.origin)], np.float32), np.array([way], np.float32))
    assert (path.triangle, path.t) == (
        expected.triangle[0],
        pytest.approx(float(expected.t[0]), rel=1e-4),
    )  # the world's coordinates are f32
    # The ray is white from its origin to the hit, and seen on all of its way inside the picture.
    ends = pane(np.array([start, start + way * path.t], np.float64), *view)
    along = ends[0] + np.linspace(0.02, 0.98, 60)[:, None] * (ends[1] - ends[0])
    inside_picture = ((along >= 1) & (along < [WIDTH - 1, HEIGHT - 1])).all(axis=1)
    assert inside_picture.sum() > 10
    pixels = along[inside_picture].astype(int)
    assert drawn[pixels[:, 1], pixels[:, 0], :3].min() > 0.6
    # Nothing outside what the visited cells, the planes and the ray cover.
    polygons = np.split(path.cells.vertices + tree.origin, path.cells.offsets[1:-1])
    polygons += np.split(path.crossings.vertices + tree.origin, path.crossings.offsets[1:-1])
    flat = [pane(polygon.astype(np.float64), *view) for polygon in polygons if len(polygon)]
    covered = np.any([inside(polygon) for polygon in flat], axis=0)
    far = distances([*flat, ends]) > 4
    assert not (drawn[..., :3].max(axis=2) > 0.02)[~covered & far].any()
    assert bpy.ops.halfspace.forget_ray() == {"FINISHED"}
    assert not picture(canvas, scene, *view).any()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_beam_shows_what_its_rays_share(scene: Any, add: Any, canvas: Any, structure: str) -> None:
    far_away(add)
    look = {"parts": {"BEAM"}, "opacity": 1.0, "line_width": 3.0, "beam_spacing": 10.0}
    tree, _, *view = show(canvas, scene, structure, **look)
    _, way = pick_a_box(scene, pixel=0.002)
    drawn = picture(canvas, scene, *view)
    beam = overlay.shown(scene, "BEAM")
    # Eight by eight rays around the picked one, with ten pixels of 0.002 between neighbours.
    along = beam.directions @ np.array(way.normalized())
    assert along == pytest.approx(1.0, abs=1e-5)
    steps = np.diff(beam.directions.reshape(8, 8, 3), axis=1)
    assert np.linalg.norm(steps, axis=-1) == pytest.approx(0.02, rel=1e-4)
    # What each ray meets is what the structure says, and each triangle is shown once.
    origins, directions = (part.astype(np.float32) for part in (beam.origins, beam.directions))
    expected = tree.structure.closest(origins, directions)
    assert np.array_equal(beam.t.astype(np.float32), expected.t)
    assert len(beam.hits) == len(set(expected.triangle.tolist()) - {-1})
    assert beam.cells.count.max() <= 64
    assert beam.cells.count.sum() == beam.visits
    # Its four edges are white to where they end, and outside beam, cells and hits there is nothing.
    ends = np.stack([beam.origins[list(beams.CORNERS)], beams.ends(beam)], axis=1) + tree.origin
    edges = [pane(end, *view) for end in ends]
    for first, last in edges:
        points = first + np.linspace(0.03, 0.97, 40)[:, None] * (last - first)
        points = points[((points >= 1) & (points < [WIDTH - 1, HEIGHT - 1])).all(axis=1)].astype(int)
        assert drawn[points[:, 1], points[:, 0], :3].min() > 0.55
    polygons = np.split(beam.cells.vertices + tree.origin, beam.cells.offsets[1:-1])
    polygons += [corners + tree.origin for corners in beam.hits]
    polygons += [np.array([*ends[i], ends[j][1]]) for i, j in zip(range(4), (1, 2, 3, 0), strict=True)]
    flat = [pane(polygon.astype(np.float64), *view) for polygon in polygons if len(polygon)]
    covered, far = np.any([inside(polygon) for polygon in flat], axis=0), distances(flat) > 4
    assert not (drawn[..., :3].max(axis=2) > 0.02)[~covered & far].any()


def test_a_tile_taken_together_takes_fewer_steps(scene: Any, add: Any) -> None:
    boxes(add)
    tree = build(scene, "octree-beam")
    ray = picking.Ray((9.0, -7.0, 5.0), (-9.0, 7.0, -4.0), pixel=0.001)
    beam = beams.follow(tree.structure, *ray.tile(tree.origin, 4.0))
    assert beam.together[0] < beam.alone[0]
    assert "Together" in beam.lines()[-1]
    alone = beams.follow(native.load().build(*some_triangles(), "octree-net"), *ray.tile(tree.origin, 4.0))
    assert alone.together == alone.alone
    parallel = picking.Ray((0.0, 0.0, 9.0), (0.0, 0.0, -1.0), pixel=0.25, parallel=True).tile((0, 0, 0), 2.0)
    assert np.ptp(parallel[0], axis=0) == pytest.approx([3.5, 3.5, 0.0])
    assert np.ptp(parallel[1], axis=0) == pytest.approx(0.0)


def test_beams_of_polygons_are_drawn_in_the_colours_of_what_becomes_of_them(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    look = {"parts": {"BEAM"}, "style": "BOTH", "opacity": 1.0, "beam_spacing": 40.0}
    _, _, *view = show(canvas, scene, "octree-beam", **look)
    presets.apply(scene.halfspace, "octree-beam:traversal=polygon")
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    tree = trees.last(scene)
    assert tree is not None
    pick_a_box(scene, pixel=0.002)
    drawn = picture(canvas, scene, *view)
    beam = overlay.shown(scene, "BEAM")
    assert isinstance(beam, polygons.PolygonBeam)
    assert len(beam.t) == polygons.SIDE**2
    assert beam.count(polygons.CLIPPED)
    # The corners of the beam are those of the tile of 64 rays.
    ray = picking.last(scene)
    assert ray is not None
    corners = ray.tile(tree.origin, 40.0)[1][list(beams.CORNERS)]
    side = polygons.SIDE
    assert beam.directions[[0, side - 1, side * side - 1, side * side - side]] == pytest.approx(corners)
    # Pixels have hues of the legend, each of which is seen.
    lit = drawn[drawn[..., :3].max(axis=2) > 0.5][:, :3]
    assert len(lit) > 100
    for action in (polygons.CLIPPED, polygons.ENDED):
        aside = np.abs(lit / lit.max(axis=1, keepdims=True) - np.array(polygons.RGB[action])).max(axis=1)
        assert aside.min() < 0.15, action
    texts = {entry.text for entry in choosing.legend_of(scene, {"BEAM": beam}, {})}
    assert legend.ACTIONS[polygons.CLIPPED] in texts


@pytest.mark.parametrize(
    ("origin", "direction", "words"),
    [
        ((0, 0, 9), (0, 0, 0), "direction: is zero"),
        ((0, 0, 9), (math.nan, 0, 1), "direction: is not finite"),
        ((0, math.nan, 9), (0, 0, -1), "origin: is not finite"),
    ],
)
def test_a_ray_that_is_none_is_refused(
    scene: Any, origin: tuple[float, ...], direction: tuple[float, ...], words: str
) -> None:
    """A script may give anything, and each redraw of the view would fail."""
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.halfspace.pick_ray(origin=origin, direction=direction)
    assert picking.last(scene) is None


def middle_of_view(screen: Any) -> dict[str, int]:
    """The place of the mouse over a 3D view."""
    area = next(area for area in screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"mouse_x": region.x + region.width // 2, "mouse_y": region.y + region.height // 2}


def test_picking_starts_the_build_and_waits_for_it(scene: Any, add: Any) -> None:
    boxes(add)
    scene.halfspace.overlay.auto_update = False
    window, kind = Window(scene), picking.HALFSPACE_OT_pick_ray
    itself, context = operator(kind, pixel=1e-3), window.context
    middle = middle_of_view(context.screen)
    assert trees.last(scene) is None
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert "EYEDROPPER" in window.calls
    assert window.texts == ["Building the structure: 0%   Click: keep this ray   Esc: leave"]
    kind.modal(itself, context, SimpleNamespace(type="MOUSEMOVE", value="", **middle))
    assert picking.last(scene) is not None, "the ray is there before the structure"
    run_builds()
    assert trees.last(scene) is not None
    assert kind.modal(itself, context, SimpleNamespace(type="TIMER")) == {"PASS_THROUGH"}
    assert window.texts[-1] == "Click: keep this ray   Esc: leave"
    assert kind.modal(itself, context, SimpleNamespace(type="LEFTMOUSE", value="PRESS", **middle)) == {"FINISHED"}
    assert window.calls[-2:] == ["no timer", "restored"]
    assert not itself.said


def test_picking_ends_with_a_build_that_fails(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    boxes(add)
    window, kind = Window(scene), picking.HALFSPACE_OT_pick_ray
    itself, context = operator(kind, pixel=1e-3), window.context
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}

    def fail(*_: Any) -> None:
        raise MemoryError("no memory for this tree")

    monkeypatch.setattr(building, "Job", fail)
    run_builds()
    assert kind.modal(itself, context, SimpleNamespace(type="TIMER")) == {"CANCELLED"}
    assert itself.said == ["no memory for this tree"]
    assert not scene.halfspace.overlay.show
    # The next attempt does not end with the old message.
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(itself, context, SimpleNamespace(type="TIMER")) == {"PASS_THROUGH"}
    kind.modal(itself, context, SimpleNamespace(type="ESC", value="PRESS"))
    building.stop()


def run_builds() -> None:
    """Run the timer of builds to its end, as a window does."""
    building._Background.wished_at = -1e9
    while building._tick() is not None:
        if building._Background.job is not None:
            building._Background.job._session.wait(300)


def test_the_cursor_picks_a_ray_and_esc_gives_the_last_one_back(scene: Any, add: Any) -> None:
    boxes(add)
    build(scene, "kd")
    assert bpy.ops.halfspace.pick_ray(origin=(0, 0, 9), direction=(0, 0, -1)) == {"FINISHED"}
    first = picking.last(scene)
    window, kind = Window(scene), picking.HALFSPACE_OT_pick_ray
    itself, context = operator(kind, pixel=1e-3), window.context
    middle = middle_of_view(context.screen)
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(itself, context, SimpleNamespace(type="MOUSEMOVE", value="", **middle)) == {"RUNNING_MODAL"}
    moved = picking.last(scene)
    assert moved != first
    assert kind.modal(itself, context, SimpleNamespace(type="ESC", value="PRESS")) == {"CANCELLED"}
    assert picking.last(scene) == first
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(itself, context, SimpleNamespace(type="LEFTMOUSE", value="PRESS", **middle)) == {"FINISHED"}
    assert picking.last(scene) == moved
    # What is adjusted afterwards begins with what was picked.
    assert (itself.origin, itself.direction, itself.pixel) == (moved.origin, moved.direction, moved.pixel)
    assert [call for call in window.calls if call != "modal"] == ["EYEDROPPER", "no timer", "restored"] * 2
    assert [text for text in window.texts if text] == ["Click: keep this ray   Esc: leave"] * 2

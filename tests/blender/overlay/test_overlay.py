# SPDX-License-Identifier: GPL-3.0-or-later
"""The overlay drawn offscreen, against polygons that are projected here on their own way to the picture."""

from pathlib import Path
from typing import Any

import bpy
import gpu
import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.blender.overlay import drawing as overlay
from addon.blender.settings import properties
from addon.core.overlay import planes
from scripts.dev import overlay_picture
from tests.blender.drawn import (
    HEIGHT,
    WIDTH,
    boxes,
    build,
    camera,
    distances,
    everywhere,
    inside,
    picture,
    projected,
    show,
)
from tests.blender.shapes import cube


@everywhere
def test_lines_are_where_the_planes_end_and_in_their_colours(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    look = {"style": "OUTLINE", "depth_max": 3, "opacity": 1.0, "line_width": 2.0, "cuts": False}
    tree, drawn, *view = show(canvas, scene, structure, **look)
    polygons = projected(tree, *view, depth=3)
    every = distances([polygon for _, polygon in polygons])
    lit = drawn[..., 3] > 0.02
    # Widths are 1 to 2 pixels, whose edges fade over another.
    assert not lit[every > 3].any()
    if not polygons:
        assert structure == "brute"
        assert not lit.any()
        return
    assert lit[every < 0.3].mean() > 0.99
    assert 0.005 < lit.mean() < 0.6
    tints = overlay.colours()
    tinted = drawn[..., :3].max(axis=2) > 0.05  # the dark edging of lines has no colour
    for kind in {kind for kind, _ in polygons}:
        others = distances([polygon for other, polygon in polygons if other != kind])
        alone = (distances([polygon for other, polygon in polygons if other == kind]) < 0.3) & (others > 4) & tinted
        if alone.sum() >= 10:
            pure = drawn[alone][:, :3] / drawn[alone][:, :3].max(axis=1, keepdims=True)
            tint = np.array(tints[planes.KINDS[kind]])
            assert np.abs(pure - tint / tint.max()).max() < 0.02


@everywhere
def test_panes_cover_their_planes_and_nothing_else(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    tree, drawn, *view = show(canvas, scene, structure, style="FILL", depth_max=2, opacity=1.0)
    polygons = [polygon for _, polygon in projected(tree, *view, depth=2)]
    covered = np.any([inside(polygon) for polygon in polygons], axis=0) if polygons else np.zeros((HEIGHT, WIDTH), bool)
    edge = distances(polygons)
    lit = drawn[..., :3].max(axis=2) > 0
    assert not lit[~covered & (edge > 1)].any()
    if polygons:
        assert covered.mean() > 0.02
        assert lit[covered & (edge > 1)].mean() > 0.99


def test_depths_kinds_and_limit_choose_what_is_drawn(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    _, drawn, *view = show(canvas, scene, "kd", style="OUTLINE", depth_min=1, depth_max=3, kinds={"X"})
    chosen = overlay.shown(scene)
    assert set(chosen.kind.tolist()) == {0}
    assert chosen.depth.min() >= 1
    red = np.array(overlay.colours()["X"])
    bright = drawn[drawn[..., :3].max(axis=2) > 0.3][:, :3]
    assert len(bright)
    assert np.abs(bright / bright.max(axis=1, keepdims=True) - red / red.max()).max() < 0.02
    scene.halfspace.overlay.max_count = 1
    picture(canvas, scene, *view)
    limited = overlay.shown(scene)
    assert (len(limited), limited.hidden) == (1, len(chosen) - 1)


def test_cuts_are_drawn_on_the_scene_if_wished(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    _, drawn, *view = show(canvas, scene, "kd", style="OUTLINE", depth_max=3)
    assert len(overlay.shown(scene).cuts.owner)
    assert "bold where a plane cuts the scene" in [entry.text for entry in overlay.legend_of(scene)]
    scene.halfspace.overlay.cuts = False
    without = picture(canvas, scene, *view)
    assert overlay.shown(scene).cuts is None
    assert (drawn[..., 3] > 0.5).sum() > (without[..., 3] > 0.5).sum() > 0


def test_the_layer_of_a_grid_is_chosen_by_hand(scene: Any, add: Any, canvas: Any) -> None:
    for number, spot in enumerate((4 * np.random.default_rng(1).random((200, 3)) - 2).tolist()):
        add(f"Box {number}", cube(size=0.2), location=spot)
    _, _, *view = show(canvas, scene, "grid")
    settings, places = scene.halfspace.overlay, []
    for axis, share in (("X", 0.0), ("X", 1.0), ("Y", 0.5)):
        settings.slice_axis, settings.slice_place = axis, share
        picture(canvas, scene, *view)
        chosen = overlay.shown(scene)
        assert chosen.across == "XYZ".index(axis)
        assert chosen.marked == len(chosen.rgb)
        places.append(float(chosen.vertices[:, chosen.across].mean()))
    assert places[0] < places[1] - 3


def test_batches_are_made_once_per_tree_and_setting(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    _, _, *view = show(canvas, scene, "kd")

    def drawn() -> Any:
        return (overlay.DRAWINGS.of(scene) or {})["PLANES", 0]

    first = drawn()
    picture(canvas, scene, *view)
    assert drawn() is first
    scene.halfspace.overlay.opacity = 0.5
    picture(canvas, scene, *view)
    second = drawn()
    assert second is not first
    assert second.chosen is first.chosen
    build(scene, "kd")
    assert overlay.shown(scene) is None
    picture(canvas, scene, *view)
    assert drawn().tree != first.tree


def test_objects_hide_planes_as_far_as_wished(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    tree = build(scene, "kd", style="OUTLINE", depth_max=3, opacity=1.0, behind=0.0)
    view, projection = camera(tree)

    def covered_by(depth: float) -> float:
        with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            framebuffer = gpu.state.active_framebuffer_get()
            framebuffer.clear(color=(0, 0, 0, 0), depth=depth)
            gpu.matrix.load_matrix(view)
            gpu.matrix.load_projection_matrix(projection)
            overlay.paint(scene, (WIDTH, HEIGHT))
            pixels = framebuffer.read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
        return float(np.array(pixels.to_list())[..., :3].sum())

    before = covered_by(1.0)
    assert covered_by(0.0) == 0.0
    scene.halfspace.overlay.behind = 0.5
    assert 0.1 * before < covered_by(0.0) < 0.6 * before
    assert covered_by(1.0) == pytest.approx(before)


def test_nothing_is_drawn_and_nothing_kept_when_switched_off(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    _, drawn, *view = show(canvas, scene, "kd")
    assert drawn.any()
    scene.halfspace.overlay.show = False
    assert not picture(canvas, scene, *view).any()
    assert not overlay.DRAWINGS.all()


def test_handlers_come_and_go_with_the_wish(scene: Any) -> None:
    assert not overlay._handles
    scene.halfspace.overlay.show = True
    handles = list(overlay._handles)
    assert len(handles) == 2
    scene.halfspace.overlay.show = True
    assert overlay._handles == handles
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not overlay._handles
    assert bpy.app.handlers.depsgraph_update_post.count(overlay._scene_changed) == 1


def test_the_command_saves_a_picture_with_the_planes_in_it(
    canvas: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "planes.png"
    arguments = ["--size", "96x54", "--depth", "4-6", "--out", str(out)]
    view = ["--view", "5", "-8", "6", "0", "0.5", "0.7"]
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    assert overlay_picture.main([*arguments, *view]) == 0
    assert "planes of kd, 0 hidden" in capsys.readouterr().out
    drawn = pictures.load(out)[..., :3]
    assert drawn.shape == (54, 96, 3)
    # The scene is grey: whatever has a hue is a plane.
    assert 0.02 < ((drawn.max(axis=2) - drawn.min(axis=2)) > 0.1).mean() < 0.9
    assert overlay_picture.main([*arguments, "--depth", "x"]) == 2
    assert overlay_picture.main([str(tmp_path / "none.blend"), *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 2
    assert overlay_picture.main([*arguments, *view, "--structure", "kd:max_depth=5", "--traversal", "dir"]) == 0
    assert "planes of kd:max_depth=5,traversal=dir, 0 hidden" in capsys.readouterr().out
    assert properties.spec(bpy.context.scene.halfspace) == "kd:traversal=dir,max_depth=5"
    assert overlay_picture.main([*arguments, "--structure", "oak"]) == 2
    assert "--structure: unknown structure 'oak'; there are " in capsys.readouterr().err

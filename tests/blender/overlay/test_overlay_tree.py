# SPDX-License-Identifier: GPL-3.0-or-later
"""The tree that the overlay shows: renders and builds provide it, edits make it stale, and it follows the scene."""

import gc
import weakref
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.blender.session import building, trees
from addon.core.structures import catalogue
from tests.blender.drawn import build
from tests.blender.layouts import Window, operator, until_it_ends
from tests.blender.shapes import cube, grid


def test_an_edit_makes_the_tree_stale_but_a_camera_does_not(scene: Any, add: Any) -> None:
    box = add("Box", cube())
    lens = add("Camera", bpy.data.cameras.new("Camera"))
    tree = build(scene, "kd")
    lens.location.x = 3
    bpy.context.view_layer.update()
    assert not tree.stale
    box.location.x = 3
    bpy.context.view_layer.update()
    assert tree.stale
    tree = build(scene, "kd")
    assert not tree.stale
    bpy.data.objects.remove(box)
    bpy.context.view_layer.update()
    assert tree.stale


def test_a_render_leaves_its_tree_and_a_new_one_takes_its_place(scene: Any, add: Any) -> None:
    add("Box", cube())
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 9))
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.halfspace.samples = 1
    bpy.ops.render.render()
    tree = trees.last(scene)
    assert tree.count == 12
    gone = weakref.ref(tree)
    del tree
    assert build(scene, "brute").spec == "brute"
    gc.collect()
    assert gone() is None
    assert bpy.ops.halfspace.free_structure() == {"FINISHED"}
    assert trees.last(scene) is None


def run_ticks() -> int:
    """Run the timer of automatic builds until it ends. Returns the number of ticks before."""
    for count in range(100):
        if building._tick() is None:
            return count
        if building._Background.job is not None:
            building._Background.job._session.wait(300)
    pytest.fail("the build never ends")


def test_a_shown_tree_follows_the_scene_by_itself(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "REST_SECONDS", 0.0)
    box = add("Box", cube())
    scene.halfspace.overlay.show = True
    run_ticks()
    first = trees.last(scene)
    box.location.x = 5
    bpy.context.view_layer.update()
    assert first.stale
    run_ticks()
    second = trees.last(scene)
    assert second.number > first.number
    assert second.origin[0] == pytest.approx(5)
    scene.halfspace.structure = "brute"
    run_ticks()
    assert trees.last(scene).spec == "brute"
    scene.halfspace.overlay.auto_update = False
    box.location.x = 6
    bpy.context.view_layer.update()
    assert trees.last(scene).stale
    assert run_ticks() == 0


def test_an_automatic_build_that_fails_is_reported(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: Any, **_kwargs: Any) -> None:
        raise ValueError("the scene\nis odd")

    monkeypatch.setattr(building, "REST_SECONDS", 0.0)
    monkeypatch.setattr(building.extract, "extract", fail)
    scene.halfspace.overlay.show = True
    run_ticks()
    assert building.problem() == "the scene is odd"
    with pytest.raises(RuntimeError, match="the scene is odd"):
        bpy.ops.halfspace.build_structure()
    building.stop()
    assert building.problem() == ""


@pytest.mark.parametrize("stopped", [True, False])
def test_the_operator_builds_in_the_background_and_esc_stops_it(scene: Any, add: Any, stopped: bool) -> None:
    add("Sea", grid(300))
    window, kind = Window(scene), building.HALFSPACE_OT_build_structure
    itself, context = operator(kind), window.context
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(itself, context, SimpleNamespace(type="MOUSEMOVE")) == {"PASS_THROUGH"}
    if stopped:
        assert kind.modal(itself, context, SimpleNamespace(type="ESC")) == {"CANCELLED"}
    else:
        assert until_it_ends(kind, itself, context) == {"FINISHED"}
    assert window.calls == ["begin", "modal", "no timer", "end"]
    assert window.texts[-1] is None
    assert (trees.last(scene) is None) == stopped
    assert itself.said == (
        ["Building was stopped"] if stopped else [f"{catalogue.load()['kd'].label} over 180,000 triangles"]
    )

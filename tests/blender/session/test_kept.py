# SPDX-License-Identifier: GPL-3.0-or-later
"""The kept structure is measured over its own triangles, and built again when the scene is no longer what it was."""

from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import cost_maps, map_pictures, workloads
from addon.blender.render import engine
from addon.blender.session import building, trees
from addon.blender.ui import overlay_panels, panels
from addon.core.base import native
from addon.core.measure import costmap
from addon.lab.pictures import whole
from tests.blender.drawn import row
from tests.blender.layouts import draw


@pytest.fixture
def seen(scene: Any) -> Any:
    """Boxes before a camera, and nothing shown of any structure."""
    row(scene, (64, 32))
    scene.render.engine = "HALFSPACE"
    scene.halfspace.samples = 1
    scene.halfspace.instancing = "flatten"
    assert not scene.halfspace.overlay.show
    return scene


def kept(scene: Any) -> trees.Tree:
    return trees.last(scene)


def right(tree: trees.Tree) -> bool:
    """Whether the tree was checked and does not err."""
    return tree.check is not None and tree.check.right


def turn(scene: Any) -> None:
    scene.objects["Box 2"].rotation_euler = (0.4, 0.5, 0.6)


def subdivide(scene: Any) -> None:
    """More triangles in renders than in the viewport."""
    modifier = scene.objects["Box 1"].modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 2


def hide(scene: Any) -> None:
    """Fewer triangles in renders than in the viewport."""
    scene.objects["Box 3"].hide_render = True


def animate(scene: Any) -> None:
    item = scene.objects["Box 0"]
    for frame, x in ((1, -2.0), (10, 1.0)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    scene.frame_set(1)


def test_an_edit_while_nothing_is_shown_is_noticed_before_measuring(seen: Any) -> None:
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    before = kept(seen)
    turn(seen)
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert before.stale
    assert kept(seen) is not before
    assert right(kept(seen))
    # Once more, over the same triangles: nothing is built again.
    now = kept(seen)
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert kept(seen) is now


@pytest.mark.parametrize(("change", "triangles"), [(subdivide, 4 * 12 + 12 * 16), (hide, 4 * 12)])
def test_a_render_is_measured_over_its_own_triangles(seen: Any, change: Any, triangles: int) -> None:
    change(seen)
    bpy.context.view_layer.update()
    bpy.ops.render.render()
    rendered = kept(seen)
    assert rendered.count == triangles
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert kept(seen) is rendered
    assert right(rendered)
    assert whole.check_rays(seen).right


def test_only_another_frame_makes_an_animated_render_stale(seen: Any) -> None:
    animate(seen)
    bpy.ops.render.render()
    rendered = kept(seen)
    assert not rendered.stale
    seen.frame_set(10)
    assert rendered.stale
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert right(kept(seen))


def test_an_edit_during_a_build_leaves_its_tree_stale(seen: Any) -> None:
    job = building.Job(seen, bpy.context.evaluated_depsgraph_get())
    turn(seen)
    bpy.context.view_layer.update()
    while not job.step(1.0):
        pass
    assert kept(seen).stale


def test_the_camera_is_where_it_is_now(seen: Any) -> None:
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    tree = kept(seen)
    seen.camera.location = (3, 1, 8)
    workload = workloads.of_tree(tree, "boxes", (64, 32))
    assert not tree.stale
    assert np.allclose(workload.view.eye, np.array([3, 1, 8]) - tree.origin)
    assert workload.vertices is tree.vertices


@pytest.mark.parametrize("change", [turn, hide])
def test_cost_maps_walk_the_triangles_that_they_were_built_over(seen: Any, change: Any) -> None:
    group = seen.halfspace
    group.structure, group.second, group.cost = "kd", "brute", "TESTS"
    change(seen)
    bpy.ops.render.render()
    triangles = kept(seen).count
    if change is turn:
        seen.objects["Box 4"].location = (0, 0, 3)
    drawn: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_pictures, "compose", lambda maps, *_: drawn.extend(maps))
        cost_maps.draw(seen, 64)
    bpy.context.view_layer.update()
    workload = (
        workloads.of_tree(kept(seen), "boxes", (64, 32)) if change is hide else workloads.current("boxes", (64, 32))
    )
    for (_, values), spec in zip(drawn, ("kd", "brute"), strict=True):
        tree = native.load().build(workload.vertices, workload.triangles, spec)
        assert np.array_equal(values, costmap.measure(tree, workload, (64, 32), "TESTS"))
    assert drawn[1][1].max() == triangles == len(workload.triangles)


def test_speeds_stand_beside_what_is_known_of_the_answers(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(engine._Picture, "_show_status", lambda _self, text: said.append(text))
    bpy.ops.render.render()
    speeds = [text for text in said if "Mray/s" in text]
    assert speeds
    assert all("answers not compared" in text for text in speeds)
    shown = (panels.HALFSPACE_PT_statistics, overlay_panels.HALFSPACE_PT_view_statistics)
    for panel in shown:
        drawn = draw(panel, scene=seen)
        assert "Build" in drawn
        assert "Answers not compared" in drawn
    (built,) = (line for line in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=seen) if "Built in" in line)
    assert built.endswith("answers not compared")
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    for panel in shown:
        drawn = draw(panel, scene=seen)
        assert "answers not compared" not in drawn
        assert " ".join(drawn).count("brute force") == 1
    (built,) = (line for line in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=seen) if "Built in" in line)
    assert built.endswith("16,384 answers right")
    # Another structure than the picture's: what is known of it says nothing about the picture.
    seen.halfspace.structure = "bvh-sah"
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    drawn = draw(panels.HALFSPACE_PT_statistics, scene=seen)
    assert "The picture: answers not compared" in drawn
    assert "16,384 answers of Bounding volume hierarchy" in " ".join(drawn)


def test_the_panel_tells_an_edit_that_nobody_has_seen(seen: Any) -> None:
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    assert "The scene has changed since" not in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=seen)
    turn(seen)
    bpy.context.view_layer.update()
    assert "The scene has changed since" in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=seen)

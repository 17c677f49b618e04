# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects of the selected node alone in the 3D views, and everything as before afterwards."""

from pathlib import Path
from typing import Any

import bpy
import pytest

import addon
from addon.blender.inspector import isolating
from addon.blender.session import trees
from tests.blender.drawn import boxes, build
from tests.blender.shapes import cube


def view() -> Any:
    """The 3D view of the window."""
    return next(area.spaces.active for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")


def visible(scene: Any) -> set[str]:
    bpy.context.view_layer.update()
    return {item.name for item in scene.objects if item.visible_get(viewport=view())}


@pytest.fixture
def boxed(scene: Any, add: Any) -> Any:
    """Four boxes, of which one is selected, and a tree whose first children hold some of them."""
    boxes(add)
    scene.objects["Box 1"].select_set(True)
    bpy.context.view_layer.objects.active = scene.objects["Box 1"]
    bpy.context.view_layer.update()
    yield scene
    isolating._end()


def node_of_one(scene: Any) -> tuple[Any, int, str]:
    """Build; select a node whose triangles belong to one object. The tree, the node and the object's name."""
    tree = build(scene, "kd")
    table = tree.table()
    node = next(node for node in range(len(table)) if len(tree.owners(table.triangles_of(node))) == 1)
    scene.halfspace.inspector.node = node
    (name,) = tree.owners(table.triangles_of(node))
    return tree, node, name


def test_the_objects_of_a_node_are_alone_until_it_is_switched_off(boxed: Any) -> None:
    every = visible(boxed)
    assert every == {f"Box {i}" for i in range(4)}
    tree, node, name = node_of_one(boxed)
    settings = boxed.halfspace.inspector
    settings.isolated = True
    assert visible(boxed) == {name}
    # The triangles of each object are known by their place.
    corners = tree.vertices[tree.triangles[tree.table().triangles_of(settings.node)]].reshape(-1, 3) + tree.origin
    box = boxed.objects[name]
    low, high = (box.matrix_world.translation[axis] - box.dimensions[axis] / 2 for axis in range(3)), box.dimensions
    for axis, start in enumerate(low):
        assert corners[:, axis].min() >= start - 1e-4
        assert corners[:, axis].max() <= start + high[axis] + 1e-4
    # Another node shows other objects; the root all of them.
    bpy.ops.halfspace.go_to_node(to="ROOT")
    assert visible(boxed) == every
    settings.node = node
    assert visible(boxed) == {name}
    assert not tree.stale
    settings.isolated = False
    assert view().local_view is None
    assert visible(boxed) == every
    # Selection and hidden objects are as before.
    assert [item.name for item in bpy.context.view_layer.objects.selected] == ["Box 1"]
    assert bpy.context.view_layer.objects.active.name == "Box 1"
    assert not tree.stale


def test_objects_hidden_by_hand_stay_hidden(boxed: Any) -> None:
    boxed.objects["Box 2"].hide_set(True)
    tree = build(boxed, "kd")
    assert tree.owners(tree.table().triangles_of(0)) == {"Box 0", "Box 1", "Box 3"}
    boxed.halfspace.inspector.isolated = True
    assert visible(boxed) == {"Box 0", "Box 1", "Box 3"}
    boxed.halfspace.inspector.isolated = False
    assert boxed.objects["Box 2"].hide_get()
    assert visible(boxed) == {"Box 0", "Box 1", "Box 3"}


def test_a_view_that_the_user_isolated_is_left_alone(boxed: Any) -> None:
    build(boxed, "kd")
    area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    isolating._toggle(bpy.context.window, area)
    assert visible(boxed) == {"Box 1"}
    boxed.halfspace.inspector.isolated = True
    assert visible(boxed) == {"Box 1"}
    boxed.halfspace.inspector.isolated = False
    assert visible(boxed) == {"Box 1"}
    isolating._toggle(bpy.context.window, area)


def test_instances_are_shown_with_their_instancer(scene: Any, add: Any) -> None:
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("Inner", cube()))
    add("Far", cube(), location=(20, 0, 0))
    place = add("Place", None)
    place.instance_type, place.instance_collection = "COLLECTION", group
    bpy.context.view_layer.update()
    tree = build(scene, "kd")
    assert tree.owners(tree.table().triangles_of(0)) == {"Inner", "Far"}
    table = tree.table()
    node = next(n for n in range(len(table)) if tree.owners(table.triangles_of(n)) == {"Inner"})
    scene.halfspace.inspector.node = node
    scene.halfspace.inspector.isolated = True
    assert visible(scene) == {"Place"}
    scene.halfspace.inspector.isolated = False
    assert visible(scene) == {"Far", "Place"}


def test_undo_follows_the_setting(boxed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    every = visible(boxed)
    *_, name = node_of_one(boxed)
    settings = boxed.halfspace.inspector
    settings.isolated = True
    # Undo changes a setting without its callback.
    with monkeypatch.context() as patch:
        patch.setattr(isolating.signals.node_changed, "_listeners", [])
        settings.isolated = False
    for handler in bpy.app.handlers.undo_post:
        handler(boxed)
    assert visible(boxed) == every
    with monkeypatch.context() as patch:
        patch.setattr(isolating.signals.node_changed, "_listeners", [])
        settings.isolated = True
    for handler in bpy.app.handlers.redo_post:
        handler(boxed)
    assert visible(boxed) == {name}


def test_a_freed_structure_can_still_be_left(boxed: Any) -> None:
    every = visible(boxed)
    node_of_one(boxed)
    boxed.halfspace.inspector.isolated = True
    trees.clear()
    boxed.halfspace.inspector.isolated = False
    assert visible(boxed) == every


def test_a_file_saved_meanwhile_opens_with_everything(boxed: Any, tmp_path: Path) -> None:
    every = visible(boxed)
    node_of_one(boxed)
    boxed.halfspace.inspector.isolated = True
    path = str(tmp_path / "isolated.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert visible(boxed) != every
    for load_ui in (True, False):
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=load_ui)
        scene = bpy.context.scene
        assert not scene.halfspace.inspector.isolated
        assert view().local_view is None
        assert visible(scene) == every


def test_disabling_the_extension_shows_everything(boxed: Any) -> None:
    every = visible(boxed)
    node_of_one(boxed)
    boxed.halfspace.inspector.isolated = True
    addon.unregister()
    try:
        assert view().local_view is None
        assert visible(boxed) == every
        assert not isolating._ours
    finally:
        addon.register()


def test_a_new_structure_is_followed(boxed: Any) -> None:
    _, node, name = node_of_one(boxed)
    boxed.halfspace.inspector.isolated = True
    assert visible(boxed) == {name}
    # The same number is another node in the new tree.
    tree = build(boxed, "brute")
    wanted = tree.owners(tree.table().triangles_of(min(node, len(tree.table()) - 1)))
    assert wanted != {name}
    trees.announce()
    assert visible(boxed) == wanted

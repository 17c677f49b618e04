# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of scenes, and how long it is kept."""

from typing import Any

import bpy

from addon.blender import state
from addon.blender.session import trees

WORD: state.Slot[str] = state.Slot()


def test_scenes_have_values_of_their_own(scene: Any) -> None:
    other = bpy.data.scenes.new("Other")
    WORD.keep(scene, "one")
    assert (WORD.of(scene), WORD.of(other)) == ("one", None)
    evaluated = bpy.context.evaluated_depsgraph_get().scene_eval
    assert state.of(evaluated) is state.of(scene)
    WORD.keep(other, "two")
    assert WORD.all() == ["one", "two"]
    WORD.keep(scene, None)
    assert WORD.all() == ["two"]
    WORD.free()
    assert WORD.all() == []


def test_states_of_deleted_scenes_are_dropped(scene: Any, add: Any) -> None:
    other = bpy.data.scenes.new("Other")
    WORD.keep(scene, "one")
    WORD.keep(other, "two")
    gone = state.of(other)
    assert gone.scene == other
    bpy.data.scenes.remove(other)
    assert gone.scene is None
    add("Cube", bpy.data.meshes.new("Cube"))
    bpy.context.view_layer.update()
    assert WORD.all() == ["one"]
    assert not gone.values


def test_no_two_moments_are_equal(scene: Any, add: Any) -> None:
    read = trees.moment(scene)
    assert trees.moment(scene) == read
    item = add("Cube", bpy.data.meshes.new("Cube"))
    bpy.context.view_layer.update()
    moved = trees.moment(scene)
    assert moved != read
    # The state of a scene that was deleted and came back begins with another moment.
    state.drop()
    assert trees.moment(scene) not in (read, moved)
    item.location.x = 1

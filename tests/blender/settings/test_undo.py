# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever changes the file can be undone by itself, and leaving a tool leaves things as they were."""

import importlib
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import addon
from addon.blender.measure import compare_files, comparing, cost_maps
from addon.blender.overlay import drawing as overlay
from addon.blender.overlay import picking
from addon.blender.ui import manual
from tests.blender.layouts import Window, operator
from tests.blender.shapes import cube, look


@pytest.fixture
def seen(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(comparing, "VIEW_WIDTH", 32)
    monkeypatch.setattr(comparing, "REPEATS", 1)
    add("Box", cube())
    look((32, 32), (0, 0, 12))
    return scene


@pytest.mark.parametrize(
    ("name", "arguments", "made"),
    [
        ("compare", {}, lambda: [text.name for text in bpy.data.texts if text.name.startswith(compare_files.TEXT)]),
        ("choose", {}, lambda: [text.name for text in bpy.data.texts if text.name.startswith(compare_files.TEXT)]),
        ("cost_map", {"width": 32}, lambda: [image.name for image in bpy.data.images if image.name == cost_maps.IMAGE]),
        ("manual", {"section": "Structure"}, lambda: [t.name for t in bpy.data.texts if t.name == manual.TEXT]),
    ],
)
def test_an_operator_that_adds_to_the_file_is_a_step_of_its_own(
    seen: Any, name: str, arguments: dict[str, Any], made: Any
) -> None:
    bpy.ops.ed.undo_push(message="start")
    bpy.data.meshes.new("Mark").use_fake_user = True
    bpy.ops.ed.undo_push(message="a mark")
    # True: with its own step, as when a user calls it.
    assert getattr(bpy.ops.halfspace, name)("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}
    assert len(made()) == 1
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert made() == []
    assert "Mark" in bpy.data.meshes


def test_a_click_beside_all_views_leaves_the_ray_as_it_was(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}

    first, other = (picking.Ray((x, 0.0, 9.0), (0.0, 0.0, -1.0)) for x in (0.0, 1.0))
    picking.keep(seen, first)
    window, kind = Window(seen), picking.HALFSPACE_OT_pick_ray
    itself, context = operator(kind), window.context
    context.screen = None
    settings = seen.halfspace.overlay
    before = (settings.show, set(settings.parts))
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    monkeypatch.setattr(picking, "under", lambda *_: other)
    kind.modal(itself, context, SimpleNamespace(type="MOUSEMOVE", value="NOTHING"))
    assert picking.last(seen) == other
    monkeypatch.setattr(picking, "under", lambda *_: None)
    assert kind.modal(itself, context, SimpleNamespace(type="LEFTMOUSE", value="PRESS")) == {"CANCELLED"}
    assert picking.last(seen) == first
    assert (settings.show, set(settings.parts)) == before
    assert "UNDO" in kind.bl_options


def test_enabling_the_extension_shows_what_the_file_wishes_to_see(seen: Any) -> None:
    # Since 5.0 its name begins with an underscore.
    name = "bpy_restrict_state" if bpy.app.version < (5, 0) else "_bpy_restrict_state"
    restrict = importlib.import_module(name).RestrictBlend
    seen.halfspace.overlay.show = True
    addon.unregister()
    # Blender lets no add-on look at the file while it is being enabled.
    with restrict():
        addon.register()
    assert bpy.context.scene.halfspace.overlay.show
    # Without a window no timer runs, and none is registered.
    assert bpy.app.timers.is_registered(overlay._begin) != bpy.app.background
    overlay._begin()
    assert overlay._handles

# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever changes the file can be undone by itself, and leaving a tool leaves things as they were."""

from __future__ import annotations

import importlib
from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from shapes import cube

import addon
from addon.blender.measure import compare_files, comparing, cost_maps
from addon.blender.overlay import drawing as overlay
from addon.blender.overlay import picking
from addon.blender.ui import manual


@pytest.fixture
def seen(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(comparing, "VIEW_WIDTH", 32)
    monkeypatch.setattr(comparing, "REPEATS", 1)
    add("Box", cube())
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 12))
    scene.render.resolution_x = scene.render.resolution_y = 32
    return scene


@pytest.mark.parametrize(
    ("operator", "arguments", "made"),
    [
        ("compare", {}, lambda: [text.name for text in bpy.data.texts if text.name.startswith(compare_files.TEXT)]),
        ("choose", {}, lambda: [text.name for text in bpy.data.texts if text.name.startswith(compare_files.TEXT)]),
        ("cost_map", {"width": 32}, lambda: [image.name for image in bpy.data.images if image.name == cost_maps.IMAGE]),
        ("manual", {"section": "Structure"}, lambda: [t.name for t in bpy.data.texts if t.name == manual.TEXT]),
    ],
)
def test_what_an_operator_adds_to_the_file_is_a_step_of_its_own(
    seen: Any, operator: str, arguments: dict[str, Any], made: Any
) -> None:
    bpy.ops.ed.undo_push(message="start")
    bpy.data.meshes.new("Mark").use_fake_user = True
    bpy.ops.ed.undo_push(message="a mark")
    # True: with its own step, as when a user calls it.
    assert getattr(bpy.ops.halfspace, operator)("EXEC_DEFAULT", True, **arguments) == {"FINISHED"}
    assert len(made()) == 1
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert made() == []
    assert "Mark" in bpy.data.meshes


class Picker:
    """The operator's own part, which Blender makes only in a window."""

    _before: Any = None
    _timer: Any = None
    _end = picking.HALFSPACE_OT_pick_ray._end
    _leave = picking.HALFSPACE_OT_pick_ray._leave


def test_a_click_beside_all_views_leaves_the_ray_as_it_was(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}

    def nothing(*_: Any) -> None:
        pass

    context = SimpleNamespace(
        scene=seen,
        screen=None,
        window=SimpleNamespace(cursor_modal_set=nothing, cursor_modal_restore=nothing),
        workspace=SimpleNamespace(status_text_set=nothing),
        window_manager=SimpleNamespace(
            modal_handler_add=nothing, event_timer_add=lambda *_, **__: None, event_timer_remove=nothing
        ),
    )
    first, other = (picking.Ray((x, 0.0, 9.0), (0.0, 0.0, -1.0)) for x in (0.0, 1.0))
    picking.keep(seen, first)
    operator, kind = Picker(), picking.HALFSPACE_OT_pick_ray
    settings = seen.halfspace.overlay
    before = (settings.show, set(settings.parts))
    assert kind.invoke(operator, context, None) == {"RUNNING_MODAL"}
    monkeypatch.setattr(picking, "under", lambda *_: other)
    kind.modal(operator, context, SimpleNamespace(type="MOUSEMOVE", value="NOTHING"))
    assert picking.last(seen) == other
    monkeypatch.setattr(picking, "under", lambda *_: None)
    assert kind.modal(operator, context, SimpleNamespace(type="LEFTMOUSE", value="PRESS")) == {"CANCELLED"}
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

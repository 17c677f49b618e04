# SPDX-License-Identifier: GPL-3.0-or-later
"""Registering adds, unregistering takes away, as often as one likes."""

from typing import Any

import bpy
import pytest

import addon
from addon.blender import state
from addon.blender.inspector import levels, second, worst
from addon.blender.measure import comparing, cost_maps
from addon.blender.overlay import drawing as overlay
from addon.blender.overlay import picking, replaying
from addon.blender.read import sky
from addon.blender.render import viewport
from addon.blender.render.engine import ENGINE
from addon.blender.session import building, reports, trees
from addon.blender.settings import properties, signals
from addon.blender.ui import compat
from addon.core.base import native

HANDLERS = [h for h in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, h), list)]


def engines_of_panels() -> set[tuple[str, str]]:
    return {(p.__name__, e) for p in bpy.types.Panel.__subclasses__() for e in getattr(p, "COMPAT_ENGINES", ())}


def footprint() -> dict[str, object]:
    """Everything that a registration could leave behind."""
    return {
        "types": {name for name in dir(bpy.types) if "alfspace" in name.lower()},
        "subclasses": {
            c.__name__
            for base in (bpy.types.Panel, bpy.types.Operator, bpy.types.PropertyGroup, bpy.types.RenderEngine)
            for c in base.__subclasses__()
            if getattr(c, "is_registered", False) and c.__module__.startswith("addon")
        },
        "properties": {
            owner.__name__
            for owner in (bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Object)
            if hasattr(owner, "halfspace")
        },
        "engines": engines_of_panels(),
        "handlers": {h: len(getattr(bpy.app.handlers, h)) for h in HANDLERS},
        "states": [one.values for one in state._states.values()],
        "work": comparing._state.work,
        "drawing": list(overlay._handles),
        "popover": len(bpy.types.VIEW3D_PT_overlay.draw._draw_funcs)
        if hasattr(bpy.types.VIEW3D_PT_overlay.draw, "_draw_funcs")
        else 1,
        "timers": [bpy.app.timers.is_registered(look) for look in (building._tick, overlay._begin, viewport._tick)],
        "views": len(viewport._working),
        "listeners": [len(one._listeners) for one in (signals.look_changed, signals.range_changed, *building.FOLLOWED)],
        "skies": (len(sky._kept), len(sky._looks)),
    }


def begin_a_view_and_a_sky() -> None:
    """Threads and processes that a working 3D view and a finished sky leave to be ended."""
    view = viewport.Viewport()
    viewport._working.add(view)
    bpy.app.timers.register(viewport._tick, first_interval=3600)
    HELD.append(view)
    sky._kept["clear"] = sky.SkyError("not rendered")


SLOTS: tuple[state.Slot[Any], ...] = (
    trees.TREE,
    reports.REPORT,
    comparing.FOUND,
    cost_maps.KEPT,
    picking.RAY,
    replaying.STEPS,
    overlay.DRAWINGS,
    second.SECOND,
    second.PATHS,
    worst.FOUND,
    levels.MEASURED,
)
"""Everything that is kept of a scene."""


def keep_everything() -> None:
    for slot in SLOTS:
        slot.keep(bpy.context.scene, object())


HELD: list[viewport.Viewport] = []
"""The set of working views does not keep them alive."""


def test_three_rounds_leave_nothing_behind() -> None:
    addon.unregister()
    try:
        clean = footprint()
        assert not clean["types"]
        assert not clean["subclasses"]
        assert not clean["properties"]
        assert not any(engine == ENGINE for _, engine in engines_of_panels())
        for _ in range(3):
            addon.register()
            assert footprint()["properties"] == {"Scene", "ViewLayer"}
            bpy.context.scene.halfspace.overlay.show = True
            assert footprint()["drawing"] != clean["drawing"]
            begin_a_view_and_a_sky()
            keep_everything()
            assert all(footprint()[name] != clean[name] for name in ("timers", "views", "skies", "states"))
            addon.unregister()
            assert footprint() == clean
    finally:
        addon.register()


def test_another_file_frees_what_is_kept_of_scenes(scene: object) -> None:
    keep_everything()
    assert len([one for slot in SLOTS for one in slot.all()]) == len(SLOTS)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not [one for slot in SLOTS for one in slot.all()]


def test_panels_appear_and_unsupported_ones_do_not() -> None:
    listed = {panel for panel, engine in engines_of_panels() if engine == ENGINE}
    assert {"RENDER_PT_format", "DATA_PT_lens", "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture"} <= listed
    assert not listed & {"VIEWLAYER_PT_layer_passes", "RENDER_PT_freestyle", "DATA_PT_lightprobe"}
    # Blender's panel of lights shares its set of engines with the same panel in the editor of nodes.
    assert not listed & {"DATA_PT_light", "NODE_DATA_PT_light"}
    assert not listed & (compat.UNREAD | compat.REPLACED.keys())


def test_a_panel_that_shares_its_set_of_engines_shows_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender gives its panel of lights and that of the editor of nodes one set of engines."""
    compat.unregister(ENGINE)
    try:
        monkeypatch.setattr(compat, "REPLACED", {"DATA_PT_light": "HALFSPACE_PT_light"})
        compat.register(ENGINE)
        listed = {panel for panel, engine in engines_of_panels() if engine == ENGINE}
        assert "DATA_PT_light" not in listed
        assert not hasattr(bpy.types, "NODE_DATA_PT_light") or "NODE_DATA_PT_light" in listed
    finally:
        compat.unregister(ENGINE)
        monkeypatch.undo()
        compat.register(ENGINE)


def test_without_the_native_module_everything_registers_and_rendering_says_why(
    monkeypatch: pytest.MonkeyPatch, scene: object
) -> None:
    addon.unregister()

    def missing() -> None:
        raise native.NativeError("The native module of Halfspace cannot be loaded: gone")

    try:
        with monkeypatch.context() as patch:
            patch.setattr(native, "load", missing)
            addon.register()
            new = bpy.context.scene
            assert not hasattr(new.halfspace, "structure")
            assert new.halfspace.samples > 0
            new.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
            new.collection.objects.link(new.camera)
            new.render.engine = ENGINE
            new.render.resolution_x = new.render.resolution_y = 8
            with pytest.raises(RuntimeError, match="cannot be loaded: gone"):
                bpy.ops.render.render()
            addon.unregister()
    finally:
        addon.register()
    assert properties.spec(bpy.context.scene.halfspace) == "kd"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: every tab of the properties, and the sidebar, with all panels open.

Runs inside Blender, with the extension installed. `steps` is a generator for a driver: it yields seconds, in which
Blender draws, or the name of a picture of the screen. The names of the extension's panels that were drawn are written
as JSON to panel_steps.json in the folder of the pictures, `WINDOW_OUT`.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import addon_utils
import bpy
from window_areas import EXTENSION, area_of, window, within

OUT = Path(os.environ.get("WINDOW_OUT", "/job/out"))

TABS = {
    "RENDER": ("Cube",),
    "OUTPUT": ("Cube",),
    "VIEW_LAYER": ("Cube",),
    "SCENE": ("Cube",),
    "WORLD": ("Cube",),
    "OBJECT": ("Cube", "Light"),
    "MATERIAL": ("Cube",),
    "DATA": ("Cube", "Light", "Camera", "Sun", "Spot", "Area", "Panorama"),
}
"""Tabs of the properties, and the objects that are active while they are shown."""

LONG = {"RENDER", "OUTPUT"}
"""Tabs that are longer than the screen."""

PREVIEWED, PREVIEW_SECONDS = {"MATERIAL", "DATA", "WORLD"}, 4.0
"""Tabs with a preview, and the seconds in which Blender renders it."""

SECONDS = 0.8
"""Seconds in which Blender draws a tab."""

drawn: set[str] = set()
"""Names of the panels of the extension that were drawn."""


def panels_of(prefix: str) -> list[Any]:
    """The panels of the modules whose names begin with this, in the order of their registration."""
    found: dict[Any, None] = {}
    for name, module in list(sys.modules.items()):
        if name.startswith(prefix):
            for kind in (*getattr(module, "classes", ()), *getattr(module, "CLASSES", ())):
                if isinstance(kind, type) and issubclass(kind, bpy.types.Panel):
                    found[kind] = None
    return list(found)


def open_all() -> None:
    """Make every panel open at first, those of Blender and ours, and record which of ours are drawn.

    Blender reads whether a panel is closed when it is registered: all are registered again, in the same order.
    """
    addon_utils.disable(EXTENSION)
    blenders = [kind for kind in panels_of("bl_ui.") if kind.is_registered]
    for kind in reversed(blenders):
        bpy.utils.unregister_class(kind)
    ours = panels_of(EXTENSION)
    for kind in (*blenders, *ours):
        kind.bl_options = set(getattr(kind, "bl_options", set())) - {"DEFAULT_CLOSED"}
    for kind in blenders:
        bpy.utils.register_class(kind)
    for kind in ours:
        _record(kind)
    addon_utils.enable(EXTENSION)
    # Open the parts within panels, too.
    structure: Any = sys.modules[f"{EXTENSION}.blender.ui.structure"]
    draw = structure.draw
    structure.draw = lambda layout, group: draw(_Open(layout), group)


def _record(kind: Any) -> None:
    """Add the name of a panel to `drawn` after each drawing without an exception."""
    draw = kind.draw

    def recorded(self: Any, context: Any) -> None:
        draw(self, context)
        drawn.add(kind.__name__)

    kind.draw = recorded


class _Open:
    """A layout whose panels are open at first."""

    def __init__(self, layout: Any) -> None:
        object.__setattr__(self, "layout", layout)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.layout, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.layout, name, value)

    def panel(self, name: str, **_options: Any) -> Any:
        return self.layout.panel(name, default_closed=False)


def furnish() -> None:
    """Select the engine, add an object of each kind, and enable what panels depend on."""
    scene = bpy.context.scene
    scene.render.engine = "HALFSPACE"
    scene.render.use_motion_blur = True
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    for name, kind in (("Sun", "SUN"), ("Spot", "SPOT"), ("Area", "AREA")):
        light = bpy.data.lights.new(name, kind)
        light.energy = 1.0 if kind == "SUN" else 100.0
        item = bpy.data.objects.new(name, light)
        item.location = (2, 2, 4)
        scene.collection.objects.link(item)
    camera = bpy.data.cameras.new("Panorama")
    camera.type, camera.panorama_type = "PANO", "FISHEYE_LENS_POLYNOMIAL"
    scene.collection.objects.link(bpy.data.objects.new("Panorama", camera))
    scene.camera.data.dof.use_dof = True
    layer = scene.view_layers[0]
    layer.use_pass_mist = layer.use_pass_cryptomatte_object = True
    layer.aovs.add().name = "Value"
    layer.lightgroups.add(name="Lamps")
    scene.render.bake.use_selected_to_active = scene.render.bake.use_cage = True


def properties() -> Iterator[Any]:
    """Show each tab for each object in a new editor, as wide as that of the default file, whose panels are closed.

    The 3D view is replaced meanwhile: it takes longer to draw than all panels.
    """
    width, view = area_of("PROPERTIES").width, area_of("VIEW_3D")
    view.type = "CONSOLE"
    with within(view):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=width / view.width)
    area = min((area for area in window().screen.areas if area.type == "CONSOLE"), key=lambda area: area.width)
    area.type = "PROPERTIES"
    yield SECONDS
    for tab, names in TABS.items():
        for name in names:
            bpy.context.view_layer.objects.active = bpy.data.objects[name]
            yield 0.2
            area.spaces.active.context = tab
            area.tag_redraw()
            yield PREVIEW_SECONDS if tab in PREVIEWED else SECONDS
            yield f"{tab}-{name}".lower()
            if tab in LONG:
                with within(area):
                    to_the_end()
                yield SECONDS
                yield f"{tab}-{name}-end".lower()
    area_of("CONSOLE").type = "VIEW_3D"


def to_the_end() -> None:
    """Scroll the region of the context."""
    for _ in range(10):
        if bpy.ops.view2d.scroll_down.poll():
            bpy.ops.view2d.scroll_down(page=True)


def sidebar_of(area: Any) -> Any:
    """The region of an area's sidebar."""
    return next(region for region in area.regions if region.type == "UI")


def sidebar() -> Iterator[Any]:
    """Show the tab of the sidebar without a structure, and with one, its worst rays, its levels and a comparison."""
    area, settings = area_of("VIEW_3D"), bpy.context.scene.halfspace
    area.spaces.active.show_region_ui = True
    yield SECONDS
    sidebar_of(area).active_panel_category = "Halfspace"
    yield SECONDS
    yield "sidebar-empty"
    settings.overlay.show, settings.overlay.parts = True, {"PLANES", "CELLS"}
    yield 3.0  # the overlay builds a structure, which would replace that of the operators
    settings.second = "bvh-sah"
    for operator in ("build_structure", "check", "worst_ray", "measure_levels"):
        with within(area):
            getattr(bpy.ops.halfspace, operator)()
        yield 1.0
    settings.inspector.replaying, settings.inspector.step = True, 1
    yield SECONDS
    area.tag_redraw()
    yield SECONDS
    yield "sidebar-full"
    # Show the end of the sidebar.
    with bpy.context.temp_override(window=window(), area=area, region=sidebar_of(area)):
        to_the_end()
    yield SECONDS
    yield "sidebar-end"


def steps() -> Iterator[Any]:
    """Show all panels."""
    open_all()
    furnish()
    yield 0.5
    yield from properties()
    yield from sidebar()
    (OUT / "panel_steps.json").write_text(json.dumps(sorted(drawn)), encoding="utf-8")

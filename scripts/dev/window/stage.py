# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage of the animations: the built-in scene in a large 3D view, with chosen panels in its sidebar.

A frame is a picture of the screen. `Film.write` lists the frames with their durations, and the part of the screen that
the 3D view covers, as JSON for `scripts/dev/animations.py`.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector
from window_areas import EXTENSION, area_of, window, within

OUT = Path(os.environ.get("WINDOW_OUT", "/job/out"))

SETTLE = 0.35
"""Seconds in which Blender draws a frame."""

LONGEST = 240.0
"""Seconds after which a job counts as hanging."""

VIEW = ((-2.7, -8.6, 5.0), (0.3, 0.4, 0.8))
"""Eye and target from which the whole scene is seen."""

PANELS = ("overlay_panels", "inspector_panels", "compare_panels")
"""Modules of the panels of the sidebar."""


def part(name: str) -> Any:
    """A module of the installed extension."""
    return importlib.import_module(f"{EXTENSION}.{name}")


class Film:
    """The frames of an animation, in their order."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.frames: list[tuple[str, int]] = []

    def frame(self, milliseconds: int) -> Iterator[Any]:
        """Let Blender draw, and take a picture that is shown for some time."""
        area_of("VIEW_3D").tag_redraw()
        yield SETTLE
        name = f"{self.name}-{len(self.frames):03}"
        yield name
        self.frames.append((name, milliseconds))

    def write(self) -> None:
        """Write the list of the frames to NAME.json."""
        area = area_of("VIEW_3D")
        box = (area.x, window().height - area.y - area.height, area.x + area.width, window().height - area.y)
        text = json.dumps({"box": box, "frames": self.frames})
        (OUT / f"{self.name}.json").write_text(text, encoding="utf-8")


def furnish(opened: Collection[str], hidden: Collection[str] = ()) -> Iterator[Any]:
    """Show the built-in scene through its camera in one large 3D view, with the extension's tab of the sidebar.

    opened: names of the panels that are open; all others are closed, and those of `hidden` are not shown.
    """
    # Blender reads whether a panel is closed when it is registered.
    for module in PANELS:
        for kind in part(f"blender.ui.{module}").CLASSES:
            bpy.utils.unregister_class(kind)
            kind.bl_options = set() if kind.__name__ in opened else {"DEFAULT_CLOSED"}
            if kind.__name__ in hidden:
                kind.poll = classmethod(lambda _kind, _context: False)
            bpy.utils.register_class(kind)
    with within(area_of("VIEW_3D")):
        bpy.ops.halfspace.showcase()
        bpy.ops.screen.screen_full_area()
    yield 1.0
    area = area_of("VIEW_3D")
    space = area.spaces.active
    space.show_region_ui, space.show_region_toolbar, space.show_region_header = True, False, False
    space.show_gizmo, space.shading.type = False, "SOLID"
    yield 1.0
    next(region for region in area.regions if region.type == "UI").active_panel_category = "Halfspace"
    # Show nothing but the scene and the structure.
    shown = space.overlay
    shown.show_floor = shown.show_axis_x = shown.show_axis_y = shown.show_cursor = False
    shown.show_object_origins = shown.show_extras = shown.show_relationship_lines = shown.show_text = False
    space.shading.color_type, space.shading.single_color = "SINGLE", (0.5, 0.5, 0.5)
    for item in bpy.context.scene.objects:
        item.select_set(False)
    yield 0.5


def look(eye: Any, target: Any) -> None:
    """Look from a point at another one, which appears in the middle of what the sidebar leaves free."""
    area = area_of("VIEW_3D")
    space, towards = area.spaces.active, Vector(target) - Vector(eye)
    sidebar = next(region for region in area.regions if region.type == "UI")
    view = space.region_3d
    view.view_perspective = "PERSP"
    view.view_rotation = towards.to_track_quat("-Z", "Y")
    # A lens of 36 mm reaches as far as half the view is wide.
    across = view.view_rotation @ Vector((1.0, 0.0, 0.0))
    aside = towards.length * 36.0 / space.lens * sidebar.width / area.width
    view.view_location, view.view_distance = Vector(target) + across * aside, towards.length


def built() -> Iterator[Any]:
    """Wait until no structure is being built, and the chosen one is there. Raises RuntimeError after LONGEST."""
    trees, properties = part("blender.session.trees"), part("blender.settings.properties")
    building, scene, start = part("blender.session.building"), bpy.context.scene, time.perf_counter()
    while True:
        yield 0.3
        tree = trees.last(scene)
        if building.progress() is None and tree is not None and tree.spec == properties.spec(scene.halfspace):
            return
        if time.perf_counter() > start + LONGEST:
            raise RuntimeError("the structure was not built")


def point(x: float, y: float) -> None:
    """Move the pointer to a place of the 3D view, as shares of its width and height from the lower left corner."""
    area = area_of("VIEW_3D")
    place = area.x + x * area.width, window().height - area.y - y * area.height
    subprocess.run(["xdotool", "mousemove", *(str(round(value)) for value in place)], check=True)


def click() -> None:
    """Press the left button where the pointer is."""
    subprocess.run(["xdotool", "click", "1"], check=True)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons as .blend files: scene, settings, two texts, the questions and the answers, and windows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ... import register
from ...blender.settings import presets
from ...blender.ui import sidebar
from ..pictures import stage
from . import pages
from .lessons import Lesson

SAMPLES, SIZE = 16, (960, 600)
"""Samples per pixel and pixels of a lesson's picture: seconds on a laptop."""

TEXT_SHARE = 0.33
"""Share of the 3D view's width that the questions take."""

CAMERA_ZOOM, CAMERA_OFFSET = 6.0, 0.19
"""Zoom and offset of the camera's view: its frame is next to the sidebar, in a window of 1280 × 720 pixels too."""


def save(lesson: Lesson, folder: Path) -> Path:
    """Write `NAME.blend` of a lesson into a folder, replacing an older one. Returns its path.

    Raises RuntimeError if Blender cannot write it, and OSError if the lesson's page is missing.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene: Any = bpy.context.scene
    if not hasattr(scene, "halfspace"):
        register()
    stage.build(scene, lesson.scene())
    scene.name = lesson.title
    # Set the engine, the structure and what the overlay shows.
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    group = scene.halfspace
    presets.apply(group, lesson.structures[0])
    group.automatic, group.samples = False, SAMPLES
    overlay = group.overlay
    overlay.parts, overlay.show = set(lesson.parts), True
    overlay.depth_max, overlay.depth_min = lesson.depth[1], lesson.depth[0]
    # Add the questions, which Blender's text editor shows, and the answers, which a teacher may delete.
    asked = [f"{n}. {question}" for n, question in enumerate(lesson.questions, 1)]
    answered = [f"{n}. {answer}\n" for n, answer in enumerate(pages.answers(lesson.name), 1)]
    do, see = lesson.first
    first = [f"Do: {do}", "", f"See: {see}"]
    compared = f"Compare: {', '.join(lesson.structures)}"
    questions = _write("Questions", [lesson.title, "", *first, "", compared, "", *("\n\n".join(asked)).split("\n")])
    _write("Answers", [lesson.title, "", *answered])
    _arrange(questions)
    path = folder / f"{lesson.name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, check_existing=False)
    return path


def _write(name: str, lines: list[str]) -> Any:
    """Add a text to the file and return it."""
    text: Any = bpy.data.texts.new(name)
    text.write("\n".join(lines) + "\n")
    text.cursor_set(0)
    return text


def _arrange(questions: Any) -> None:
    """Open the questions on the left of the 3D view, and in it the camera's view and the sidebar at our tab."""
    window = bpy.context.window
    assert window is not None, "Blender as a module has one"
    screen: Any = window.screen
    (view,) = (area for area in screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(window=window, screen=screen, area=view):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=TEXT_SHARE)
    view, left = (area for area in screen.areas if area.type == "VIEW_3D")
    left.ui_type = "TEXT_EDITOR"
    editor = left.spaces.active
    editor.text, editor.show_word_wrap = questions, True
    editor.show_line_numbers = editor.show_syntax_highlight = False
    # Show what the camera sees, without the helpers of modelling.
    space = view.spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.region_3d.view_camera_zoom, space.region_3d.view_camera_offset = CAMERA_ZOOM, (CAMERA_OFFSET, 0.0)
    space.show_region_ui, space.show_region_toolbar, space.show_gizmo = True, False, False
    for helper in ("show_floor", "show_axis_x", "show_axis_y", "show_cursor", "show_extras"):
        setattr(space.overlay, helper, False)
    screen[sidebar.TAB] = True
    for area in screen.areas:
        if area.type == "PROPERTIES":
            area.spaces.active.context = "RENDER"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons as .blend files: scene, settings, and two texts, the questions and the answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ... import register
from ...blender.settings import presets
from ..pictures import stage
from . import pages
from .lessons import Lesson

SAMPLES, SIZE = 16, (960, 600)
"""Samples per pixel and pixels of a lesson's picture: seconds on a laptop."""


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
    _write("Questions", [lesson.title, "", f"Compare: {', '.join(lesson.structures)}", "", *asked])
    _write("Answers", [lesson.title, "", *answered])
    path = folder / f"{lesson.name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, check_existing=False)
    return path


def _write(name: str, lines: list[str]) -> None:
    """Add a text to the file."""
    bpy.data.texts.new(name).write("\n".join(lines) + "\n")

# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons as .blend files: small, with scene, structure, overlay, questions and answers as on their pages."""

import re
from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.blender.session import trees
from addon.blender.settings import presets, properties
from addon.blender.ui import sidebar
from addon.lab.lessons import files, lessons, pages

LARGEST = 250_000
"""Bytes of a file."""


@pytest.mark.parametrize("lesson", lessons.LESSONS, ids=lambda lesson: lesson.name)
def test_a_file_opens_with_what_its_lesson_needs(lesson: lessons.Lesson, tmp_path: Path) -> None:
    path = files.save(lesson, tmp_path)
    assert path.stat().st_size < LARGEST
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene: Any = bpy.context.scene
    group = scene.halfspace
    assert (scene.name, scene.render.engine) == (lesson.title, "HALFSPACE")
    assert properties.spec(group) == lesson.structures[0]
    assert (group.overlay.depth_min, group.overlay.depth_max) == lesson.depth
    assert group.overlay.show
    assert group.overlay.parts == set(lesson.parts)
    written = bpy.data.texts["Questions"].as_string()
    assert all(question in written for question in lesson.questions)
    assert all(words in written for words in lesson.first)
    _opens_on_its_lesson()
    answers = bpy.data.texts["Answers"].as_string()
    assert all(f"\n{number}. " in answers for number in range(1, len(lesson.questions) + 1))
    assert not set("`*<[") & set(answers), "marks of Markdown"
    page = (pages.PAGES / f"{lesson.name}.md").read_text(encoding="utf-8")
    for words in re.findall(r"<summary>Answer</summary>\s+(\w+(?: \w+){2})", page):
        assert words in answers
    (mesh,) = (item.data for item in scene.objects if item.type == "MESH")
    assert len(mesh.polygons) == len(lesson.scene().triangles)
    for structure in lesson.structures:
        presets.apply(group, structure)
        assert properties.spec(group) == structure
    scene.render.resolution_percentage, group.samples = 3, 1
    bpy.ops.render.render()


def _opens_on_its_lesson() -> None:
    """Questions on the left, the camera's view with an open sidebar next to them, properties of the render."""
    screen: Any = bpy.context.screen
    areas = {area.type: area for area in screen.areas}
    editor, view = areas["TEXT_EDITOR"], areas["VIEW_3D"]
    assert editor.x < view.x
    assert 400 < editor.width < view.width
    assert editor.spaces.active.text == bpy.data.texts["Questions"]
    assert editor.spaces.active.show_word_wrap
    assert not editor.spaces.active.show_syntax_highlight, "questions are no program"
    assert editor.spaces.active.text.current_line_index == 0
    assert view.spaces.active.region_3d.view_perspective == "CAMERA"
    assert view.spaces.active.show_region_ui
    assert view.spaces.active.region_3d.view_camera_offset[0] > 0.1, "the scene is behind the sidebar"
    assert areas["PROPERTIES"].spaces.active.context == "RENDER"
    assert screen[sidebar.TAB]


def test_the_lesson_on_rounding_shows_wrong_answers_in_blender(tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(files.save(lessons.BY_NAME["5-rounding"], tmp_path)))
    scene: Any = bpy.context.scene
    wrong = []
    for robust in ("widen", "none"):
        scene.halfspace.robust = robust
        bpy.ops.halfspace.check()
        tree = trees.last(scene)
        assert tree is not None
        assert tree.check is not None
        assert tree.check.errors.rays == 16_384
        wrong.append(tree.check.errors.wrong)
    assert wrong[0] == 0
    assert wrong[1] > 2_000


def test_a_table_of_an_answer_keeps_its_columns() -> None:
    (_, _, third) = pages.answers("1-split")
    assert "| kd-median | 731 | 15.3 | 9.0 |" in third
    assert "---" not in third
    (_, _, third) = pages.answers("5-rounding")
    assert "See correctness." in " ".join(third.split())
    assert third.count("this child cannot contain the hit") == 1

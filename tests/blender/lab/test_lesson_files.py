# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons as .blend files: small, with scene, structure, overlay, questions and answers as on their pages."""

import re
from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.blender.settings import presets, properties
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


def test_a_table_of_an_answer_keeps_its_columns() -> None:
    (_, _, third) = pages.answers("1-split")
    assert "| kd-median | 731 | 15.3 | 9.0 |" in third
    assert "---" not in third
    (_, _, third) = pages.answers("5-rounding")
    assert "See correctness." in third
    assert third.count("this child cannot contain the hit") == 1

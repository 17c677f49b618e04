# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual behind each panel's question mark, in Blender's text editor: the add-on never uses the network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

ADDON = Path(__file__).resolve().parents[2]
PLACES = (ADDON / "manual.md", ADDON.parent / "docs" / "manual.md")
"""In the installed extension, and in the repository."""

TEXT = "Halfspace Manual"


def manual() -> str:
    """The text of the manual. Raises FileNotFoundError."""
    place = next((place for place in PLACES if place.is_file()), None)
    if place is None:
        raise FileNotFoundError("the manual is not part of this installation")
    return place.read_text(encoding="utf-8")


def line_of(text: str, section: str) -> int:
    """The line, from 0, of a section's heading; 0 without a section. Raises KeyError."""
    if not section:
        return 0
    for number, line in enumerate(text.splitlines()):
        if line.startswith("#") and line.lstrip("#").strip() == section:
            return number
    raise KeyError(section)


class HALFSPACE_OT_manual(bpy.types.Operator):
    """Opens a section of the manual."""

    bl_idname = "halfspace.manual"
    bl_label = "Read About This"
    bl_description = "Open the manual at this subject, in a text editor"
    bl_options = {"REGISTER", "UNDO"}

    section: StringProperty(name="Section", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    def execute(self, context: Any) -> set[str]:
        try:
            content = manual()
            line = line_of(content, self.section)
        except (OSError, KeyError) as error:
            self.report({"ERROR"}, f"Cannot open the manual: {error}")
            return {"CANCELLED"}
        text = bpy.data.texts.get(TEXT) or bpy.data.texts.new(TEXT)
        text.use_fake_user = False  # the text is freed when closed, and is not part of the user's file
        text.from_string(content)
        text.cursor_set(line)
        if context.window is not None:
            _show(context, text, line)
        return {"FINISHED"}


def _show(context: Any, text: Any, line: int) -> None:
    """Show the text in a text editor of this window, or of a new one."""
    area = next((area for area in context.window.screen.areas if area.type == "TEXT_EDITOR"), None)
    if area is None:
        if not bpy.ops.wm.window_new.poll():
            return  # without windows, the text block is the result
        bpy.ops.wm.window_new()
        area = context.window_manager.windows[-1].screen.areas[0]
        area.type = "TEXT_EDITOR"
    space = area.spaces.active
    space.text, space.top = text, line
    space.show_word_wrap, space.show_syntax_highlight = True, False  # it is prose


CLASSES = (HALFSPACE_OT_manual,)

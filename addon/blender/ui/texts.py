# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of panels, broken into lines by the width of Blender's own letters."""

from __future__ import annotations

import re
from typing import Any

import blf
import bpy

NARROW = 245
"""Width of the properties at Blender's default layout, without interface scale; the sidebar is wider."""

MARGINS = 50
"""Pixels of a region next to the text of its panels, boxes included."""

TABS = 24
"""Pixels of the tabs next to a sidebar, which are part of its region."""

ICON = 26
"""Pixels of an icon."""

LETTERS = 11.0
"""Size of the letters of labels, in pixels without interface scale."""


def wide(text: str) -> float:
    """Width of a label in pixels without interface scale."""
    blf.size(0, LETTERS)
    return float(blf.dimensions(0, text)[0])


def counted(number: int, one: str, many: str = "") -> str:
    """A number with its noun."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def wrapped(layout: Any, text: str, *, icon: str = "NONE") -> None:
    """Draw a text as labels that fit into the region, because labels do not wrap."""
    room = _room() - MARGINS - (ICON if icon != "NONE" else 0)
    line = ""
    for word in (part for whole in text.split() for part in _parts(whole, room)):
        if line and wide(f"{line} {word}") > room:
            layout.label(text=line, icon=icon)
            line, icon = word, "BLANK1" if icon != "NONE" else "NONE"
        else:
            line = f"{line} {word}".strip()
    layout.label(text=line, icon=icon)


def _parts(word: str, room: float) -> list[str]:
    """A word in parts that fit, cut after the separators of specifications; as it is where it fits."""
    if wide(word) <= room:
        return [word]
    parts = [""]
    for piece in re.split(r"(?<=[,:=/])", word):
        if parts[-1] and wide(parts[-1] + piece) > room:
            parts.append("")
        parts[-1] += piece
    return parts


def fold(layout: Any, key: str, title: str) -> Any:
    """Add a part that is closed at first. Returns its layout; None while it is closed."""
    header, body = layout.panel(f"HALFSPACE_{key}", default_closed=True)
    header.label(text=title)
    return body


def _room() -> float:
    """Width of the region that is being drawn, in pixels without interface scale."""
    region = bpy.context.region
    if region is None:
        return NARROW
    width = region.width / bpy.context.preferences.system.ui_scale
    return float(width - TABS if region.type == "UI" else width)

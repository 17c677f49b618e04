# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab of 3D views' sidebars, which a screen of a file may ask to have in front when the file is loaded.

Blender stores the tab in front only after a window has drawn it, so files that are written without one, such as the
lessons, mark their screen.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy

from ..settings import signals

NAME = "Halfspace"

TAB = "halfspace_tab"
"""Custom property of a screen whose sidebars shall have the tab in front."""

AGAIN, MOST = 0.2, 50
"""Seconds between attempts, and their number: a tab exists once its sidebar was drawn."""


def bring_to_front(screens: Iterable[Any]) -> bool:
    """Bring the tab to the front in the marked screens, and remove their marks. Returns whether none is left."""
    waiting = False
    for screen in screens:
        if not screen.get(TAB):
            continue
        sidebars = [r for area in screen.areas if area.type == "VIEW_3D" for r in area.regions if r.type == "UI"]
        try:
            for region in sidebars:
                region.active_panel_category = NAME
        except (AttributeError, TypeError):  # not drawn yet
            waiting = True
        else:
            del screen[TAB]
    return not waiting


def _file_loaded(_scene: Any) -> None:
    """Try until the sidebars of the windows are drawn."""
    left = MOST

    def attempt() -> float | None:
        nonlocal left
        left -= 1
        shown = [window.screen for window in bpy.context.window_manager.windows]
        return None if bring_to_front(shown) or not left else AGAIN

    if not bpy.app.background and any(screen.get(TAB) for screen in bpy.data.screens):
        bpy.app.timers.register(attempt, first_interval=AGAIN)


def register() -> None:
    """Listen for loaded files."""
    signals.file_loaded.connect(_file_loaded)


def unregister() -> None:
    """Undo `register`."""
    signals.file_loaded.disconnect(_file_loaded)

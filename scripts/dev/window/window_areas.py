# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows and areas, for the steps in a real window."""

from __future__ import annotations

from typing import Any

import bpy

EXTENSION = "bl_ext.user_default.halfspace"
"""Module of the installed extension."""


def window() -> Any:
    """The first window."""
    return bpy.context.window_manager.windows[0]


def area_of(kind: str) -> Any:
    """The largest area of this kind in the first window."""
    areas = [area for area in window().screen.areas if area.type == kind]
    return max(areas, key=lambda area: area.width * area.height)


def within(area: Any) -> Any:
    """A context manager: operators in it work as if a user started them in this area."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window(), area=area, region=region)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Histograms of the last cost maps as icons that panels show over the sliders of their range."""

from __future__ import annotations

from typing import Any

import bpy.utils.previews

from ...core.inspector import histogram

SIDE, SCALE = 128, 6.0
"""Width and height of an icon in pixels, and on a panel in units of its rows."""

_icons: Any = None
_drawn: dict[str, tuple[Any, ...]] = {}
"""By the name of an icon: what it shows."""


def draw(layout: Any, number: int, values: Any, scale: tuple[float, float, float]) -> None:
    """Show the histogram of the map of this number. scale: the ends of its range, and of its scale."""
    if _icons is not None:
        layout.template_icon(icon_value=_icon(f"map {number}", values, scale), scale=SCALE)


def _icon(name: str, values: Any, scale: tuple[float, float, float]) -> int:
    """The number of the icon of this name, drawn again if the map or the range has changed."""
    made = _icons.get(name) or _icons.new(name)
    if _drawn.get(name) != (id(values), *scale):
        made.image_size = (SIDE, SIDE)
        made.image_pixels_float.foreach_set(histogram.icon(values, *scale, SIDE).reshape(-1))
        _drawn[name] = (id(values), *scale)
    return int(made.icon_id)


def register() -> None:
    """Make room for the icons."""
    global _icons  # noqa: PLW0603 (one collection per Blender)
    _icons = bpy.utils.previews.new()


def unregister() -> None:
    """Undo `register`, and free the icons."""
    global _icons  # noqa: PLW0603
    bpy.utils.previews.remove(_icons)
    _icons = None
    _drawn.clear()

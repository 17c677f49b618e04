# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility of Blender's own panels for this engine: their classes list the engines that they appear for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

MODEL = "BLENDER_RENDER"
"""Panels for the most general engine also suit ours, except those of unsupported settings."""

EXCLUDED = {
    "DATA_PT_light",
    "NODE_DATA_PT_light",
    "RENDER_PT_freestyle",
    "RENDER_PT_gpencil",
    "RENDER_PT_simplify_greasepencil",
    "RENDER_PT_stereoscopy",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_override",
}


def _panels() -> Iterator[Any]:
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if MODEL in engines and panel.__name__ not in EXCLUDED:
            yield panel


def register(engine: str) -> None:
    """Make Blender's panels appear for `engine`.

    Each gets a set of its own: some of Blender's panels share one, also with panels of EXCLUDED.
    """
    for panel in _panels():
        panel.COMPAT_ENGINES = {*panel.COMPAT_ENGINES, engine}


def unregister(engine: str) -> None:
    """Remove `engine` from every panel that lists it."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if isinstance(engines, set) and engine in engines:
            panel.COMPAT_ENGINES = engines - {engine}

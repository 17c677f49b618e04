# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that touches Blender. Registers in one order, and unregisters in the reverse order."""

from typing import Any

import bpy

from . import state
from .inspector import browsing, exporting, isolating, levels, map_cursor, second, worst
from .measure import checking, compare_operators, cost_maps
from .overlay import drawing, picking
from .read import sky
from .render import engine, reading, running, viewport
from .samples import arrays, operators
from .session import building, unpacking
from .settings import from_cycles, inspector_settings, overlay_settings, presets, properties
from .ui import (
    bake_panels,
    compare_panels,
    compat,
    data_panels,
    histogram_icons,
    inspector_panels,
    manual,
    overlay_panels,
    panels,
    pass_panels,
    sidebar,
    structure,
)

MODULES: tuple[Any, ...] = (
    *(
        state,
        overlay_settings,
        inspector_settings,
        properties,
        operators,
        arrays,
        building,
        manual,
        presets,
        from_cycles,
    ),
    *(checking, picking, cost_maps, compare_operators),
    *(browsing, isolating, second, worst, levels, map_cursor, exporting),
    *(structure, panels, data_panels, pass_panels, bake_panels, overlay_panels),
    *(histogram_icons, inspector_panels, compare_panels, drawing, reading, sidebar),
)
"""Registered modules, in their order: settings before the panels that show them. Each module may have `CLASSES`, and
functions `register` and `unregister` for everything else.
"""


def register() -> None:
    """Register all modules, then the engine, then Blender's own panels for it."""
    unpacking.ensure(__package__.rpartition(".")[0])
    running.start()
    for module in MODULES:
        for kind in getattr(module, "CLASSES", ()):
            bpy.utils.register_class(kind)
        if hasattr(module, "register"):
            module.register()
    bpy.utils.register_class(engine.HalfspaceEngine)
    compat.register(engine.ENGINE)


def unregister() -> None:
    """Undo `register` in reverse order, after the end of all renders: they need classes and settings."""
    running.stop()
    compat.unregister(engine.ENGINE)
    bpy.utils.unregister_class(engine.HalfspaceEngine)
    viewport.stop()
    sky.stop()
    for module in reversed(MODULES):
        if hasattr(module, "unregister"):
            module.unregister()
        for kind in reversed(getattr(module, "CLASSES", ())):
            bpy.utils.unregister_class(kind)

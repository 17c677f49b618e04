# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that touches Blender. Registers in one order, and unregisters in the reverse order."""

import bpy

from .measure import checking, compare_operators, cost_maps
from .overlay import drawing, picking
from .read import sky
from .render import engine, running, viewport
from .samples import operators
from .session import building, reports
from .settings import overlay_settings, presets, properties
from .ui import compare_panels, compat, data_panels, manual, overlay_panels, panels, structure


def register() -> None:
    """Register settings first, then the panels that show them, then the engine, then Blender's own panels for it."""
    running.start()
    overlay_settings.register()
    properties.register()
    operators.register()
    building.register()
    manual.register()
    presets.register()
    checking.register()
    picking.register()
    cost_maps.register()
    compare_operators.register()
    structure.register()
    panels.register()
    data_panels.register()
    overlay_panels.register()
    compare_panels.register()
    drawing.register()
    bpy.utils.register_class(engine.HalfspaceEngine)
    compat.register(engine.ENGINE)


def unregister() -> None:
    """Undo `register` in reverse order, after the end of all renders: they need classes and settings."""
    running.stop()
    compat.unregister(engine.ENGINE)
    bpy.utils.unregister_class(engine.HalfspaceEngine)
    viewport.stop()
    sky.stop()
    drawing.unregister()
    compare_panels.unregister()
    overlay_panels.unregister()
    data_panels.unregister()
    panels.unregister()
    structure.unregister()
    compare_operators.unregister()
    cost_maps.unregister()
    picking.unregister()
    checking.unregister()
    presets.unregister()
    manual.unregister()
    building.unregister()
    operators.unregister()
    properties.unregister()
    overlay_settings.unregister()
    reports.clear()

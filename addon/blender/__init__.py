# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that touches Blender. Registers in one order, and unregisters in the reverse order."""

import bpy

from . import (
    building,
    checking,
    compare_operators,
    compare_panels,
    compat,
    cost_maps,
    engine,
    manual,
    operators,
    overlay,
    overlay_panels,
    overlay_settings,
    panels,
    picking,
    presets,
    properties,
    reports,
    sky,
    viewport,
)


def register() -> None:
    """Register settings first, then the panels that show them, then the engine, then Blender's own panels for it."""
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
    panels.register()
    overlay_panels.register()
    compare_panels.register()
    overlay.register()
    bpy.utils.register_class(engine.HalfspaceEngine)
    compat.register(engine.ENGINE)


def unregister() -> None:
    """Undo `register` in reverse order."""
    compat.unregister(engine.ENGINE)
    bpy.utils.unregister_class(engine.HalfspaceEngine)
    viewport.stop()
    sky.stop()
    overlay.unregister()
    compare_panels.unregister()
    overlay_panels.unregister()
    panels.unregister()
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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that touches Blender. Registers in one order, and unregisters in the reverse order."""

import bpy

from . import state
from .inspector import browsing, exporting, isolating, levels, map_cursor, second, worst
from .measure import checking, compare_operators, cost_maps
from .overlay import drawing, picking
from .read import sky
from .render import engine, running, viewport
from .samples import arrays, operators
from .session import building, unpacking
from .settings import inspector_settings, overlay_settings, presets, properties
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
    structure,
)


def register() -> None:
    """Register settings first, then the panels that show them, then the engine, then Blender's own panels for it."""
    unpacking.ensure(__package__.rpartition(".")[0])
    running.start()
    state.register()
    overlay_settings.register()
    inspector_settings.register()
    properties.register()
    operators.register()
    arrays.register()
    building.register()
    manual.register()
    presets.register()
    checking.register()
    picking.register()
    cost_maps.register()
    compare_operators.register()
    for operators_of in (browsing, isolating, second, worst, levels, map_cursor, exporting):
        operators_of.register()
    structure.register()
    panels.register()
    data_panels.register()
    pass_panels.register()
    bake_panels.register()
    overlay_panels.register()
    histogram_icons.register()
    inspector_panels.register()
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
    inspector_panels.unregister()
    histogram_icons.unregister()
    overlay_panels.unregister()
    bake_panels.unregister()
    pass_panels.unregister()
    data_panels.unregister()
    panels.unregister()
    structure.unregister()
    for operators_of in (exporting, map_cursor, levels, worst, second, isolating, browsing):
        operators_of.unregister()
    compare_operators.unregister()
    cost_maps.unregister()
    picking.unregister()
    checking.unregister()
    presets.unregister()
    manual.unregister()
    building.unregister()
    arrays.unregister()
    operators.unregister()
    properties.unregister()
    inspector_settings.unregister()
    overlay_settings.unregister()
    state.unregister()

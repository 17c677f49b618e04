# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that touches Blender. Registration in one order, and back in the reverse order."""

import bpy

from . import compat, engine, operators, panels, properties, reports


def register() -> None:
    """Settings first, then what shows them, then the engine, then Blender's own panels for it."""
    properties.register()
    operators.register()
    panels.register()
    bpy.utils.register_class(engine.HalfspaceEngine)
    compat.register(engine.ENGINE)


def unregister() -> None:
    """The reverse of `register`."""
    compat.unregister(engine.ENGINE)
    bpy.utils.unregister_class(engine.HalfspaceEngine)
    panels.unregister()
    operators.unregister()
    properties.unregister()
    reports.clear()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace, a render engine for Blender whose acceleration structure is a choice.

`core` works without Blender; `blender` is the only part that imports bpy, and is imported only on registration.
"""


def register() -> None:
    """Add the engine, its settings and its panels to Blender."""
    from . import blender

    blender.register()


def unregister() -> None:
    """Take away everything that `register` added."""
    from . import blender

    blender.unregister()

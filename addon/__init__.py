# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace, a render engine for Blender whose acceleration structure is a choice.

`core` works without Blender; `refusal` and `blender` are the only parts that import bpy, and only on registration.
"""


def register() -> None:
    """Add the engine, its settings and its panels to Blender, or the reason why this Blender cannot have them."""
    from . import refusal

    if refusal.refused(__package__):
        return
    from . import blender

    blender.register()


def unregister() -> None:
    """Take away everything that `register` added."""
    from . import refusal

    if refusal.taken_back():
        return
    from . import blender

    blender.unregister()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Reasons not to register in this Blender: it is too old, or another copy of the extension is enabled in it.

The reason is one sentence, printed once and drawn in the extension's preferences; nothing else is registered. This
module imports nothing of the extension, so that every Blender with extensions can read it.
"""

from __future__ import annotations

import sys
from typing import Any

import bpy

OLDEST = (4, 5, 0)
"""`blender_version_min` of the manifest. Blender checks it on installation, and not for a folder copied by hand."""

ENGINE = "HALFSPACE"

_shown: list[Any] = []
"""The registered preferences with the reason, at most one."""


def reason(package: str) -> str | None:
    """Why the extension in this package must not register, in one sentence; None if it may."""
    if bpy.app.version < OLDEST:
        oldest, here = (".".join(map(str, version)) for version in (OLDEST[:2], bpy.app.version))
        return f"Halfspace needs Blender {oldest} or newer, and this is Blender {here}"
    registered = [kind for kind in bpy.types.RenderEngine.__subclasses__() if kind.is_registered]
    for other in (kind.__module__ for kind in registered if getattr(kind, "bl_idname", "") == ENGINE):
        if not other.startswith(f"{package}."):
            copy = other.partition(".blender.")[0]
            return f"Another copy of Halfspace is enabled ({copy}): disable one of the two, then enable the other again"
    return None


def refused(package: str) -> bool:
    """Whether the extension must not register; its preferences then show why."""
    text = reason(package)
    if text is None:
        return False
    print(f"Halfspace: {text}", file=sys.stderr)

    def draw(self: Any, _context: Any) -> None:
        self.layout.label(text=text, icon="ERROR")

    kind = type("HALFSPACE_AP_refusal", (bpy.types.AddonPreferences,), {"bl_idname": package, "draw": draw})
    bpy.utils.register_class(kind)
    _shown.append(kind)
    return True


def taken_back() -> bool:
    """Whether only a reason was registered, which is unregistered now."""
    if not _shown:
        return False
    bpy.utils.unregister_class(_shown.pop())
    return True

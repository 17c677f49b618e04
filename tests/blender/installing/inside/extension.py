# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of a user with the extension zip."""

from typing import Any

import bpy
from in_session import NAME, addon_utils, attempt, install, native, open_scene, render, traces, user_folder


def first_use(archive: str) -> dict[str, Any]:
    """Install, render, disable, enable, render."""
    found: dict[str, Any] = {"before": traces(), "reported": install(archive), "enabled": addon_utils.check(NAME)}
    found["native"] = native().__file__
    open_scene()
    found["with"] = traces()
    found["first"] = render()
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.preferences.addon_disable(module=NAME)
    found["disabled"] = addon_utils.check(NAME)
    found["after"] = traces()
    bpy.ops.preferences.addon_enable(module=NAME)
    found["again"] = addon_utils.check(NAME)
    found["with_again"] = traces()
    open_scene()
    found["second"] = render()
    return found


def read_only(archive: str, picture: str) -> dict[str, Any]:
    """Steps that work or are refused where nothing can be written but the picture; the extension is installed."""
    try:
        (user_folder() / "probe").touch()
        return {"writable": True}
    except OSError:
        pass
    addon_utils.enable(NAME, default_set=True)
    open_scene()
    found: dict[str, Any] = {"writable": False, "enabled": addon_utils.check(NAME), "picture": render(path=picture)}
    found["preset"] = attempt(bpy.ops.halfspace.preset_add, name="mine")
    found["install"] = install(archive)
    # Blender disables an extension before it replaces it, and leaves it so where that fails.
    addon_utils.enable(NAME, default_set=True)
    found["still"] = render(path=picture)
    return found

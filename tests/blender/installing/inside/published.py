# SPDX-License-Identifier: GPL-3.0-or-later
"""A user gets the extension from a repository on the network: adds it, installs, updates, removes."""

from typing import Any

import bpy
from in_session import addon_utils, attempt, open_scene, render, unpacked

REPOSITORY = "published"
NAME = f"bl_ext.{REPOSITORY}.halfspace"


def _index() -> int:
    """The number of the repository in the preferences."""
    return [one.module for one in bpy.context.preferences.extensions.repos].index(REPOSITORY)


def _state(*errors: str) -> dict[str, Any]:
    """What the user has after these steps, whose errors are given; the preferences are saved."""
    kinds = [kind for kind in bpy.types.RenderEngine.__subclasses__() if kind.is_registered]
    found: dict[str, Any] = {
        "reported": [error for error in errors if error],
        "enabled": addon_utils.check(NAME),
        "engine": [kind.bl_label for kind in kinds if getattr(kind, "bl_idname", "") == "HALFSPACE"],
        "unpacked": [name for name in unpacked() if not name.endswith(".dist-info")],
    }
    open_scene()
    if found["engine"]:
        found["picture"] = render()
    bpy.ops.wm.save_userpref()
    return found


def _online() -> None:
    """Start as the user's Blender does, with the network allowed."""
    bpy.ops.wm.read_userpref()
    bpy.context.preferences.system.use_online_access = True


def install(url: str) -> dict[str, Any]:
    """Add the repository at this address, and install the extension from it."""
    _online()
    bpy.context.preferences.extensions.repos.new(name="Published", module=REPOSITORY, remote_url=url)
    synced = attempt(bpy.ops.extensions.repo_sync, repo_index=_index())
    return _state(
        synced,
        attempt(bpy.ops.extensions.package_install, repo_index=_index(), pkg_id="halfspace", enable_on_install=True),
    )


def update() -> dict[str, Any]:
    """Look for updates, and install them."""
    _online()
    synced = attempt(bpy.ops.extensions.repo_sync, repo_index=_index())
    return _state(synced, attempt(bpy.ops.extensions.package_upgrade_all))


def remove() -> dict[str, Any]:
    """Remove the extension."""
    _online()
    return _state(attempt(bpy.ops.extensions.package_uninstall, repo_index=_index(), pkg_id="halfspace"))

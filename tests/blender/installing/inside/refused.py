# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips that cannot work here are installed. Each scenario ends with a picture by Cycles: Blender goes on."""

import sys
from pathlib import Path
from typing import Any

import bpy
import in_session
from in_session import NAME, addon_utils, attempt, cycles, install, native, open_scene, part, render

SECOND = "second"
NAME_OF_SECOND = f"bl_ext.{SECOND}.halfspace"


def refused(archive: str) -> dict[str, Any]:
    """A zip that Blender itself refuses."""
    found = {"reported": install(archive), "enabled": addon_utils.check(NAME)}
    open_scene()
    return found | {"cycles": cycles()}


def without_module(archive: str) -> dict[str, Any]:
    """A zip that Blender installs and whose native module cannot be used."""
    found: dict[str, Any] = {"reported": install(archive), "enabled": addon_utils.check(NAME)}
    open_scene()
    found |= {"problem": part("core.base.native").problem(), "picture": render()}
    found["loaded"] = [name for name in sys.modules if name.startswith("halfspace_native")]
    return found | {"cycles": cycles()}


def old_processor(archive: str) -> dict[str, Any]:
    """The same on a processor that reports no SSE4.2."""
    read_text = Path.read_text

    def without_sse42(path: Path, *arguments: Any, **named: Any) -> str:
        text = read_text(path, *arguments, **named)
        return text.replace("sse4_2", "") if str(path) == "/proc/cpuinfo" else text

    Path.read_text = without_sse42  # type: ignore[method-assign]
    return without_module(archive)


def unregistered(archive: str) -> dict[str, Any]:
    """A zip that refuses to register; what its preferences show."""
    found: dict[str, Any] = {"reported": install(archive), "enabled": addon_utils.check(NAME)}
    found |= {"shown": shown(NAME), "settings": hasattr(bpy.types.Scene, "halfspace")}
    open_scene()
    return found | {"cycles": cycles()}


def shown(package: str) -> list[str]:
    """The labels in the preferences of the extension in this package."""
    labels: list[str] = []

    class Layout:
        "Collects what is drawn."

        def label(self, text: str, icon: str = "NONE") -> None:
            "Keep the text."
            labels.append(text)

    for kind in bpy.types.AddonPreferences.__subclasses__():
        if kind.is_registered and kind.bl_idname == package:
            kind.draw(type("Shown", (), {"layout": Layout()})(), bpy.context)
    return labels


def both(first: str, second: str) -> dict[str, Any]:
    """Two builds in two repositories; the second one is enabled next to the first, then alone."""
    repositories = bpy.context.preferences.extensions.repos
    folder = in_session.user_folder() / "second repository"
    folder.mkdir()
    repositories.new(name="Second", module=SECOND, custom_directory=str(folder), remote_url="")
    found: dict[str, Any] = {"reported": [install(first), install(second, SECOND)]}
    found["enabled"] = [addon_utils.check(NAME), addon_utils.check(NAME_OF_SECOND)]
    open_scene()
    found |= {"shown": shown(NAME_OF_SECOND), "build": native().BUILD, "picture": render(), "cycles": cycles()}
    # The way out that the sentence names.
    for operator, module in (("disable", NAME), ("disable", NAME_OF_SECOND), ("enable", NAME_OF_SECOND)):
        found["reported"].append(attempt(getattr(bpy.ops.preferences, f"addon_{operator}"), module=module))
    found |= {"second shown": shown(NAME_OF_SECOND), "second picture": render()}
    found["second build"] = part("core.base.native", NAME_OF_SECOND).load().BUILD
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user does with the extension zip, in a Blender of its own: `python -I extension_session.py ZIP [PICTURE]`.

Run by test_extension_zip.py with an empty user folder. With PICTURE the extension is installed already, and its folder
is read-only: it renders there, and installing and saving a preset fail. The native module of the environment that has
bpy is hidden, so that only the zip's own can be imported. Prints one JSON line with what was found.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import json
import os
import sys
import sysconfig
import traceback
from pathlib import Path

ZIP = sys.argv[1]
SITE = os.path.realpath(sysconfig.get_path("platlib"))
NAME = "bl_ext.user_default.halfspace"


class HideInstalled(importlib.abc.MetaPathFinder):
    """Finds the native module wherever Blender unpacked it, and not in the development environment."""

    def find_spec(self, name, path, target=None):
        if name != "halfspace_native":
            return None
        places = [place for place in sys.path if os.path.realpath(place) != SITE]
        found = importlib.machinery.PathFinder.find_spec(name, places, target)
        if found is None:
            raise ModuleNotFoundError("halfspace_native is not among the extension's wheels", name=name)
        return found


sys.meta_path.insert(0, HideInstalled())

import bpy  # noqa: E402

addon_utils = importlib.import_module("addon_utils")


def traces() -> dict[str, list[str]]:
    """Everything that an add-on can leave behind in Blender, by kind."""
    panels = {name for kind in bpy.types.Panel.__subclasses__() for name in [kind.__name__] if "HALFSPACE" in name}
    compatible = [
        kind.__name__
        for kind in bpy.types.Panel.__subclasses__()
        if "HALFSPACE" in getattr(kind, "COMPAT_ENGINES", ()) and "HALFSPACE" not in kind.__name__
    ]
    handlers = [
        f"{name}: {function.__module__}"
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
        for function in getattr(bpy.app.handlers, name)
        if "halfspace" in getattr(function, "__module__", "").lower()
    ]
    owners = ("Scene", "ViewLayer", "Object", "Material", "Light", "World", "WindowManager")
    properties = [o for o in owners if "halfspace" in getattr(bpy.types, o).bl_rna.properties]
    registered = [name for name in dir(bpy.types) if "halfspace" in name.lower()]
    return {
        "engines": [
            e.__name__ for e in bpy.types.RenderEngine.__subclasses__() if e.is_registered and "Half" in e.__name__
        ],
        "types": sorted(registered),
        "panels": sorted(name for name in panels if hasattr(bpy.types, name)),
        "compatible": sorted(compatible),
        "handlers": handlers,
        "properties": properties,
        "operators": [name for name in dir(bpy.ops) if name == "halfspace" and dir(bpy.ops.halfspace)],
    }


def render(path: str) -> dict[str, object]:
    """Render a lit cube before a plane with the extension's engine; what the picture looks like."""
    import numpy as np

    scene = bpy.context.scene
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.render.filepath = path
    scene.render.image_settings.file_format = "PNG"
    bpy.ops.render.render(write_still=True)
    # A picture that is not there raises.
    image = bpy.data.images.load(path)
    pixels = np.array(image.pixels[:]).reshape(48, 64, 4)[..., :3]
    bpy.data.images.remove(image)
    return {"mean": float(pixels.mean()), "deviation": float(pixels.std())}


def open_scene() -> None:
    """The factory scene: cube, camera and lamp."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)


def main() -> dict[str, object]:
    found: dict[str, object] = {"version": bpy.app.version_string, "before": traces()}
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)
    found["enabled"] = addon_utils.check(NAME)
    import halfspace_native

    found["native"] = halfspace_native.__file__
    open_scene()
    found["with"] = traces()
    picture = str(Path(os.environ["BLENDER_USER_RESOURCES"]) / "picture.png")
    found["first"] = render(picture)
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.preferences.addon_disable(module=NAME)
    found["disabled"] = addon_utils.check(NAME)
    found["after"] = traces()
    bpy.ops.preferences.addon_enable(module=NAME)
    found["again"] = addon_utils.check(NAME)
    found["with_again"] = traces()
    open_scene()
    found["second"] = render(picture)
    return found


def refusal(operator, **arguments) -> str:
    """The error of an operator that must fail; empty if it succeeds."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        return str(error).strip()
    return ""


def read_only(picture: str) -> dict[str, object]:
    """What works and what is refused where nothing can be written but the picture."""
    try:
        Path(os.environ["BLENDER_USER_RESOURCES"], "probe").touch()
        return {"writable": True}
    except OSError:
        pass
    addon_utils.enable(NAME, default_set=True)
    open_scene()
    found: dict[str, object] = {"writable": False, "enabled": addon_utils.check(NAME), "picture": render(picture)}
    found["preset"] = refusal(bpy.ops.halfspace.preset_add, name="mine")
    install = bpy.ops.extensions.package_install_files
    found["install"] = refusal(install, filepath=ZIP, repo="user_default", enable_on_install=True)
    # Blender disables an extension before it replaces it, and leaves it so where that fails.
    addon_utils.enable(NAME, default_set=True)
    found["still"] = render(picture)
    return found


try:
    print("FOUND " + json.dumps(read_only(sys.argv[2]) if len(sys.argv) > 2 else main()))
    status = 0
except BaseException:
    traceback.print_exc()
    status = 1
sys.stdout.flush()
sys.stderr.flush()
# Blender 4.5 as a module hangs at the interpreter's end after a render.
os._exit(status)

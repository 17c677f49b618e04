# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions of a user in a Blender of its own."""

import importlib
import os
from pathlib import Path
from typing import Any

import bpy

addon_utils = importlib.import_module("addon_utils")

REPOSITORY = "user_default"
NAME = f"bl_ext.{REPOSITORY}.halfspace"
WIDTH, HEIGHT = 64, 48


def user_folder() -> Path:
    """The folder with all settings and extensions of this Blender."""
    return Path(os.environ["BLENDER_USER_RESOURCES"])


def attempt(operator: Any, **arguments: Any) -> str:
    """The error of an operator; empty if it succeeds."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        return str(error).strip()
    return ""


def install(archive: str, repository: str = REPOSITORY, enable: bool = True) -> str:
    """Install a zip through Blender's own installer. Returns what the installer reports as an error."""
    operator = bpy.ops.extensions.package_install_files
    return attempt(operator, filepath=archive, repo=repository, enable_on_install=enable)


def part(name: str, package: str = NAME) -> Any:
    """A module of the installed extension, such as "core.base.native"."""
    return importlib.import_module(f"{package}.{name}")


def native() -> Any:
    """The native module that the installed extension uses."""
    return part("core.base.native").load()


def open_scene() -> None:
    """The factory scene: cube, camera and lamp."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)


def render(engine: str = "HALFSPACE", path: str | Path = "") -> dict[str, Any]:
    """Render the open scene; what the picture looks like, or the error. path: of the picture, "" in the user's folder.

    The picture that is there is removed first.
    """
    import numpy as np

    scene = bpy.context.scene
    path = Path(path or user_folder() / "picture.png")
    path.unlink(missing_ok=True)
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.render.filepath = str(path)
    scene.render.image_settings.file_format = "PNG"
    error = attempt(bpy.ops.render.render, write_still=True)
    if error or not path.is_file():
        return {"error": error, "written": path.is_file()}
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[..., :3]
    bpy.data.images.remove(image)
    return {"error": "", "mean": float(pixels.mean()), "deviation": float(pixels.std())}


def cycles() -> dict[str, Any]:
    """Render the open scene with Cycles at one sample."""
    if not addon_utils.check("cycles")[1]:
        addon_utils.enable("cycles")
    bpy.context.scene.cycles.samples = 1
    return render("CYCLES")


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


def unpacked() -> list[str]:
    """Files of the extension's wheels that Blender has unpacked and not removed, or could not remove."""
    return sorted(path.name for path in user_folder().glob("extensions/.local/lib/python*/site-packages/*"))


def stale() -> list[str]:
    """The lists of files, in the folder of extensions, that Blender removes at its next start."""
    found = user_folder().glob("extensions/**/.~stale~")
    return sorted(line for path in found for line in path.read_text(encoding="utf-8").splitlines())

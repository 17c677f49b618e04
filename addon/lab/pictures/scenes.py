# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening the input of command lines: a file that Blender reads, a bare geometry, or by default the showcase."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from ...blender.measure import workloads
from ...blender.samples import showcase
from ...core.base import native
from ...core.base.native import first_line
from ...core.scene import grid
from ..bench import mesh_files, scenes
from . import stage

SEEN = 64, 64
"""Pixels of the view of an imported scene without a camera."""


def open_file(file: str | None, lights: Sequence[str] | None = None) -> str:
    """Open a scene as the current one. Returns its name. Raises WorkloadError, and Blender's RuntimeError.

    file: as for `scenes.find`, None for the showcase. lights: those of `stage.LIGHTS` that a bare geometry gets, None
    for all. Other files than .blend get a camera and these lights where they have none.
    """
    found = "showcase" if file is None else scenes.find(file)
    if found == scenes.OPEN_FILE:
        return str(bpy.path.display_name_from_filepath(bpy.data.filepath))
    if isinstance(found, Path) and found.suffix.lower() not in mesh_files.BARE:
        workloads.open_file(found)
        if found.suffix.lower() != ".blend":
            _completed(bpy.context.scene, found.stem, stage.LIGHTS if lights is None else lights)
        return found.stem
    workload = None
    if found != "showcase":
        workload = mesh_files.bare(found, native.load().free_memory()) if isinstance(found, Path) else grid.workload()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if workload is None:
        showcase.build(bpy.context.scene)
        return "showcase"
    stage.build(bpy.context.scene, workload, stage.LIGHTS if lights is None else lights)
    return workload.name


def _completed(scene: Any, name: str, lights: Sequence[str]) -> None:
    """Give an imported scene a camera if it has none, and these lights if it has neither lights nor a world."""
    kinds = {item.type for item in scene.objects}
    if "CAMERA" in kinds:
        scene.camera = scene.camera or next(item for item in scene.objects if item.type == "CAMERA")
    stage.complete(
        scene,
        workloads.current(name, SEEN),
        see="CAMERA" not in kinds,
        lights=() if "LIGHT" in kinds or scene.world is not None else lights,
    )


def open_saved(file: str | None, lights: Sequence[str] | None = None) -> str:
    """Like `open_file`, from a .blend: a generated scene is saved and opened again, so that all engines read a file.

    Raises OSError, too.
    """
    name = open_file(file, lights)
    if file is not None and file.lower().endswith(".blend"):
        return name
    with tempfile.TemporaryDirectory(prefix="halfspace-scene-") as folder:
        path = Path(folder) / "scene.blend"
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(path))
        except RuntimeError as error:
            raise OSError(f"{path}: cannot be written: {first_line(error)}") from error
        workloads.open_file(path)
    return name

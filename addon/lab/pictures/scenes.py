# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening the input of command lines: a .blend, a bare geometry, or by default the showcase."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...blender.samples import showcase
from ...core.base import native
from ...core.base.native import first_line
from ...core.scene.workload import find
from ..bench import mesh_files
from . import stage


def open_file(file: str | None, lights: Sequence[str] | None = None) -> str:
    """Open the file's scene as the current one. Returns its name. Raises WorkloadError, and Blender's RuntimeError.

    file: as for `core.workload.find`. lights: those of `stage.LIGHTS` that a bare geometry gets, None for all.
    """
    path = None if file is None else Path(find(file, mesh_files.RENDERED))
    if path is not None and path.suffix.lower() == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
        return path.stem
    workload = None if path is None else mesh_files.bare(path, native.load().free_memory())
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if workload is None:
        showcase.build(bpy.context.scene)
        return "showcase"
    stage.build(bpy.context.scene, workload, stage.LIGHTS if lights is None else lights)
    return workload.name


def open_saved(file: str | None, lights: Sequence[str] | None = None) -> str:
    """Like `open_file`, from a .blend: a generated scene is saved and opened again, so that all engines read a file.

    Raises OSError, too.
    """
    name = open_file(file, lights)
    if file is not None and file.lower().endswith(".blend"):
        return name
    with tempfile.TemporaryDirectory(prefix="halfspace-scene-") as folder:
        path = str(Path(folder) / "scene.blend")
        try:
            bpy.ops.wm.save_as_mainfile(filepath=path)
        except RuntimeError as error:
            raise OSError(f"{path}: cannot be written: {first_line(error)}") from error
        bpy.ops.wm.open_mainfile(filepath=path)
    return name

# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening what the command lines are given: a .blend, a bare geometry, or nothing, which is the showcase."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from ..core.workload import WorkloadError, load_npz
from . import showcase, stage


def open_file(file: Path | None, lights: Sequence[str] | None = None) -> str:
    """Make the file's scene the current one. Returns its name. Raises WorkloadError, and Blender's RuntimeError.

    lights: which of `stage.LIGHTS` a bare geometry gets, None for all.
    """
    if file is not None and not file.is_file():
        raise WorkloadError(f"{file}: there is no such file")
    if file is not None and file.suffix.lower() == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(file))
        return file.stem
    if file is not None and file.suffix.lower() != ".npz":
        raise WorkloadError(f"{file}: expected a .blend or an .npz")
    workload = load_npz(file) if file is not None else None
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if workload is None:
        showcase.build(bpy.context.scene)
        return "showcase"
    stage.build(bpy.context.scene, workload, stage.LIGHTS if lights is None else lights)
    return workload.name

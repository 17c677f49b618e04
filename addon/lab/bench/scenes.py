# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of command lines: files, scenes of a folder by their names, and built-in ones."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from ...core.base import interrupt, native
from ...core.scene import grid, workload
from ..base.usage import UsageError, no_blender
from . import mesh_files
from .bench_presets import PRESETS

# Suffixes of scene files.
SUFFIXES = (".npz", ".blend", ".obj", ".ply", ".stl", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")

CHOICES = f"a file ({' '.join(SUFFIXES)}), {workload.NAMED}grid or showcase"
"""The scenes of a command, for its help."""

OPEN_FILE = "open file"
"""Name of the scene that is open in Blender."""


def find(scene: str) -> str | Path:
    """A built-in scene's name, or the path of a file. Raises WorkloadError when there is no such scene."""
    return workload.find(scene, SUFFIXES, ("grid", "showcase", *([OPEN_FILE] if is_file_open() else [])))


def loader(
    scene: str, size: tuple[int, int], published: bool = False, layout: str = "flatten"
) -> Callable[[], workload.Workload]:
    """A function that loads the scene. size: pixels of its view. published: only its published part. layout: one of
    `instances.MODES`; other files than Blender's have no instances.

    Raises WorkloadError when there is no such scene, UsageError without Blender.
    """
    found = find(scene)
    if found == "grid":
        return grid.workload
    if isinstance(found, Path) and found.suffix.lower() == ".npz":
        path = found
        return lambda: workload.load_npz(path, memory_limit=native.load().free_memory(), published=published)
    try:
        with interrupt.guarded():
            from ...blender.measure import workloads
    except ImportError as error:
        if isinstance(found, Path) and found.suffix.lower() in mesh_files.READERS:
            mesh = found
            return lambda: mesh_files.load(mesh)
        raise UsageError(f"{scene}: {no_blender(error)}") from error
    if found == "showcase":
        return lambda: workloads.built_in_showcase(size, layout)
    if isinstance(found, str):
        return lambda: workloads.current(found, size, layout)
    return lambda: workloads.load(found, size, layout)


def of_preset(preset: str | None, say: Callable[[str], None]) -> list[str]:
    """The scenes to measure if none is named: the preset's, the file open in Blender, or the showcase."""
    if preset is None:
        return [OPEN_FILE if is_file_open() else "showcase"]
    names = PRESETS[preset]["scenes"].split(",")
    found = [name for name in names if (workload.SCENES / f"{name}.npz").is_file()]
    for name in names:
        if name not in found:
            say(f"{name} is left out: it is not in {workload.SCENES}")
    if not found:
        raise UsageError(f"--preset {preset}: none of its scenes is in {workload.SCENES}")
    return [str(workload.SCENES / f"{name}.npz") for name in found]


def is_file_open() -> bool:
    """Whether this runs inside Blender with a file open."""
    bpy = sys.modules.get("bpy")
    return bpy is not None and bool(bpy.data.filepath)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmark scenes that need Blender: .blend files, formats that Blender imports, and the built-in showcase."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.base.arrays import F32, I32
from ...core.base.native import first_line
from ...core.base.notes import Notes
from ...core.scene.scene import Camera, Scene
from ...core.scene.workload import View, Workload, WorkloadError, framing_view
from ..read.camera import read_camera
from ..read.extract import WAIT, find
from ..samples import showcase
from ..session.trees import Tree

IMPORTERS = {
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
    ".stl": lambda path: bpy.ops.wm.stl_import(filepath=path),
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".gltf": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".usd": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usda": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdc": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdz": lambda path: bpy.ops.wm.usd_import(filepath=path),
}
"""Import operators by suffix."""


def load(path: Path, size: tuple[int, int], layout: str = "flatten") -> Workload:
    """The scene of a file, seen by its camera in a frame of `size` pixels; layout: as for `current`. Raises
    WorkloadError.
    """
    open_file(path)
    return current(path.stem, size, layout)


def open_file(path: Path) -> None:
    """Make the scene of a .blend, or of a file that Blender imports, the open one. Its scripts are not run. Raises
    WorkloadError.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".blend":
            bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
        else:
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            IMPORTERS[suffix](str(path))
    except Exception as error:
        # Operators report several lines, and importers written in Python raise anything.
        raise WorkloadError(f"{path}: Blender cannot read it: {first_line(error)}") from error


def built_in_showcase(size: tuple[int, int], layout: str = "flatten") -> Workload:
    """The showcase, in an otherwise empty file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    showcase.build(bpy.context.scene)
    return current("showcase", size, layout)


def current(name: str, size: tuple[int, int], layout: str = "flatten") -> Workload:
    """The open file's scene, as the viewport shows it. Raises WorkloadError.

    layout: one of `instances.MODES`; the instances are kept next to the triangles where that is chosen.
    """
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    notes = Notes()
    # Wait for the sky: no other process may run during timing, and a sky's sun adds shadow rays.
    found = find(depsgraph, notes, sky=WAIT)
    scene = found.flattened()
    workload = of_scene(name, scene, _camera(depsgraph, scene.geometry.origin, notes, size), notes)
    if not found.layout(layout).two_level:
        return workload
    return replace(workload, kept=found.instanced(origin=scene.geometry.origin))


def of_tree(tree: Tree, name: str, size: tuple[int, int]) -> Workload:
    """The triangles that a structure was built over, seen by the scene's current camera. Raises WorkloadError."""
    bpy.context.view_layer.update()
    notes = Notes()
    camera = _camera(bpy.context.evaluated_depsgraph_get(), tree.origin, notes, size)
    view = _seen_by(camera, name, tree.vertices, tree.triangles, notes)
    return Workload(name, tree.vertices, tree.triangles, view, notes=tuple(notes.lines()))


def of_scene(name: str, scene: Scene, camera: Camera | None, notes: Notes) -> Workload:
    """A scene as a workload, seen by its camera, or entirely if that is not a perspective one. Raises WorkloadError."""
    geometry = scene.geometry
    view = _seen_by(camera, name, geometry.vertices, geometry.triangles, notes)
    return Workload(
        name,
        geometry.vertices,
        geometry.triangles,
        view,
        render_scene=scene,
        render_camera=camera,
        notes=tuple(notes.lines()),
    )


def _seen_by(camera: Camera | None, name: str, vertices: F32, triangles: I32, notes: Notes) -> View:
    """The view of a camera, or of the whole scene if it is not a perspective one. Raises WorkloadError."""
    if not len(triangles):
        raise WorkloadError(f"{name}: the scene has no triangles")
    view = None if camera is None else _view(camera)
    if view is None:
        notes.add("No perspective camera, the whole scene is seen from the front and above", name)
        return framing_view(vertices, triangles)
    assert camera is not None
    if _shifted(camera):
        notes.add("The lens shift is ignored in the measured rays", name)
    return view


def _shifted(camera: Camera) -> bool:
    """Whether the lens is shifted by more than rounding errors."""
    left, right, bottom, top = camera.window
    return bool(max(abs(left + right), abs(bottom + top)) > 1e-4 * (top - bottom))


def _camera(depsgraph: Any, origin: Any, notes: Notes, size: tuple[int, int]) -> Camera | None:
    item = depsgraph.scene_eval.camera
    if item is None:
        return None
    item = item.evaluated_get(depsgraph)
    return read_camera(item, depsgraph, item.matrix_world, origin, notes, size=size)


def _view(camera: Camera) -> View | None:
    """The pinhole view of a perspective camera without its shift; None for other cameras."""
    if camera.kind != "perspective":
        return None
    eye, up, back = (np.array(camera.to_world[:3, column], np.float64) for column in (3, 1, 2))
    _, _, bottom, top = camera.window
    return View(eye, eye - back, up, float(np.degrees(2 * np.arctan((top - bottom) / 2))))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The animation of a .blend file as triangles, frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from ...blender.measure import workloads
from ...blender.read.extract import NO_WORLD, extract
from ...core.base.arrays import F32, I32
from ...core.base.notes import Notes
from ...core.scene.scene import Geometry
from ...core.scene.workload import View

SIZE = (64, 64)
"""Pixels of the frame whose view is read; a view depends on their ratio only."""


def load(path: Path) -> tuple[Callable[[int], tuple[F32, I32]], View]:
    """Open a file. Returns a function from the number of a frame to its triangles, and the view in the first frame.

    Vertices are those of the scene frame of the first frame that is read. Raises WorkloadError.
    """
    workloads.open_file(path)
    return of_scene(), workloads.current(path.stem, SIZE).view


def of_scene() -> Callable[[int], tuple[F32, I32]]:
    """A function from the number of a frame of the open scene to its vertices (n, 3) and triangles (m, 3)."""
    bpy.context.view_layer.update()
    start = _read().origin

    def frame(number: int) -> tuple[F32, I32]:
        bpy.context.scene.frame_set(number)
        geometry = _read()
        shift = geometry.origin - start
        vertices = geometry.vertices
        if shift.any():
            vertices = (vertices.astype(np.float64) + shift).astype(np.float32)
        return vertices, geometry.triangles

    return frame


def _read() -> Geometry:
    """The flattened triangles of the open scene in its current frame."""
    geometry = extract(bpy.context.evaluated_depsgraph_get(), Notes(), sky=NO_WORLD).geometry
    assert isinstance(geometry, Geometry), "extracted flat"
    return geometry

# SPDX-License-Identifier: GPL-3.0-or-later
"""Time of reading a scene from Blender: `python -m scripts.dev.extraction [--triangles N] [--rounds N]`.

Prints, for grids of a million triangles and for thousands of instances, the time of Blender's own evaluation, of the
extraction after an edit, and of the extraction without a change: processor time of the shortest of several rounds. The
extension promises 300 ms after an edit and 50 ms without a change for a million triangles; the last column shows
whether it keeps both. Exit status: 0 measured; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import functools
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from addon.core.base import command
from addon.lab.base.usage import Parser, UsageError

PROMISED_EDIT, PROMISED_WARM = 300e-9, 50e-9
"""Promised seconds per triangle after an edit and without a change."""

KINDS = ("smooth", "flat", "sharp edges, two materials")
"""Shading of the measured grids."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="extraction", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--triangles", type=int, default=1_000_000, help="size of the grids (default: a million)")
    made.add_argument("--rounds", type=int, default=7, help="the shortest of this many rounds (default: 7)")
    return made


def main(arguments: Sequence[str]) -> int:
    """Measure and print. Returns the exit status."""
    return command.run("extraction", arguments, read, measure)


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked. Raises UsageError."""
    asked = parser().parse_args(arguments)
    for name, least, most in (("triangles", 2, 1 << 27), ("rounds", 1, 1000)):
        if not least <= getattr(asked, name) <= most:
            raise UsageError(f"--{name}: expected {least} to {most}, got {getattr(asked, name)}")
    return asked


def measure(asked: argparse.Namespace) -> int:
    """Measure all scenes and print a line for each. Returns the exit status."""
    import bpy

    print(f"{'scene':<30}{'triangles':>12}{'evaluation':>12}{'after edit':>12}{'warm':>9}   promise")
    for kind in KINDS:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        mesh = _grid(bpy, math.ceil(math.sqrt(asked.triangles / 2)), kind)
        _place(bpy, "Sea", mesh)
        evaluation = _shortest(asked.rounds, _evaluate, functools.partial(_wave, mesh))
        edited = _shortest(asked.rounds, _read, functools.partial(_edit, mesh))
        _row(kind, len(_read().triangles), evaluation, edited, _shortest(asked.rounds, _read))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    dots = _place(bpy, "Dots", _grid(bpy, 109, "flat"), instance_type="VERTS")
    _place(bpy, "Seed", _grid(bpy, 2, "flat"), parent=dots, scale=(0.01, 0.01, 0.01))
    evaluation = _shortest(asked.rounds, _evaluate)
    geometry = _read()
    places = sum(len(source.names) for source in geometry.sources)
    _row(f"{places:,} instances", len(geometry.triangles), evaluation, None, _shortest(asked.rounds, _read))
    return 0


def _row(name: str, triangles: int, evaluation: float, edited: float | None, warm: float) -> None:
    """Print the line of a scene. evaluation, edited, warm: seconds; edited: None if not measured."""
    kept = "" if edited is None else "kept" if _keeps(triangles, edited, warm) else "missed"
    cells = [f"{1e3 * seconds:.1f} ms" if seconds is not None else "" for seconds in (evaluation, edited, warm)]
    print(f"{name:<30}{triangles:>12,}{cells[0]:>12}{cells[1]:>12}{cells[2]:>9}   {kept}", flush=True)


def _keeps(triangles: int, edited: float, warm: float) -> bool:
    """Whether both promises are kept."""
    return edited <= PROMISED_EDIT * triangles and warm <= PROMISED_WARM * triangles


def _shortest(rounds: int, work: Callable[[], Any], prepare: Callable[[], Any] = lambda: None) -> float:
    """Seconds of processor time of the shortest round; `prepare` is not timed."""
    seconds = []
    for _ in range(rounds):
        prepare()
        begun = time.process_time()
        work()
        seconds.append(time.process_time() - begun)
    return min(seconds)


def _grid(bpy: Any, segments: int, kind: str) -> Any:
    """A mesh of segments² quads over 2 × 2 units, with the shading that `kind` (one of KINDS) names."""
    import bmesh
    import numpy as np

    bm = bmesh.new()
    bmesh.ops.create_grid(bm, x_segments=segments, y_segments=segments, size=1.0)
    mesh = bpy.data.meshes.new("Grid")
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), kind != "flat"))
    if kind.startswith("sharp"):
        for name in ("A", "B"):
            mesh.materials.append(bpy.data.materials.new(name))
        sharp = mesh.attributes.new("sharp_edge", "BOOLEAN", "EDGE")
        sharp.data.foreach_set("value", np.arange(len(mesh.edges)) % 7 == 0)
        slots = mesh.attributes.new("material_index", "INT", "FACE")
        slots.data.foreach_set("value", np.arange(len(mesh.polygons), dtype=np.int32) % 2)
    return mesh


def _place(bpy: Any, name: str, mesh: Any, **properties: Any) -> Any:
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    for key, value in properties.items():
        setattr(item, key, value)
    return item


def _wave(mesh: Any) -> None:
    """Move all vertices, a little more each time, so that Blender must compute triangulation and normals again."""
    import numpy as np

    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.attributes["position"].data.foreach_get("vector", points)
    points[2::3] += 0.02 * np.sin(40 * points[0::3])
    mesh.attributes["position"].data.foreach_set("vector", points)
    mesh.update()


def _edit(mesh: Any) -> None:
    """Move all vertices, and let Blender evaluate the scene, which is not part of the extraction."""
    import bpy

    _wave(mesh)
    bpy.context.evaluated_depsgraph_get()


def _evaluate() -> None:
    """Evaluate the scene as Blender does: modifiers and copies, then triangles and normals on demand."""
    import bpy

    item: Any
    for item in bpy.context.evaluated_depsgraph_get().objects:
        if item.type == "MESH":
            item.data.calc_loop_triangles()
            normals = {"POINT": "vertex_normals", "CORNER": "corner_normals"}.get(item.data.normals_domain)
            if normals is not None:
                getattr(item.data, normals)[0].vector.copy()


def _read() -> Any:
    """The geometry of the open scene, as the extension extracts it."""
    import bpy

    from addon.blender.read import extract
    from addon.core.base.notes import Notes

    return extract.extract(bpy.context.evaluated_depsgraph_get(), Notes(), sky=extract.WAIT).geometry


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Skip Blender's own shutdown, which may crash.
    os._exit(result)

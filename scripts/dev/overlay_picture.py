# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the structure in the viewport: `python -m scripts.dev.overlay_picture [FILE] [options]`.

FILE: as for `bench` (default: the built-in showcase), seen through its camera in Solid shading. Draws without a
window, which needs Blender 5.2 or newer. Exit status: 0 done; 2 bad usage or input, with one line; 130 stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command
from addon.core.report import results
from addon.core.scene.workload import View
from addon.core.structures import specs
from addon.lab.base.usage import Parser, UsageError, output
from addon.lab.bench import scenes

ROOT = Path(__file__).resolve().parents[2]

LARGEST, DEEPEST = 1 << 13, 1 << 10
SUFFIXES = (".png", ".jpg", ".jpeg")
SMOOTHING = 2
"""Factor on width and height while drawing; the picture is averaged down, because the GPU does not smooth lines."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="overlay_picture", description=(__doc__ or "").splitlines()[0])
    made.add_argument("file", nargs="?", help=f"{scenes.CHOICES} (default)")
    made.add_argument("--structure", default="kd", metavar="SPEC", help="the acceleration structure (default: kd)")
    made.add_argument("--depth", metavar="FIRST-LAST", help="levels of the tree (default: as first shown in Blender)")
    made.add_argument(
        "--show", default="planes", metavar="PART[,...]", help="planes, cells, ray, beam (default: planes)"
    )
    made.add_argument(
        "--least", type=int, default=1, metavar="N", help="least number of triangles of a cell that is shown"
    )
    made.add_argument("--ray", type=float, nargs=6, metavar="N", help="from x y z towards x y z; shows its path")
    made.add_argument("--traversal", metavar="NAME", help="one of the structure's traversals, if it has several")
    made.add_argument("--pixel", type=float, default=1e-3, metavar="N", help="between rays of a beam (default: 0.001)")
    made.add_argument("--opacity", type=float, default=0.9, metavar="SHARE", help="0 to 1 (default: 0.9)")
    made.add_argument("--style", default="BOTH", choices=("OUTLINE", "FILL", "BOTH"), help="default: BOTH")
    made.add_argument("--view", type=float, nargs=6, metavar="N", help="eye x y z and target x y z, z up, 40 degrees")
    made.add_argument("--size", default="1440x810", metavar="WxH", help="pixels (default: 1440x810)")
    made.add_argument("--out", type=output, default=ROOT / "out" / "overlay.png", help="the picture, .png or .jpg")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("overlay_picture", arguments, read, run, told=(TypeError,))


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked before any work. Raises UsageError, WorkloadError and FolderError."""
    asked = parser().parse_args(arguments)
    if asked.file is not None:
        scenes.find(asked.file)
    first, _, last = (asked.depth or "0").partition("-")
    if not all(specs.is_whole(level) and int(level) <= DEEPEST for level in (first, last or first)):
        raise UsageError(f"--depth: expected FIRST-LAST, whole numbers up to {DEEPEST}, got {asked.depth!r}")
    width, _, height = asked.size.partition("x")
    if not all(specs.is_whole(side) and 8 <= int(side) <= LARGEST for side in (width, height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT of 8x8 to {LARGEST}x{LARGEST}, got {asked.size!r}")
    unknown = {part.strip() for part in asked.show.split(",")} - {"planes", "cells", "ray", "beam"}
    if unknown:
        raise UsageError(f"--show: expected planes, cells, ray or beam, got {min(unknown)!r}")
    if not 0 <= asked.least < 1 << 31:
        raise UsageError(f"--least: expected a number of triangles, got {asked.least}")
    if asked.out.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{asked.out}: expected a name that ends in {', '.join(SUFFIXES)}")
    if asked.out.is_dir():
        raise UsageError(f"{asked.out}: cannot be written: it is a folder")
    results.prepare_folder(asked.out.parent)
    return asked


def run(asked: argparse.Namespace) -> int:
    """Open the scene, build the structure, draw, save. Returns the exit status."""
    first, _, last = (asked.depth or "").partition("-")
    width, _, height = asked.size.partition("x")
    structure = specs.joined(asked.structure, f"traversal={asked.traversal}" if asked.traversal else "")

    import bpy
    import gpu
    import numpy as np

    import addon
    from addon.blender.measure import pictures
    from addon.blender.overlay import drawing as overlay
    from addon.blender.samples import camera
    from addon.blender.settings import presets
    from addon.lab.pictures import scenes as opened

    if not hasattr(gpu, "init"):
        raise RuntimeError("this Blender cannot draw without a window; 5.2 and newer can")
    gpu.init()
    scene: Any = bpy.context.scene
    if not hasattr(scene, "halfspace"):
        addon.register()
    opened.open_file(asked.file)
    scene = bpy.context.scene  # opening a file replaces the scene
    group = scene.halfspace
    settings = group.overlay
    try:
        presets.apply(group, structure)
    except specs.SpecError as error:
        raise UsageError(f"--structure: {error}") from error
    # Show the chosen parts of the tree, and build it.
    settings.show, settings.style = True, asked.style
    settings.depth_auto = not first
    if first:
        settings.depth_min, settings.depth_max = int(first), int(last or first)
    settings.line_width *= SMOOTHING
    parts = {part.strip().upper() for part in asked.show.split(",")}
    settings.parts = parts if parts & {"RAY", "BEAM"} or not asked.ray else parts | {"RAY"}
    settings.least, settings.opacity = asked.least, asked.opacity
    operators: Any = bpy.ops
    operators.halfspace.build_structure()
    if asked.ray is not None:
        start, towards = np.array(asked.ray[:3]), np.array(asked.ray[3:])
        operators.halfspace.pick_ray(origin=start, direction=towards - start, pixel=asked.pixel)
    if asked.view is not None:
        eye, target = np.array(asked.view[:3]), np.array(asked.view[3:])
        camera.see(scene, View(eye, target, np.array([0.0, 0.0, 1.0]), 40.0))
    # Draw at a multiple of the size, save the average, and print what is in the picture.
    if scene.camera is None:
        raise ValueError("the scene has no camera; give it a --view")
    picture = drawn(bpy, gpu, overlay, scene, (int(width) * SMOOTHING, int(height) * SMOOTHING))
    pictures.save(asked.out, pictures.halved(picture))
    print(asked.out)
    planes, cells, *picked = (overlay.shown(scene, part) for part in ("PLANES", "CELLS", "RAY", "BEAM"))
    if planes is not None:
        print(f"{len(planes):,} planes of {structure}, {planes.hidden:,} hidden")
    if cells is not None:
        fullest = int(cells.count.max()) if len(cells) else 0
        print(f"{len(cells):,} cells of up to {fullest:,} triangles, {cells.hidden:,} hidden")
    for found in picked:
        for line in found.lines() if found is not None else ():
            print(line)
    return 0


def drawn(bpy: Any, gpu: Any, overlay: Any, scene: Any, size: tuple[int, int]) -> Any:
    """The scene in Solid shading through its camera, and the planes over it: (height, width, 3) display values."""
    import numpy as np

    width, height = size
    area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    space, region = area.spaces.active, next(region for region in area.regions if region.type == "WINDOW")
    space.shading.type, space.shading.color_type = "SOLID", "SINGLE"
    space.shading.single_color = (0.5, 0.5, 0.5)  # all colour in the picture belongs to the structure
    space.shading.light, space.shading.show_cavity = "STUDIO", True
    space.shading.background_type, space.shading.background_color = "VIEWPORT", (0.012, 0.013, 0.016)
    space.overlay.show_overlays = False
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view = scene.camera.matrix_world.inverted()
    projection = scene.camera.calc_matrix_camera(depsgraph, x=width, y=height)
    # Draw the scene, then the planes over it, into a buffer without a window.
    canvas = gpu.types.GPUOffScreen(width, height)
    canvas.draw_view3d(
        scene, bpy.context.view_layer, space, region, view, projection, do_color_management=True, draw_background=True
    )
    with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(view)
        gpu.matrix.load_projection_matrix(projection)
        overlay.paint(scene, size)
        pixels = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "FLOAT")
    pixels.dimensions = width * height * 4
    return np.array(pixels, np.float32).reshape(height, width, 4)[..., :3]


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)

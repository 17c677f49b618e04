# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the documentation, from real runs: `python -m scripts.dev.pictures [--out DIR] [--width PIXELS]`.

Writes planes-ID.png, leaves-ID.png and ray-ID.png of the built-in scene as the viewport first shows them, beam-ID.png
of a tile of rays, costs.png with the steps of two structures on one scale, and front.png with a render next to its
planes. With --readme it writes only those of README.md and docs/, as small .jpg. Needs Blender 5.2 or newer, which
draws without a window. Exit status: 0 done; 2 something failed; 130 stopped. Failures are reported in one line.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command
from addon.core.structures import catalogue
from addon.lab.base.usage import Parser, UsageError, output
from scripts.dev import overlay_picture

ROOT = Path(__file__).resolve().parents[2]

STRUCTURES = ("kd", "bsp-wn-plus-kd", "bvh-sah", "octree-net")
"""One structure for each kind of split."""

BEAM = "octree-beam"
"""The structure of the picture of a tile of rays."""

README = ROOT / ".pictures"
"""The folder of the pictures of README.md and docs/."""

SHOWN = ("planes-bsp-wn-plus-kd", "planes-octree-net", "leaves-kd", f"beam-{BEAM}")
"""Pictures of README.md and docs/, apart from the costs and the front picture."""

BESIDE = ("kd", "bsp-wn-plus-kd")
"""The structures whose costs are compared."""

FRONT, FRONT_SAMPLES, GAP = "planes-bsp-wn-plus-kd", 192, 8
"""The picture next to the render, the samples per pixel of that render, and the pixels between the two."""

RAY = ("3.5", "-5", "2.4", "0", "0.4", "0.7")
"""Origin and target of the ray, from the right of the camera to the middle of the scene: seen from the side."""

ASIDE = ("5.5", "-3", "3.2", "-0.35", "0.75", "1.0")
"""Origin and target of the beam."""

VIEW = ("-1.2", "-8.6", "4.4", "0.6", "-0.2", "1.0")
"""Eye and target of the picture of the beam."""

LEAST = 64
"""Smallest width in pixels."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="pictures", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--out", type=output, help="a folder (default: out/pictures, with --readme .pictures)")
    made.add_argument("--width", type=int, help="pixels across (default: 1280, with --readme 720)")
    made.add_argument("--readme", action="store_true", help="only the pictures of README.md and docs/")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("pictures", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Make the pictures. Returns the exit status. Raises the errors that `main` reports in one line."""
    width = asked.width if asked.width is not None else 720 if asked.readme else 1280
    if not LEAST <= width <= overlay_picture.LARGEST:
        raise UsageError(f"--width: expected {LEAST} to {overlay_picture.LARGEST}, got {width}")
    known = catalogue.load()
    out = asked.out or (README if asked.readme else ROOT / "out" / "pictures")
    size = ["--size", f"{width}x{width * 9 // 16}"]
    # List the pictures with their options.
    jobs: dict[str, list[str]] = {}
    for structure in STRUCTURES:
        common = ["--structure", structure]
        jobs[f"planes-{structure}"] = common
        jobs[f"leaves-{structure}"] = [*common, "--show", "cells", "--least", "8"]
        jobs[f"ray-{structure}"] = [*common, "--show", "ray", "--ray", *RAY]
    beam = ["--structure", BEAM, "--show", "beam", "--pixel", "0.006"]
    jobs[f"beam-{BEAM}"] = [*beam, "--ray", *ASIDE, "--view", *VIEW]
    # Draw the selected ones, then those of costs and of the front page.
    suffix = "jpg" if asked.readme else "png"
    for name in SHOWN if asked.readme else jobs:
        if known.get(jobs[name][1]) is not None:
            status = overlay_picture.main([*jobs[name], *size, "--out", str(out / f"{name}.{suffix}")])
            if status:
                return status
    costs(out / f"costs.{suffix}", width // 2)
    front(out / f"front.{suffix}", out / f"{FRONT}.{suffix}")
    return 0


def costs(path: Path, width: int) -> None:
    """Save the cost maps of two structures side by side; `width`: pixels of each."""
    import bpy

    from addon.blender.measure import cost_maps, pictures
    from addon.lab.pictures import scenes

    scenes.open_file(None)
    scene: Any = bpy.context.scene
    scene.halfspace.structure, scene.halfspace.second = BESIDE
    pictures.save(path, cost_maps.draw(scene, width))
    print(path)


def front(path: Path, planes: Path) -> None:
    """Write a render of the showcase next to the picture of its planes, which has the same camera and size."""
    import bpy
    import numpy as np

    from addon.blender.measure import pictures
    from addon.lab.pictures import scenes

    right = pictures.load(planes)[..., :3]
    height, width = right.shape[:2]
    scenes.open_file(None)
    scene: Any = bpy.context.scene
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", FRONT_SAMPLES
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    left = pictures.save_displayed(path.with_suffix(".png"), pictures.render(scene), scene)
    pictures.save(path, np.concatenate([left, np.ones((height, GAP, 3), np.float32), right], axis=1))
    if path.suffix != ".png":
        path.with_suffix(".png").unlink()
    print(path)


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the documentation, each from a real run: `python scripts/pictures.py [--out DIR] [--width PIXELS]`.

planes-ID.png, leaves-ID.png and ray-ID.png of the built-in scene as the viewport shows them, costs.png with the steps
of two structures on one scale. Opens no window, which needs Blender 5.2 or newer. Exit status: 0 done; 2 something
failed, said in one line.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import overlay_picture

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

STRUCTURES = ("kd", "bsp-wn-plus-kd", "bvh-sah", "octree-net")
"""Those of them that there are: one for each way of dividing."""

BESIDE = ("kd", "octree-net")

RAY = ("3.5", "-5", "2.4", "0", "0.4", "0.7")
"""From the right of the camera to the middle of the scene, so that it is seen from the side."""

BAD_INPUT = 2


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(prog="pictures", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--out", type=Path, default=ROOT / "out" / "pictures", help="a folder (default: out/pictures)")
    made.add_argument("--width", type=int, default=1280, help="pixels across (default: 1280)")
    return made


def main(arguments: Sequence[str]) -> int:
    """Make them all. Returns the exit status."""
    asked = parser().parse_args(arguments)
    try:
        from addon.core import catalogue, native

        known = catalogue.load()
    except native.NativeError as error:
        print(f"pictures: {error}", file=sys.stderr)
        return BAD_INPUT
    size = ["--size", f"{asked.width}x{asked.width * 9 // 16}"]
    jobs = []
    for structure in (name for name in STRUCTURES if known.get(name) is not None):
        common = [*size, "--structure", structure]
        jobs.append([*common, "--depth", "0-7", "--out", str(asked.out / f"planes-{structure}.png")])
        jobs.append([*common, "--show", "cells", "--least", "8", "--out", str(asked.out / f"leaves-{structure}.png")])
        jobs.append([*common, "--show", "ray", "--ray", *RAY, "--out", str(asked.out / f"ray-{structure}.png")])
    for job in jobs:
        status = overlay_picture.main(job)
        if status:
            return status
    try:
        costs(asked.out / "costs.png", asked.width // 2)
    except (OSError, RuntimeError, ValueError) as error:
        print("pictures: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    return 0


def costs(path: Path, width: int) -> None:
    """The steps of two structures side by side."""
    import bpy

    from addon.blender import cost_maps, pictures, scenes

    scenes.open_file(None)
    scene: Any = bpy.context.scene
    scene.halfspace.structure, scene.halfspace.second = BESIDE
    pictures.save(path, cost_maps.draw(scene, width))
    print(path)


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of a rendered 3D view in a real window, next to Cycles: the first picture, and one after each of two edits:
`python -m scripts.dev.edits --window COMMAND [SCENE ...] [--detail FACTOR] [--pictures DIR]`.

For each scene of `addon/lab/pictures/large.py`, one sample and one thread: seconds and processor seconds until the view
shows the new picture, processor seconds until the process rests, the longest time in which Blender's main thread did
not return to its loop, and the longest call of the engine; the rest of a pause is Blender's own. COMMAND opens Blender
on a screen and runs `window/edit_steps.py`, as scripts/dev/window/README.md describes; by default it is that of the
variable HALFSPACE_WINDOW. Exit status: 0 done; 2 something failed; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command
from addon.lab.base.usage import Parser, UsageError, output
from scripts import package

ROOT = Path(__file__).resolve().parents[2]

STEPS = ROOT / "scripts" / "dev" / "window"

WINDOW = "HALFSPACE_WINDOW"
"""Environment variable of the command that opens a window."""

MOVED = {"meadow": ("Ball",), "fur": ("Skin", "Hair"), "woods": ("Leaf",)}
"""Scene to the materials of the objects that are moved, the first of each."""

SECONDS = 900
"""Longest time of the window."""


class EditError(RuntimeError):
    """The window did not measure. The message gives the reason."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="edits", description=(__doc__ or "").splitlines()[0])
    made.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(MOVED)} (default: all)")
    made.add_argument("--window", metavar="COMMAND", help=f"opens a Blender window (default: the variable {WINDOW})")
    made.add_argument("--detail", type=float, default=1.0, help="factor on the numbers of instances and hairs")
    made.add_argument("--pictures", type=output, help="a folder for pictures of the screen")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("edits", arguments, parser().parse_args, run, told=(EditError, package.PackageError))


def run(asked: argparse.Namespace) -> int:
    """Make the scenes, measure them in a window, and print the table. Raises EditError, UsageError, PackageError."""
    window = shlex.split(asked.window or os.environ.get(WINDOW, ""))
    if not window:
        raise UsageError(f"--window: needs a command that opens a Blender window; {STEPS / 'README.md'} describes it")
    if unknown := set(asked.scenes) - set(MOVED):
        raise UsageError(f"{', '.join(sorted(unknown))}: not one of {', '.join(MOVED)}")
    with tempfile.TemporaryDirectory(prefix="edits-") as name:
        # The window sees the folder of its steps only.
        folder = Path(name)
        for file in ("edit_steps.py", "window_areas.py"):
            shutil.copy(STEPS / file, folder)
        for scene in asked.scenes or MOVED:
            compose(scene, asked.detail, folder / f"{scene}.blend")
        (archive,) = package.package(sorted((ROOT / "build" / "wheel").glob("*.whl")), folder)
        rows = measure(window, folder, archive)
        if asked.pictures:
            asked.pictures.mkdir(parents=True, exist_ok=True)
            for picture in folder.glob("last-*.png"):
                shutil.copy(picture, asked.pictures)
    print("scene    engine     event          seconds  processor s  until rest  longest pause ms  longest call ms")
    for row in rows:
        print(
            f"{row['scene']:8} {row['engine'].lower():10} {row['what']:14} {row['seconds']:7.2f} "
            f"{row['processor']:12.2f} {row['all']:11.2f} {row['pause'] * 1e3:17.0f} {row['call'] * 1e3:16.0f}"
        )
    return 0


def compose(name: str, detail: float, path: Path) -> None:
    """Write a scene to a .blend file that both engines show with one sample on one thread."""
    import bpy

    from addon.lab.pictures import large

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    large.build(name, scene, detail=detail)
    wearing = {material: _wearing(scene, material) for material in MOVED[name]}
    scene["moved"] = [wearing[MOVED[name][0]].name]
    # What follows the first one hangs on it, as hair on its skin.
    for material in MOVED[name][1:]:
        wearing[material].parent = wearing[MOVED[name][0]]
        wearing[material].matrix_parent_inverse = wearing[MOVED[name][0]].matrix_basis.inverted()
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.cycles.preview_samples, scene.cycles.use_preview_adaptive_sampling = 1, False
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def _wearing(scene: Any, material: str) -> Any:
    """The first object with this material."""
    return next(one for one in scene.objects if one.active_material and one.active_material.name == material)


def measure(window: Sequence[str], folder: Path, archive: Path) -> list[dict[str, Any]]:
    """Run the steps in a window. Returns the rows of `edits.json`. Raises EditError."""
    words = [*window, str(folder / "edit_steps.py"), str(folder / "last.png"), str(archive)]
    variables = {**os.environ, "GUI_SIZE": "960x640", "GUI_TIMEOUT": str(SECONDS)}
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    found = folder / "edits.json"
    if done.returncode != 0 or not found.is_file():
        said = " ".join((done.stdout + done.stderr).split())[-600:]
        raise EditError(f"the window ended with {done.returncode}: {said}")
    rows: list[dict[str, Any]] = json.loads(found.read_text(encoding="utf-8"))
    return rows


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the newest Blender works: `python -m scripts.dev.newest_blender [--only VERSION] [--write]`.

Installs the newest Blender module of the package index, release candidates too, with the native wheel into a temporary
environment, and tries it there: registration, the walk through all properties, and nine pictures, compared with those
of the Blender of this environment. --write enters the row into the table of docs/platforms.md. Exit status: 0 it
registers, renders, and the walk passes; 1 something does not; 2 bad usage, or the set-up failed, with one line; 130
stopped.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from addon.core.base import command
from addon.core.report import results
from addon.lab.base.usage import Parser
from scripts.dev import environment
from scripts.dev.environment import CURRENT, ROOT, Environment

PAGE = ROOT / "docs" / "platforms.md"
BEGIN, END = "<!-- newest Blender: begin -->\n", "<!-- newest Blender: end -->\n"

HEAD = (
    "| Blender | Python | registers | properties walked | pictures of 9 as in the other Blender |\n"
    "| --- | --- | --- | --- | --- |\n"
)

WALK = "tests/blender/read/test_every_setting.py"
"""The test that changes each property that a picture may depend on."""

SIZE, SAMPLES = (96, 64), 4

INSIDE = """
import json, platform, sys
import bpy, numpy as np
import addon
from addon.blender.measure import pictures
from addon.lab.pictures import engines, proving

addon.register()
found = {"blender": bpy.app.version_string, "python": platform.python_version()}
found["registers"] = hasattr(bpy.context.scene, "halfspace")
made, (width, height), samples = {}, json.loads(sys.argv[2]), int(sys.argv[3])
for name in proving.SCENES:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    proving.build(name, scene, detail=0.25)
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    engines.configure_halfspace(scene, "kd", samples, 4)
    made[name] = pictures.render(scene)
addon.unregister()
np.savez(sys.argv[1], **made)
print("FOUND " + json.dumps(found), flush=True)
# Blender 4.5 as a module hangs at the interpreter's end after a render.
import os
os._exit(0)
"""
"""What runs in each of the two environments: the file of the pictures, their size and samples are its arguments."""


def newest(folder: Path, only: str | None) -> Path:
    """The interpreter of a new environment with the newest Blender, or `only` that version. Raises SetupError."""
    made = Environment("newest", CURRENT.version, folder / "venv", ())
    environment.make(made)
    wheel, _ = environment.build_wheel(Path(sys.executable))
    # A version with a suffix admits release candidates of this package alone.
    wanted = f"bpy=={only}" if only else "bpy>=5.0a0"
    words = ["pip", "install", "--quiet", "--python", str(made.python), wanted, str(wheel), "--group", "test"]
    environment.uv(words, "the newest Blender could not be installed")
    environment.provide_libraries(made)
    return made.python


def tried(python: Path, file: Path) -> dict[str, Any] | str:
    """What a Blender did, its pictures in the file; or the last line that it printed, if it failed."""
    words = [str(python), "-c", INSIDE, str(file), json.dumps(SIZE), str(SAMPLES)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("FOUND ")]
    if done.returncode or not lines:
        return next(reversed((done.stdout + done.stderr).strip().splitlines()), f"ended with {done.returncode}")
    found: dict[str, Any] = json.loads(lines[0].removeprefix("FOUND "))
    return found


def walked(python: Path) -> str:
    """The closing line of the walk through all properties, without its time."""
    words = [str(python), "-m", "pytest", "-q", "--no-header", WALK]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    last = next(reversed(done.stdout.strip().splitlines()), "no tests")
    return last.partition(" in ")[0].strip("= ")


def compared(file: Path, other: Path) -> str:
    """The number of pictures that are the same bit for bit, and how far the others are apart."""
    with np.load(file) as ours, np.load(other) as theirs:
        apart = {name: float(np.abs(ours[name] - theirs[name]).mean()) for name in ours.files}
        means = {name: float(np.abs(theirs[name]).mean()) for name in ours.files}
    different = [f"{name} {100 * apart[name] / (means[name] or 1):.2g} %" for name in apart if apart[name]]
    return f"{len(apart) - len(different)}" + (f"; mean difference: {', '.join(different)}" if different else "")


def replaced(page: str, row: str, blender: str) -> str:
    """The page with this row in its table, in place of an older one of the same Blender."""
    before, _, rest = page.partition(BEGIN)
    table, _, after = rest.partition(END)
    kept = [line for line in table.splitlines(keepends=True)[2:] if not line.startswith(f"| {blender} |")]
    return f"{before}{BEGIN}{HEAD}{''.join(kept)}{row}{END}{after}"


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="newest_blender", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="VERSION", help="this version instead of the newest")
    parser.add_argument("--write", action="store_true", help="enter the row into docs/platforms.md")
    return command.run("newest_blender", arguments, parser.parse_args, run, told=(environment.SetupError,))


def run(asked: argparse.Namespace) -> int:
    """Try it, and print its row. Returns the exit status. Raises SetupError and FolderError."""
    with tempfile.TemporaryDirectory(prefix="newest-blender-") as name:
        folder = Path(name)
        with environment.alone():
            python = newest(folder, asked.only)
        base, found = (tried(one, folder / f"{i}.npz") for i, one in enumerate((Path(sys.executable), python)))
        if isinstance(base, str) or isinstance(found, str):
            print(f"FAILED: {base if isinstance(base, str) else found}")
            return 1
        walk = walked(python)
        same = compared(folder / "1.npz", folder / "0.npz")
    registers = "yes" if found["registers"] else "no"
    row = f"| {found['blender']} | {found['python']} | {registers} | {walk} | {same} (of {base['blender']}) |\n"
    print(HEAD + row, end="")
    if asked.write:
        results.write(PAGE, replaced(PAGE.read_text(encoding="utf-8"), row, found["blender"]))
    return int(not found["registers"] or "passed" not in walk or "failed" in walk or "error" in walk)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

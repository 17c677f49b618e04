# SPDX-License-Identifier: GPL-3.0-or-later
"""Three short animations of the documentation, from a real Blender window:
`python -m scripts.dev.animations --window COMMAND [--only NAME] [--out DIR]`.

Writes depth.webp (the depth sliders over a kd-tree), ray.webp (a ray is picked and followed step by step) and
use-this-one.webp (*Compare*, then *Use This One*). COMMAND opens Blender on a screen and runs the steps of
scripts/dev/window, as scripts/dev/window/README.md describes; by default it is that of the variable HALFSPACE_WINDOW.
The extension is packaged from the wheel in build/wheel. Needs Pillow. Exit status: 0 done; 2 something failed; 130
stopped. Failures are reported in one line.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from addon.core.base import command
from addon.lab.base.usage import Parser, UsageError, output
from scripts import package

ROOT = Path(__file__).resolve().parents[2]

PICTURES = ROOT / ".pictures"

STEPS = ROOT / "scripts" / "dev" / "window"

WINDOW = "HALFSPACE_WINDOW"
"""Environment variable of the command that opens a window."""

ANIMATIONS = {
    "depth": ("depth_steps", "900x640"),
    "ray": ("ray_steps", "900x640"),
    "use-this-one": ("use_steps", "900x940"),
}
"""Name to the file of its steps and the size of the screen in pixels."""

SECONDS = 580
"""Longest time of a window."""

QUALITY = 80
"""Quality of the frames in percent: letters stay readable."""


class AnimationError(RuntimeError):
    """An animation cannot be made. The message gives the reason."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="animations", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--window", metavar="COMMAND", help=f"opens a Blender window (default: the variable {WINDOW})")
    made.add_argument("--only", choices=tuple(ANIMATIONS), help="only this one")
    made.add_argument("--out", type=output, default=PICTURES, help="a folder (default: .pictures)")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("animations", arguments, parser().parse_args, run, told=(AnimationError, package.PackageError))


def run(asked: argparse.Namespace) -> int:
    """Make the animations. Returns the exit status. Raises the errors that `main` reports in one line."""
    window = shlex.split(asked.window or os.environ.get(WINDOW, ""))
    if not window:
        raise UsageError(f"--window: needs a command that opens a Blender window; {STEPS / 'README.md'} describes it")
    asked.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="animations-") as name:
        wheels = sorted((ROOT / "build" / "wheel").glob("*.whl"))
        (archive,) = package.package(wheels, Path(name))
        for animation in [asked.only] if asked.only else ANIMATIONS:
            folder = Path(name) / animation
            folder.mkdir()
            record(window, animation, archive, folder)
            path = asked.out / f"{animation}.webp"
            frames = assemble(folder, animation, path)
            print(f"{path} ({path.stat().st_size / 1024:.0f} KiB, {frames} frames)", flush=True)
    return 0


def record(window: Sequence[str], animation: str, archive: Path, folder: Path) -> None:
    """Run the steps of an animation in a window, which leaves pictures and a list in a folder. Raises AnimationError.

    window: the command. archive: the zip of the extension.
    """
    steps, size = ANIMATIONS[animation]
    words = [*window, str(STEPS / f"{steps}.py"), str(folder / "last.png"), str(archive)]
    variables = {**os.environ, "GUI_SIZE": size, "GUI_TIMEOUT": str(SECONDS)}
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    if done.returncode != 0 or not (folder / f"{animation}.json").is_file():
        said = " ".join((done.stdout + done.stderr).split())[-600:]
        raise AnimationError(f"{animation}: the window ended with {done.returncode}: {said}")


def assemble(folder: Path, animation: str, path: Path) -> int:
    """Write the pictures that NAME.json of a folder lists as an endless animation. Returns the number of frames.

    The list has `box`, the part of the screen that is kept (left, top, right, bottom in pixels), and `frames`, names of
    pictures `last-NAME.png` with milliseconds. Equal pictures after one another are joined. Raises OSError.
    """
    from PIL import Image

    found = json.loads((folder / f"{animation}.json").read_text(encoding="utf-8"))
    shown: list[Image.Image] = []
    durations: list[int] = []
    for name, milliseconds in found["frames"]:
        with Image.open(folder / f"last-{name}.png") as picture:
            frame = picture.convert("RGB").crop(found["box"])
        if shown and frame.tobytes() == shown[-1].tobytes():
            durations[-1] += milliseconds
            continue
        shown.append(frame)
        durations.append(milliseconds)
    shown[0].save(path, save_all=True, append_images=shown[1:], duration=durations, loop=0, quality=QUALITY, method=4)
    return len(shown)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

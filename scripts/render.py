# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a picture with Halfspace, without a Blender window: `python scripts/render.py [FILE.blend] [options]`.

Without a file the built-in showcase is rendered. Exit status: 0 done; 2 bad usage or input, said in one line.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

BAD_INPUT = 2


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(prog="render", description=(__doc__ or "").splitlines()[0])
    made.add_argument("file", nargs="?", type=Path, help="a .blend file (default: the built-in showcase)")
    made.add_argument("--out", type=Path, default=ROOT / "out" / "showcase.png", help="the picture, .png")
    made.add_argument("--structure", default="kd", metavar="ID", help="the acceleration structure (default: kd)")
    made.add_argument("--samples", type=int, help="samples per pixel (default: the file's)")
    made.add_argument(
        "--integrator", choices=("path", "whitted", "ao"), help="how light is followed (default: the file's)"
    )
    made.add_argument("--percentage", type=int, help="size in percent of the file's (default: the file's)")
    return made


def main(arguments: Sequence[str]) -> int:
    """Render. Returns the exit status."""
    asked = parser().parse_args(arguments)
    problem = _problem(asked)
    if problem is None:
        problem = _render(asked)
    if problem is not None:
        print(f"render: {problem}", file=sys.stderr)
        return BAD_INPUT
    return 0


def _problem(asked: argparse.Namespace) -> str | None:
    """What is wrong with the command line, found before any work."""
    if asked.file is not None and not asked.file.is_file():
        return f"{asked.file}: there is no such file"
    for name in ("samples", "percentage"):
        value = getattr(asked, name)
        if value is not None and value < 1:
            return f"--{name}: expected at least 1, got {value}"
    if asked.out.suffix.lower() != ".png":
        return f"{asked.out}: expected a name that ends in .png"
    try:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=asked.out.parent):
            pass
    except OSError as error:
        return f"{asked.out.parent}: cannot be written: {error.strerror}"
    return None


def _render(asked: argparse.Namespace) -> str | None:
    """Render with Blender's module. Returns what went wrong, or None."""
    import bpy

    import addon
    from addon.core import native

    reason = native.problem()
    if reason is not None:
        return reason
    addon.register()
    reason = _open(bpy, asked.file)
    if reason is not None:
        return reason
    scene: Any = bpy.context.scene
    bpy.app.handlers.render_stats.append(_Progress())
    reason = _configure(scene, asked)
    if reason is not None:
        return reason
    # The picture takes its name only when it is complete.
    with tempfile.TemporaryDirectory(dir=asked.out.parent, prefix=".render-") as folder:
        picture = Path(folder) / "picture.png"
        scene.render.filepath = str(picture)
        start = time.perf_counter()
        try:
            bpy.ops.render.render(write_still=True)
        except RuntimeError as error:
            return " ".join(str(error).removeprefix("Error:").split())
        if not picture.is_file():
            return "nothing was rendered"
        picture.replace(asked.out)
    print(f"{asked.out}: {_size(scene)} pixels in {time.perf_counter() - start:.1f} s with {asked.structure}")
    return None


class _Progress:
    """Prints what the engine tells of its progress, now and then."""

    SECONDS = 5.0

    def __init__(self) -> None:
        self.last = time.monotonic()

    def __call__(self, stats: Any, *_: Any) -> None:
        if isinstance(stats, str) and time.monotonic() - self.last >= self.SECONDS:
            self.last = time.monotonic()
            print(f"[render] {stats}", flush=True)


def _open(bpy: Any, file: Path | None) -> str | None:
    if file is None:
        from addon.blender import showcase

        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        showcase.build(bpy.context.scene)
        return None
    try:
        bpy.ops.wm.open_mainfile(filepath=str(file))
    except RuntimeError as error:
        return f"{file}: Blender cannot read it: {' '.join(str(error).removeprefix('Error:').split())}"
    return None


def _configure(scene: Any, asked: argparse.Namespace) -> str | None:
    scene.render.engine = "HALFSPACE"
    scene.render.image_settings.file_format = "PNG"
    try:
        scene.halfspace.structure = asked.structure
    except TypeError:
        known = scene.halfspace.bl_rna.properties["structure"].enum_items.keys()
        return f"--structure: unknown structure {asked.structure!r}; there are {', '.join(known)}"
    if asked.samples is not None:
        scene.halfspace.samples = asked.samples
    if asked.integrator is not None:
        scene.halfspace.integrator = asked.integrator
    if asked.percentage is not None:
        scene.render.resolution_percentage = asked.percentage
    return None


def _size(scene: Any) -> str:
    share = scene.render.resolution_percentage / 100
    return f"{int(scene.render.resolution_x * share)} × {int(scene.render.resolution_y * share)}"


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5 as a module hangs at the interpreter's end after a render.
    os._exit(result)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of docs/pictures.md: `python -m scripts.dev.composed_pictures [SCENE ...] [--out DIR] [--size WxH]`.

Renders the two scenes of `composed.py` with Halfspace and with Cycles at equal settings, several times with
different random numbers. Writes composed-SCENE.jpg, Halfspace left and Cycles right, and prints a row of the page's
table for each scene: the difference of the means, the largest difference of a square of 16 × 16 pixels in standard
errors, and the seconds of the processor. Exit status: 0 done; 2 something failed; 130 stopped. Failures are reported in
one line.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command, interrupt, native
from addon.core.structures import specs
from addon.lab.base.usage import Parser, UsageError, output

ROOT = Path(__file__).resolve().parents[2]

RUNS, BOUNCES, GAP = 3, 4, 6
"""Pictures of each engine, bounces of light, and pixels between both pictures."""

STRUCTURE = "bvh-sah"
"""The structure whose build is shortest; all give the same picture."""

HEAD = "| scene | means % | largest square | processor s, both |\n| --- | --- | ---: | --- |"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="composed_pictures", description=(__doc__ or "").splitlines()[0])
    made.add_argument("scenes", nargs="*", metavar="SCENE", help="default: both")
    made.add_argument("--out", type=output, default=ROOT / ".pictures", help="a folder (default: .pictures)")
    made.add_argument("--size", default="360x240", metavar="WxH", help="pixels of one picture (default: 360x240)")
    made.add_argument("--samples", type=int, default=48, help="samples per pixel, all runs together (default: 48)")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("composed_pictures", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Make the pictures. Returns the exit status. Raises the errors that `main` reports in one line."""
    width, _, height = asked.size.partition("x")
    if not all(specs.is_whole(side) and 32 <= int(side) <= 4096 for side in (width, height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT of 32x32 to 4096x4096, got {asked.size!r}")
    if asked.samples < RUNS:
        raise UsageError(f"--samples: expected at least {RUNS}, got {asked.samples}")
    with interrupt.guarded():
        import bpy

        import addon

        native.load()
        addon.register()
    from addon.lab.pictures import composed

    if unknown := set(asked.scenes) - set(composed.SCENES):
        raise UsageError(f"expected some of {', '.join(composed.SCENES)}, got {min(unknown)!r}")
    rows = []
    for name in asked.scenes or composed.SCENES:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        composed.SCENES[name](bpy.context.scene)
        rows.append(compare(name, bpy.context.scene, (int(width), int(height)), asked.samples, asked.out))
        print(rows[-1], flush=True)
    print("\n".join(["", HEAD, *rows]))
    return 0


def compare(name: str, scene: Any, size: tuple[int, int], samples: int, out: Path) -> str:
    """Render a scene with both engines and write its picture. Returns its row of the table."""
    import numpy as np

    from addon.blender.measure import pictures
    from addon.lab.pictures import comparison, engines

    # Give both engines the same settings.
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.use_border, render.film_transparent, render.use_compositing = False, False, False
    engines.configure_halfspace(scene, STRUCTURE, -(-samples // RUNS), BOUNCES)
    engines.configure_cycles(scene, -(-samples // RUNS), BOUNCES)
    # Render in turns.
    found: dict[str, list[Any]] = {"HALFSPACE": [], "CYCLES": []}
    worked = dict.fromkeys(found, 0.0)
    for seed in range(RUNS):
        for engine, runs in found.items():
            render.engine = engine
            scene.halfspace.render_seed = scene.cycles.seed = seed
            begun = time.process_time()
            runs.append(pictures.render(scene))
            worked[engine] += time.process_time() - begun
    # Write both pictures side by side, and judge their difference.
    both = [comparison.Runs(engine, comparison.stack(runs)) for engine, runs in found.items()]
    shown = []
    for one in both:
        path = out / f"composed-{name}-{one.name.lower()}.png"
        shown.append(pictures.save_displayed(path, one.mean.astype("float32"), scene))
        path.unlink()
    gap = np.ones((size[1], GAP, 3), np.float32)
    pictures.save(out / f"composed-{name}.jpg", np.concatenate([shown[0], gap, shown[1]], axis=1))
    verdict = comparison.judge(*both)
    means = " ".join(f"{100 * mean:+.2f}" for mean in verdict.means)
    seconds = " / ".join(f"{worked[engine]:.0f}" for engine in found)
    return f"| {name} | {means} | {verdict.worst:.1f} | {seconds} |"


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5 as a module hangs at the interpreter's end after a render.
    os._exit(result)

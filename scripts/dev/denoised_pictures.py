# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP of denoised pictures compared with those of Cycles: `python -m scripts.dev.denoised_pictures [SCENE ...]`.

Renders scenes of `compare --scene` with both engines at equal settings and few samples, with and without Denoise,
and prints the mean FLIP of each picture against the mean of a converged picture of both. With `--frames N` instead, how
much a still scene boils: the variance from frame to frame of N frames with noise of their own, at Cycles' default
sampling pattern. Exit status: 0 done; 2 something failed; 130 stopped. Failures are reported in one line.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from addon.core.base import command, interrupt, native
from addon.core.base.arrays import F32, F64
from addon.core.measure import flip, inference
from addon.core.structures import specs
from addon.lab.base.usage import Parser, UsageError

BOUNCES = 4
STRUCTURE = "bvh-sah"
"""The structure whose build is shortest; all give the same picture."""

ENGINES = ("HALFSPACE", "CYCLES")

GROUP, SIDES = 5, (1, 8)
"""Frames whose variance is estimated together, and sides of the blocks of pixels whose means are compared."""

BOILING = "| scene | blocks | noise: ours over Cycles | denoised: ours over Cycles |\n| --- | ---: | ---: | ---: |"
"""Head of the table of variances from frame to frame, with 95 % intervals."""

HEAD = (
    "| scene | noise, ours | noise, Cycles | denoised, ours | denoised, Cycles |\n| --- | ---: | ---: | ---: | ---: |"
)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="denoised_pictures", description=(__doc__ or "").splitlines()[0])
    made.add_argument("scenes", nargs="*", metavar="SCENE", help="default: cornell spheres")
    made.add_argument("--size", default="240x160", metavar="WxH", help="pixels of one picture (default: 240x160)")
    made.add_argument("--samples", type=int, default=16, help="samples per pixel (default: 16)")
    made.add_argument("--runs", type=int, default=3, help="pictures of each kind, with other noise (default: 3)")
    made.add_argument("--frames", type=int, metavar="N", help=f"measure boiling in N frames, at least {2 * GROUP}")
    made.add_argument("--reference", type=int, default=1024, help="samples of each converged picture (default: 1024)")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("denoised_pictures", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Measure. Returns the exit status. Raises the errors that `main` reports in one line."""
    width, _, height = asked.size.partition("x")
    if not all(specs.is_whole(side) and 32 <= int(side) <= 4096 for side in (width, height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT of 32x32 to 4096x4096, got {asked.size!r}")
    if min(asked.samples, asked.reference, asked.runs) < 1:
        raise UsageError("--samples, --reference and --runs: expected at least 1")
    if asked.frames is not None and asked.frames < 2 * GROUP:
        raise UsageError(f"--frames: expected at least {2 * GROUP}, got {asked.frames}")
    if asked.frames is None and (reason := flip.problem()):
        raise UsageError(reason)
    with interrupt.guarded():
        import bpy

        import addon

        native.load()
        addon.register()
    from addon.lab.pictures import proving

    if unknown := set(asked.scenes) - set(proving.SCENES):
        raise UsageError(f"expected some of {', '.join(proving.SCENES)}, got {min(unknown)!r}")
    print(HEAD if asked.frames is None else BOILING, flush=True)
    for name in asked.scenes or ("cornell", "spheres"):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        proving.build(name, bpy.context.scene)
        render = bpy.context.scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = int(width), int(height), 100
        render.use_border, render.film_transparent, render.use_compositing = False, False, False
        if asked.frames is not None:
            for line in boiling(bpy.context.scene, asked):
                print(f"| {name} | {line} |", flush=True)
            continue
        found = measured(bpy.context.scene, asked)
        print(f"| {name} | {' | '.join(f'{value:.4f}' for value in found)} |", flush=True)
    return 0


def boiling(scene: Any, asked: argparse.Namespace) -> list[str]:
    """Rows of the table of variances from frame to frame."""

    def frames(engine: str, *, denoised: bool) -> F32:
        shots = (
            rendered(scene, engine, asked.samples, denoised=denoised, seed=seed, pattern="AUTOMATIC")
            for seed in range(asked.frames)
        )
        return np.stack(list(shots))

    kinds = [[frames(engine, denoised=denoised) for engine in ENGINES] for denoised in (False, True)]
    rows = []
    for side in SIDES:
        ratios = [against(*(variances(shots, side) for shots in both)) for both in kinds]
        texts = [f"{middle:.2f} ({low:.2f} to {high:.2f})" for middle, low, high in ratios]
        rows.append(" | ".join([f"{side} × {side}", *texts]))
    return rows


def variances(shots: F32, side: int) -> F64:
    """(groups,), the variance over GROUP frames each, in the mean over blocks of `side` × `side` pixels.

    shots: (frames, h, w, 3) linear light, of which the brightness is compared as a display shows it.
    """
    light = np.clip(shots.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722]), 0.0, 1.0)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    count, height, width = shown.shape[0] // GROUP * GROUP, shown.shape[1] // side, shown.shape[2] // side
    whole = shown[:count, : height * side, : width * side].reshape(-1, GROUP, height, side, width, side)
    found: F64 = whole.mean(axis=(3, 5)).var(axis=1, ddof=1).mean(axis=(1, 2))
    return found


def against(ours: F64, theirs: F64) -> tuple[float, float, float]:
    """Ratio of two engines' variances, and its 95 % interval by those of the groups (Student)."""
    ratios = np.log(ours / theirs)
    reach = inference.student_quantile(inference.CONFIDENCE, len(ratios) - 1)
    middle, half = float(ratios.mean()), reach * float(ratios.std(ddof=1)) / math.sqrt(len(ratios))
    return math.exp(middle), math.exp(middle - half), math.exp(middle + half)


def measured(scene: Any, asked: argparse.Namespace) -> list[float]:
    """Mean FLIP of both engines with noise, then of both denoised."""
    converged = [rendered(scene, engine, asked.reference, denoised=False, seed=1000) for engine in ENGINES]
    reference = np.ascontiguousarray(np.mean(converged, axis=0), np.float32)

    def error(engine: str, *, denoised: bool) -> float:
        runs = (rendered(scene, engine, asked.samples, denoised=denoised, seed=seed) for seed in range(asked.runs))
        return float(np.mean([flip.mean(picture, reference) for picture in runs]))

    return [error(engine, denoised=denoised) for denoised in (False, True) for engine in ENGINES]


def rendered(
    scene: Any, engine: str, samples: int, *, denoised: bool, seed: int, pattern: str = "TABULATED_SOBOL"
) -> Any:
    """A picture, (h, w, 3) linear float32. Both engines denoise by their defaults for final renders. pattern: of
    Cycles' samples.
    """
    from addon.blender.measure import pictures
    from addon.lab.pictures import engines

    engines.configure_halfspace(scene, STRUCTURE, samples, BOUNCES)
    engines.configure_cycles(scene, samples, BOUNCES)
    scene.halfspace.use_denoising = scene.cycles.use_denoising = denoised
    scene.cycles.denoiser, scene.cycles.sampling_pattern = "OPENIMAGEDENOISE", pattern
    scene.halfspace.render_seed = scene.cycles.seed = seed
    scene.render.engine = engine
    return pictures.render(scene)[..., :3]


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5 as a module hangs at the interpreter's end after a render.
    os._exit(result)

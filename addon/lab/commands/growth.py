# SPDX-License-Identifier: GPL-3.0-or-later
"""How building and tracing grow with the number of triangles: ten thousand to ten million, one surface, the same rays.

`halfspace growth [options]`. Every tessellation is first proved against brute force, bit for bit; only then
anything is timed. With `--out` it writes growth.json and growth.html, again after each line, with the fits of c n log n
to the builds and of a + b log n to the rays. Exit status: 0 all answers agree with brute force; 1 some answer differs;
2 bad usage, or something could not be built; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from ...core.base import command, native
from ...core.report import results
from ...core.scene import rays
from ...core.structures import specs
from ..base.usage import Parser, UsageError, output
from ..growth import growth
from ..growth import report as growth_report

if TYPE_CHECKING:
    from ...core.base.interface import Native

STRUCTURES = "kd,bsp-wn-plus-kd"

BAD_INPUT = 2


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="growth", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add("--structures", default=STRUCTURES, metavar="SPEC[,SPEC...]", help=f"configurations (default: {STRUCTURES})")
    add("--triangles", metavar="N[,N...]", help="sizes, e.g. 1e4,1e5 (default: half decades from 1e4 to 1e7)")
    add("--threads", type=int, default=2, metavar="N", help="threads to compare with one in builds (default: 2)")
    add("--repeats", type=int, default=3, help="repeats of builds and passes, of which the least counts (default: 3)")
    add("--size", type=int, default=512, metavar="PIXELS", help="along each side of the view (default: 512)")
    add("--check-rays", type=int, default=4096, metavar="N", help="rays per set to compare at most (default: 4096)")
    add("--ray-seed", type=int, default=1, help="seed of the rays (default: 1)")
    add("--memory-limit", type=float, metavar="GB", help="what a build may take (default: most of what is free)")
    add("--no-peak", action="store_true", help="leave out the builds in processes of their own that tell their memory")
    add("--out", type=output, metavar="DIR", help="write growth.json and growth.html")
    return made


def main(arguments: Sequence[str]) -> int:
    """Measure and print. Returns the exit status."""
    return command.run("growth", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Check everything, then measure. Raises one of the errors that `main` turns into a line."""
    module = native.load()
    chosen = specs.prove(module, specs.expand(asked.structures, module.structures(), {}, []))
    try:
        growth.refuse_lazy(chosen)
    except growth.LazyError as error:
        raise UsageError(f"--structures: {error}") from error
    options = read_options(asked)
    if asked.out is not None:
        results.prepare_folder(asked.out)
    points = []
    for event in growth.measure(module, chosen, options):
        if isinstance(event, growth.Point):
            points.append(event)
            print("  ".join(growth_report.cells(event, points)), flush=True)
            if asked.out is not None:  # so that a run that is stopped leaves what it has
                save(asked.out, module, points, options)
        else:
            say(event)
    print("\n" + growth_report.as_text(points) + "\n", flush=True)
    for point in points:
        for line in [*point.left_out, *([point.error] if point.error else [])]:
            print(f"growth: {point.spec}, {point.triangles:,} triangles: {line}", file=sys.stderr)
    if asked.out is not None:
        say(f"wrote {asked.out / 'growth.html'} and growth.json")
    if any(point.errors is not None and not point.right for point in points):
        return 1
    return BAD_INPUT if any(point.error for point in points) else 0


def save(folder: Path, module: Native, points: Sequence[growth.Point], options: growth.Options) -> None:
    """Write both files, each whole or not at all. Raises FolderError."""
    document = results.document(module, [point.as_row() for point in points], asdict(options))
    document["fits"] = growth_report.fits(points)
    with results.writing(folder):
        results.write_all(
            {
                folder / "growth.json": json.dumps(document, indent=1, allow_nan=False) + "\n",
                folder / "growth.html": growth_report.as_html(document, points),
            }
        )


def read_options(asked: argparse.Namespace) -> growth.Options:
    """The options, checked. Raises UsageError."""
    for name, least, most in (
        ("threads", 1, 1024),
        ("repeats", 1, 1000),
        ("check_rays", 1, 1 << 30),
        ("ray_seed", 0, rays.MOST_SEED),
        ("size", rays.TILE, 1 << 12),
    ):
        if not least <= getattr(asked, name) <= most:
            given = getattr(asked, name)
            raise UsageError(f"--{name.replace('_', '-')}: expected {least} to {most}, got {given}")
    if asked.size % rays.TILE:
        raise UsageError(f"--size: expected a multiple of {rays.TILE}, got {asked.size}")
    if asked.memory_limit is not None and not 0 <= asked.memory_limit < 1 << 30:
        raise UsageError(f"--memory-limit: expected a number of gigabytes, got {asked.memory_limit}")
    return growth.Options(
        sizes=growth.SIZES if asked.triangles is None else read_sizes(asked.triangles),
        threads=tuple(sorted({1, asked.threads})),
        repeats=asked.repeats,
        size=(asked.size, asked.size),
        check_rays=asked.check_rays,
        seed=asked.ray_seed,
        peak=not asked.no_peak,
        memory_limit=None if asked.memory_limit is None else int(asked.memory_limit * 1e9),
    )


def read_sizes(text: str) -> tuple[int, ...]:
    """Numbers of triangles, the smallest first. Raises UsageError and SpecError."""
    found = {float(value) for value in specs.numbers(text, "--triangles")}
    if not all(growth.LEAST <= value <= growth.MOST for value in found):
        raise UsageError(f"--triangles: expected {growth.LEAST} to {growth.MOST} each, got {text!r}")
    return tuple(sorted(map(round, found)))


def say(text: str) -> None:
    """Tell what is being done."""
    print(f"[growth] {text}", flush=True)

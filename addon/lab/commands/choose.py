# SPDX-License-Identifier: GPL-3.0-or-later
"""Quality of the automatic choice: `halfspace choose SCENE [...] [options]`.

Prints for each scene the chosen configuration, the cost of choosing, and the times of all candidates, each of them
built, compared with brute force and timed in full. Exit status: 0 done; 2 bad usage or input, with the reason in one
line; 130 stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...core.base import command, native, room
from ...core.choose import auto, choice
from ...core.measure import check
from ...core.measure.reference import Reference, affordable
from ...core.scene import rays
from ...core.scene.workload import Workload, left_out
from ...core.structures import catalogue
from ..base.usage import Parser, UsageError
from ..bench import scenes

if TYPE_CHECKING:
    from ...core.base.interface import Native

REPEATS = 3
GOOD = 1.1
"""Largest ratio to the best total that counts as well chosen."""


FINE = 960, 544
"""Width and height of the view whose rays are timed. With the fewer pixels of a choice, neighbouring rays are less
coherent than in the picture, and another structure may appear the best.
"""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="choose", description=(__doc__ or "").splitlines()[0])
    made.add_argument("scenes", nargs="+", metavar="SCENE", help=scenes.CHOICES)
    made.add_argument("--samples", type=int, default=32, help="samples per pixel of the picture (default: 32)")
    made.add_argument("--pixels", type=int, default=1920 * 1080, help="pixels of the picture (default: 1920 x 1080)")
    made.add_argument("--threads", type=int, default=1, help="0 = all; 1, the default, is timed by the processor")
    return made


def full(
    module: Native, workload: Workload, plan: choice.Plan, specs: Sequence[str], threads: int
) -> choice.Comparison:
    """Every candidate built, compared with brute force and timed in full, interleaved."""
    built, builds = {}, {}
    for spec in specs:
        built[spec], builds[spec] = check.timed_build(module, workload, spec, threads)
    first = built[specs[0]]
    counted = choice.mix(module, first, workload, auto.SIZE, plan.max_bounces)
    size = auto.view_of(plan.pixels, FINE)
    room.check(module, "the rays", rays.bytes_needed(size, choice.SETS))
    sets = [some for some in rays.make(workload, first, size=size, seed=2, names=choice.SETS) if len(some)]
    wanted = min(auto.CHECKED, affordable(workload))
    reference = Reference(module, workload, sets, wanted, seed=2, threads=threads)
    rates: dict[str, dict[str, list[float]]] = {spec: {some.name: [] for some in sets} for spec in specs}
    for _ in range(REPEATS):
        for spec in specs:
            for some in sets:
                rates[spec][some.name].append(check.rate(built[spec], some, 1))
    lines = []
    for spec in specs:
        wrong = reference.wrong(built[spec])
        least, most = counted.bounds(rates[spec], plan, threads or os.cpu_count() or 1)
        problem = "wrong answers" if wrong else ""
        lines.append(choice.Line(spec, builds[spec], least, wrong, len(reference), problem, least, most))
    return choice.Comparison(plan, tuple(sorted(lines, key=lambda line: (bool(line.problem), line.total))))


def main(arguments: Sequence[str]) -> int:
    """Choose and compare on each scene. Returns the exit status."""
    return command.run("choose", arguments, read, run)


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked. Raises UsageError."""
    asked = parser().parse_args(arguments)
    for name, least, most in (("samples", 1, 1 << 20), ("pixels", 1, 1 << 32), ("threads", 0, 1024)):
        if not least <= getattr(asked, name) <= most:
            raise UsageError(f"--{name}: expected {least} to {most}, got {getattr(asked, name)}")
    return asked


def run(asked: argparse.Namespace) -> int:
    """Check everything, then measure. Raises one of the errors that `main` turns into a line."""
    plan = choice.Plan(asked.pixels, asked.samples)
    good = 0
    loaders = [scenes.loader(scene, FINE) for scene in asked.scenes]
    module, known = native.load(), catalogue.load()
    for load in loaders:
        workload = load()
        chosen = auto.choose(module, workload, plan, known, threads=asked.threads)
        compared = full(module, workload, plan, auto.candidates(known), asked.threads)
        best, own = compared.lines[0], next(line for line in compared.lines if line.spec == chosen.spec)
        ratio = own.total / best.total if best.total else 1.0
        is_equal = own in (best, *compared.equal)
        good += ratio <= GOOD or is_equal
        print(f"{workload.name}: chose {chosen.spec}, {own.total:.2f} s; best {best.spec}, {best.total:.2f} s")
        verdict = "" if own is best else ", which the repeats do not separate from it" if is_equal else ", and slower"
        print(f"  {ratio:.3f} times the best{verdict}; choosing took {chosen.own:.2f} s in addition to its build")
        for line in compared.lines:
            times = f"build {line.build:8.2f} s  trace {line.trace:8.2f} s  total {line.total:8.2f} s"
            print(f"  {line.spec:<36} {times}  {line.answers}")
        notes = [*workload.notes, *left_out(workload, chosen.structure.statistics["dropped_triangles"])]
        for note in (*notes, *chosen.notes):
            print(f"  {note}")
        sys.stdout.flush()
    print(f"{good} of {len(asked.scenes)} within {GOOD - 1:.0%} of the best, or not separated from it")
    return 0

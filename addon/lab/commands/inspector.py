# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as a page: `halfspace inspector [SCENE] [--structures SPEC[,SPEC...]] [--out FILE]`.

Writes one self-contained page that opens offline: maps of steps, time, tests, wasted tests, overlap, any-hit cost and
leaf depth side by side with one cursor and range handles, the worst camera, shadow and bounce rays with their reasons
and steps, the trees node by node, and the cost of each level. Exit status: 0 written; 2 bad usage or input, and an
older page stays; 130 stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ...core.base import command, native
from ...core.measure import costmap
from ...core.report import results
from ...core.structures import specs
from ..base.places import OUT
from ..base.usage import Parser, UsageError, output
from ..bench import inspecting, scenes

LEAST, MOST = 8, 2048
"""Limits of the width of the view in pixels."""

SHAPE = 16, 9
"""Width and height of the view, as a ratio."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="inspector", description=(__doc__ or "").splitlines()[0])
    made.add_argument(
        "scene",
        nargs="?",
        default="showcase",
        metavar="SCENE",
        help=f"{scenes.CHOICES} (default)",
    )
    made.add_argument("--structures", default="kd,bvh-sah", metavar="SPEC[,SPEC...]", help="default: kd,bvh-sah")
    made.add_argument("--width", type=int, default=256, help="camera rays side by side (default: 256)")
    made.add_argument("--out", type=output, default=OUT / "inspector.html", help="default: out/inspector.html")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("inspector", arguments, read, run)


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked before any work. Raises UsageError, SpecError, WorkloadError and FolderError."""
    asked = parser().parse_args(arguments)
    if not LEAST <= asked.width <= MOST:
        raise UsageError(f"--width: expected {LEAST} to {MOST}, got {asked.width}")
    if asked.out.is_dir():
        raise UsageError(f"{asked.out}: cannot be written: it is a folder")
    module = native.load()
    asked.specs = specs.prove(module, specs.expand(asked.structures, module.structures(), {}))
    asked.size = costmap.shaped(asked.width, SHAPE)
    asked.load = scenes.loader(asked.scene, asked.size)
    results.prepare_folder(asked.out.parent)
    return asked


def run(asked: argparse.Namespace) -> int:
    """Measure, and write the page. Returns the exit status. Raises what loading, building and writing raise."""
    scene = asked.load()
    for note in scene.notes:
        print(f"[inspector] {note}")
    made = inspecting.write(asked.out, scene, asked.specs, asked.size)
    for line in made.worst:
        print(f"[inspector] {line}")
    print(f"{asked.out} ({asked.out.stat().st_size / 2**20:.1f} MiB)")
    return 0

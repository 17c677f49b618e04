# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as a page: `python scripts/inspector.py MODEL.npz [--structures SPEC[,SPEC...]] [--out FILE]`.

Writes one self-contained page that opens offline: maps of steps, tests, wasted tests, overlap, any-hit cost and leaf
depth side by side with one cursor and range handles, the worst camera, shadow and bounce rays with their reasons and
steps, the trees node by node, and the cost of each level. Exit status: 0 written; 2 bad usage or input; 130 stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core.base import command, native
from addon.core.inspector import page
from addon.core.report import results
from addon.core.scene import workload
from addon.core.structures import catalogue, specs
from lab.base.usage import Parser, UsageError, output

ROOT = Path(__file__).resolve().parents[1]

LEAST, MOST = 8, 2048
"""Limits of the width of the view in pixels."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="inspector", description=(__doc__ or "").splitlines()[0])
    made.add_argument("file", help="an .npz file, or the name of a shared scene")
    made.add_argument("--structures", default="kd,bvh-sah", metavar="SPEC[,SPEC...]", help="default: kd,bvh-sah")
    made.add_argument("--width", type=int, default=256, help="camera rays side by side (default: 256)")
    made.add_argument("--out", type=output, default=ROOT / "out" / "inspector.html", help="default: out/inspector.html")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("inspector", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Measure, and write the page. Returns the exit status. Raises the errors that `main` reports in one line."""
    if not LEAST <= asked.width <= MOST:
        raise UsageError(f"--width: expected {LEAST} to {MOST}, got {asked.width}")
    found = workload.find(asked.file)
    if not isinstance(found, Path):
        raise UsageError(f"{asked.file}: expected an .npz file")
    results.prepare_folder(asked.out.parent)
    scene = workload.load_npz(found)
    module = native.load()
    structures = []
    for spec in specs.split(asked.structures):
        built = module.build(scene.vertices, scene.triangles, spec)
        label = catalogue.load()[specs.structure_of(spec)].label
        structures.append((label if spec == specs.structure_of(spec) else f"{label} ({spec})", built))
    asked.out.write_text(page.as_html(module, scene, structures, asked.width), encoding="utf-8")
    print(f"{asked.out} ({asked.out.stat().st_size / 2**20:.1f} MiB)")
    return 0


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)

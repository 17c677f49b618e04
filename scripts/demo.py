# SPDX-License-Identifier: GPL-3.0-or-later
"""A demonstration: `python3 scripts/demo.py`. Needs only Python and cargo; sets up the rest.

Renders the built-in showcase through Blender's module, then measures speed and errors of six structures on it.
Exit status: 0 success; 2 bad usage, or the set-up failed; 130 stopped; else that of the step that failed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scripts.dev import environment
from scripts.dev.environment import CURRENT, ROOT

OUT = ROOT / "out"

GROUPS = ("blender-current", "measure", "build")
"""Groups of packages in pyproject.toml that the commands for users need: a fifth of all."""

STRUCTURES = ("kd", "bsp-wn-plus-kd", "rbsp", "bih", "bvh-sah", "octree-net")
"""Trees of axis-aligned planes, oblique planes, fixed directions, plane pairs and boxes, and an octree with links."""

STEPS = {
    "Rendering the built-in showcase with Halfspace through Blender": ["scripts/render.py"],
    f"Measuring {len(STRUCTURES)} structures on the same scene: speed, and errors against brute force": [
        "scripts/bench.py",
        *("--structures", ",".join(STRUCTURES), "--size", "512x512", "--repeats", "6", "--seconds", "5"),
        *("--check-rays", "4096", "--only-rays", "--curve", "none", "--inspector", "kd,bvh-sah"),
        *("--out", str(OUT / "demo")),
    ],
}
"""The line that announces a step, and its script with arguments."""


def main(arguments: Sequence[str]) -> int:
    """Set up, then run all steps. Returns the exit status of the first that fails, 130 if stopped."""
    # Import here: the Python that starts this script may be too old for these modules.
    from addon.core.base import command
    from addon.lab.base.usage import Parser

    parser = Parser(prog="demo", description="Render the built-in showcase, and compare six structures on it.")
    return command.run("demo", arguments, parser.parse_args, work)


def work(_: argparse.Namespace) -> int:
    """Set up and run the steps. Returns the exit status."""
    start = time.monotonic()
    try:
        with environment.alone():
            environment.prepare(CURRENT, *GROUPS)
            environment.install_wheel(CURRENT)
    except environment.SetupError as error:
        print(f"The set-up failed: {error}", file=sys.stderr)
        return 2
    for text, step in STEPS.items():
        print(f"\n==== {text} ({time.monotonic() - start:.0f} s)", flush=True)
        done = subprocess.run([str(CURRENT.python), *step], cwd=ROOT, check=False)
        if done.returncode != 0:
            return done.returncode
    python = CURRENT.python.relative_to(ROOT)
    print(f"\nDone in {time.monotonic() - start:.0f} s. Look at:")
    print(f"  {OUT / 'showcase.png'}\n  {OUT / 'demo' / 'report.html'}, which links the inspector's page")
    print("All structures, with memory, pictures and cost maps:")
    print(f"  {python} scripts/bench.py --structures all --out out/all")
    return 0


if __name__ == "__main__":
    environment.continue_in(CURRENT)
    sys.exit(main(sys.argv[1:]))

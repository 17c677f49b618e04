# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace at work: `python3 scripts/demo.py`. Needs only Python and cargo; sets up the rest.

Renders the built-in showcase through Blender's module, and measures every structure on it: how fast, how wrong.
Exit status: 0 all went well; 2 bad usage, or the set-up failed; 130 stopped; else that of the step that failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence

import environment
from environment import CURRENT, ROOT

OUT = ROOT / "out"
STEPS = {
    "Rendering the built-in showcase with Halfspace through Blender": ["scripts/render.py"],
    "Measuring every structure on the same scene: speed, and errors against brute force": [
        "scripts/bench.py",
        *("--structures", "all", "--size", "512x512", "--repeats", "6", "--seconds", "20", "--check-rays", "4096"),
        *("--out", str(OUT / "demo")),
    ],
}
"""What is said, and the script that does it."""


def main(arguments: Sequence[str]) -> int:
    """Set up, then run all steps. Returns the exit status of the first that fails, 130 when it was stopped."""
    # Imported here: what starts this script may be a Python that is too old for it.
    sys.path.insert(0, str(ROOT))
    from addon.core.base import command
    from lab.base.usage import Parser

    parser = Parser(prog="demo", description="Render the built-in showcase, and measure every structure on it.")
    return command.run("demo", arguments, parser.parse_args, work)


def work(_: argparse.Namespace) -> int:
    """Do so. Returns the exit status."""
    start = time.monotonic()
    try:
        with environment.alone():
            environment.prepare(CURRENT)
            environment.install_wheel(CURRENT)
    except environment.SetupError as error:
        print(f"The set-up failed: {error}", file=sys.stderr)
        return 2
    for text, step in STEPS.items():
        print(f"\n==== {text}", flush=True)
        done = subprocess.run([str(CURRENT.python), *step], cwd=ROOT, env=dict(os.environ), check=False)
        if done.returncode != 0:
            return done.returncode
    print(f"\nDone in {time.monotonic() - start:.0f} s. Look at:")
    print(f"  {OUT / 'showcase.png'}\n  {OUT / 'demo' / 'report.html'}")
    return 0


if __name__ == "__main__":
    environment.continue_in(CURRENT.version)
    sys.exit(main(sys.argv[1:]))

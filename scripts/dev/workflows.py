# SPDX-License-Identifier: GPL-3.0-or-later
"""The workflows, checked by actionlint: `python scripts/dev/workflows.py`.

Go builds actionlint into build/actionlint from the versions and hashes of requirements/actionlint; it needs a network
only the first time. Exit status: 0 nothing found; 1 something found; 2 actionlint could not be built; 130 stopped.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from addon.lab.base.usage import Parser

ROOT = Path(__file__).resolve().parents[2]

MODULE = ROOT / "requirements" / "actionlint"
"""The Go module that locks actionlint and what it needs."""

PROGRAM = ROOT / "build" / "actionlint" / ("actionlint.exe" if os.name == "nt" else "actionlint")


class BuildError(RuntimeError):
    """Actionlint could not be built. The message gives the reason in one line."""


def actionlint() -> Path:
    """The program, built if its versions have changed. Raises BuildError."""
    if shutil.which("go") is None:
        raise BuildError("go, which builds actionlint, is not on the PATH: install Go 1.25 or newer")
    package = "github.com/rhysd/actionlint/cmd/actionlint"
    # Go does nothing where the program is up to date.
    done = subprocess.run(
        ["go", "build", "-mod=readonly", "-trimpath", "-o", str(PROGRAM), package],
        cwd=MODULE,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
        raise BuildError(f"actionlint does not build: {' '.join(last)}")
    return PROGRAM


def check(folder: Path) -> int:
    """Check all workflows of a clone and print what is wrong. Returns actionlint's exit status. Raises BuildError."""
    found = sorted((folder / ".github" / "workflows").glob("*.yml"))
    # Without shellcheck and pyflakes: what they find would depend on whether a machine has them.
    words = [str(actionlint()), "-no-color", "-shellcheck=", "-pyflakes=", *map(str, found)]
    status = subprocess.run(words, check=False).returncode
    if status == 0:
        print(f"{len(found)} workflows, nothing found")
    return status


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="workflows", description=(__doc__ or "").splitlines()[0])
    return command.run("workflows", arguments, parser.parse_args, work, told=(BuildError,))


def work(_: argparse.Namespace) -> int:
    """Check the workflows of this clone. Returns the exit status."""
    return check(ROOT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

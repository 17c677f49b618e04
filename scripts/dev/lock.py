# SPDX-License-Identifier: GPL-3.0-or-later
"""The lock files of the environments: `python scripts/dev/lock.py [--upgrade]`.

uv resolves the dependency groups of pyproject.toml for all systems and writes requirements/*.txt: exact versions with
their hashes. It writes requirement files instead of uv.lock, which would contain the host of each package. Exit status:
0 written; 2 bad usage, or uv failed; 130 stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import environment
import uv

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from addon.lab.base.usage import Parser


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="lock", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--upgrade", action="store_true", help="take the newest versions that pyproject.toml allows")
    return command.run("lock", arguments, parser.parse_args, work, told=(uv.SetupError,))


def work(asked: argparse.Namespace) -> int:
    """Write all lock files. Returns the exit status. Raises SetupError."""
    for one in environment.ALL:
        one.lock.parent.mkdir(exist_ok=True)
        uv.run([*resolution(one), *(["--upgrade"] if asked.upgrade else [])], f"{one.lock.name} could not be made")
        print(one.lock.relative_to(environment.ROOT))
    return 0


def resolution(one: environment.Environment) -> list[str]:
    """The arguments with which uv writes the lock file of an environment."""
    groups = [word for group in one.groups for word in ("--group", group)]
    return [
        *("pip", "compile", "--quiet", "--universal", "--generate-hashes", "--python-version", one.version),
        *("--custom-compile-command", "python scripts/dev/lock.py"),
        *groups,
        *("--output-file", str(one.lock), "pyproject.toml"),
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

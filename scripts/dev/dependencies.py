# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks dependencies without network: `python scripts/dev/dependencies.py`.

Checks licences, the origin of packages, and that each requirement limits the version. `cargo deny`, where installed,
checks the same and more. Exit status: 0 all are allowed; 1 some are not; 2 bad usage, or no cargo; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from addon.lab.base.usage import Parser

NATIVE = Path(__file__).resolve().parents[2] / "native"
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
"""Cargo's name of the official registry, whichever mirror it downloads from."""


LICENCES = frozenset(
    (
        "(MIT OR Apache-2.0) AND Unicode-3.0",
        "Apache-2.0",
        "Apache-2.0 / MIT",
        "Apache-2.0 OR MIT",
        "Apache-2.0 WITH LLVM-exception",
        "Apache-2.0 WITH LLVM-exception OR Apache-2.0 OR MIT",
        "BSD-2-Clause",
        "BSD-2-Clause OR Apache-2.0 OR MIT",
        "GPL-3.0-or-later",
        "MIT",
        "MIT OR Apache-2.0",
        "MIT OR Apache-2.0 OR LGPL-2.1-or-later",
        "MIT/Apache-2.0",
        "Unlicense OR MIT",
        "Unlicense/MIT",
        "Zlib OR Apache-2.0 OR MIT",
    )
)
"""The expressions of packages so far, each of which `native/deny.toml` allows. Whoever adds one reads it."""


def problems(metadata: Mapping[str, Any]) -> Iterator[str]:
    """A sentence for each package of `cargo metadata` that is not allowed."""
    for package in metadata["packages"]:
        name = f"{package['name']} {package['version']}"
        if package["license"] not in LICENCES:
            yield f"{name}: its licence is {package['license'] or 'not stated'}"
        if package["source"] not in (None, REGISTRY):
            yield f"{name}: it comes from {package['source']}"
        if package["source"] is None:
            # The project's own packages, whose requirements are written by hand.
            wanted = (need["name"] for need in package["dependencies"] if need["req"] == "*" and need["source"])
            yield from (f"{name}: wants any version of {need}" for need in wanted)


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="dependencies", description=(__doc__ or "").splitlines()[0])
    return command.run("dependencies", arguments, parser.parse_args, work)


def work(_: argparse.Namespace) -> int:
    """Check all packages and print what is not allowed. Returns the exit status."""
    cargo = ["cargo", "metadata", "--manifest-path", str(NATIVE / "Cargo.toml"), "--all-features", "--locked"]
    done = subprocess.run([*cargo, "--offline", "--format-version", "1"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        print(done.stderr.strip(), file=sys.stderr)
        return 1
    metadata = json.loads(done.stdout)
    found = list(problems(metadata))
    print("\n".join(found) or f"{len(metadata['packages'])} packages, all of them allowed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

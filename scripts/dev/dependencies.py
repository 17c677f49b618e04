# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks dependencies against `native/deny.toml`, without network: `python scripts/dev/dependencies.py`.

Checks licences, the origin of packages, and that each requirement limits the version. `cargo deny`, where installed,
checks the same and more. Exit status: 0 all are allowed; 1 some are not; 2 bad usage, or no cargo; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from addon.lab.base.usage import Parser

NATIVE = Path(__file__).resolve().parents[2] / "native"
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
"""Cargo's name of the official registry, whichever mirror it downloads from."""


def may_be_used(licence: str, allowed: Collection[str]) -> bool:
    """Whether allowed licences satisfy an SPDX expression; `/` is OR, as in old manifests."""
    # Parse by recursive descent: `either` reads alternatives, `both` conjunctions, `one` a licence or a parenthesis.
    tokens = re.findall(r"[()]|[^\s()/]+|/", licence)
    place = 0

    def take() -> str:
        nonlocal place
        place += 1
        return tokens[place - 1] if place <= len(tokens) else ""

    def following() -> str:
        return tokens[place] if place < len(tokens) else ""

    def one() -> bool:
        name = take()
        if name == "(":
            inside = either()
            return take() == ")" and inside
        if following() == "WITH":
            name = f"{name} {take()} {take()}"
        return name in allowed

    def both() -> bool:
        good = one()
        while following() == "AND":
            take()
            good = one() and good
        return good

    def either() -> bool:
        good = both()
        while following() in ("OR", "/"):
            take()
            good = both() or good
        return good

    return either() and place == len(tokens)


def problems(metadata: Mapping[str, Any], rules: Mapping[str, Any]) -> Iterator[str]:
    """A sentence for each package of `cargo metadata` that the rules do not allow."""
    allowed = frozenset(rules["licenses"]["allow"])
    for package in metadata["packages"]:
        name = f"{package['name']} {package['version']}"
        if not may_be_used(package["license"] or "", allowed):
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
    rules = tomllib.loads((NATIVE / "deny.toml").read_text(encoding="utf-8"))
    found = list(problems(metadata, rules))
    print("\n".join(found) or f"{len(metadata['packages'])} packages, all of them allowed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

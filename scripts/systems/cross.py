# SPDX-License-Identifier: GPL-3.0-or-later
"""The crates for another system, on this one: `python -m scripts.systems.cross COMMAND ...`.

`prepare SYSTEM` installs what the others need, from Debian's packages and with rustup. `wheel SYSTEM` builds the wheel
into the folder after --out; with `--interpreter python3.14t` that for a Python without a global lock. `test SYSTEM`
runs the tests of all crates, or those after --crate, under Wine or QEMU. `answers SYSTEM` runs
`native/examples/answers.rs` for that system and for this one, and compares what the two print. `agree FILE FILE ...`
compares outputs of `answers.py` from several systems. Instruction sets may differ; rays, hits, bytes of the tree and
the hash of all bits of all answers must not.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from addon.core.base import command
from addon.lab.base.usage import Parser, output
from scripts import package
from scripts.systems import targets
from scripts.systems.targets import TARGETS, Target

ROOT = Path(__file__).resolve().parents[2]

CARGO = ["--manifest-path", str(ROOT / "native" / "Cargo.toml")]
"""Options of cargo for tests and answers, which share the compiled crates.

A wheel's differ from them in features of libraries: those that PyO3 and NumPy need, and those of proptest.
"""

FEATURES = ["--features", "halfspace_geom/strategies"]
"""The feature of a crate that is on in tests, for the example program."""

NOT_TESTED = ("halfspace_python", "halfspace_benches")
"""Crates without tests of their own, as in `scripts/test.py`."""

SHARE = "HALFSPACE_TEST_SHARE"
"""Environment variable of a whole number N: tests of hard scenes trace every Nth ray."""

FIELDS = 6
"""Number of words of a line of answers: structure, instruction set, rays, hits, bytes, hash."""


class CrossError(RuntimeError):
    """A program for another system could not be built or run. The message states which."""


REPORTED = (CrossError, *package.REPORTED)


def run(words: Sequence[str], variables: dict[str, str], *, captured: bool = False) -> str:
    """Run a program in the repository's folder; returns its output, or shows it. Raises CrossError if it fails."""
    done = subprocess.run(
        list(words),
        cwd=ROOT,
        env={**os.environ, **variables},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE if captured else None,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise CrossError(f"{shlex.join(words)} ended with status {done.returncode}")
    return done.stdout or ""


def prepare(target: Target) -> None:
    """Install the compiler, the runner and Rust's library for a system. Raises CrossError."""
    if target.packages:
        may = [] if os.geteuid() == 0 else ["sudo"]
        run([*may, "apt-get", "update"], {})
        words = [*may, "apt-get", "install", "--yes", "--no-install-recommends", *target.packages.split()]
        run(words, {"DEBIAN_FRONTEND": "noninteractive"})
    run(["rustup", "target", "add", target.triple], {})


def test(target: Target, filters: Sequence[str], crates: Sequence[str]) -> None:
    """Run tests for a system, those whose names contain a filter. Raises CrossError, TargetError.

    crates: the packages whose tests run; empty for all that have tests.
    Prints the share of rays that tests of hard scenes trace there: the variable's, else the system's.
    """
    share = os.environ.get(SHARE, str(target.share))
    if share != "1":
        print(f"{SHARE}={share}: one ray of {share} on hard scenes", flush=True)
    words = ["cargo", "test", *CARGO, "--release", "--target", target.triple, "--tests", "--no-fail-fast"]
    words += [word for name in crates for word in ("--package", name)]
    words += [] if crates else ["--workspace", *(word for name in NOT_TESTED for word in ("--exclude", name))]
    run([*words, "--", *filters], {**targets.variables(target, run=True), SHARE: share})


def answers(target: Target, rays: int) -> list[str]:
    """The lines of the example program for a system. Raises CrossError or TargetError."""
    # On this system the tests have the profile of development.
    where = [] if target.is_here else ["--release", "--target", target.triple]
    words = ["cargo", "run", *CARGO, *FEATURES, *where, "--example", "answers", "--", str(rays)]
    return run(words, targets.variables(target, run=True), captured=True).splitlines()


def table(lines: Sequence[str]) -> dict[str, list[str]]:
    """Structure to the fields that must agree. Other lines are ignored."""
    rows = [line.split() for line in lines]
    return {row[0]: row[2:] for row in rows if len(row) == FIELDS}


def differences(name: str, first: Sequence[str], second: Sequence[str]) -> list[str]:
    """Differences between two lists of answers, one line each. name: the second's."""
    ours, theirs = table(first), table(second)
    found = [f"{name}: {row}: only one of the two answers" for row in sorted(ours.keys() ^ theirs.keys())]
    common = [row for row in ours if row in theirs]
    found += [
        f"{name}: {row}: {' '.join(theirs[row])}, not {' '.join(ours[row])}"
        for row in common
        if ours[row] != theirs[row]
    ]
    return found or ([] if common else [f"{name}: no structure answers"])


def agree(outputs: dict[str, list[str]]) -> int:
    """Print the lines of each system or file, and whether all agree with the first. Returns the exit status."""
    for name, lines in outputs.items():
        print(f"{name}:\n" + "\n".join(f"  {line}" for line in lines))
    first, *others = outputs.items()
    wrong = [line for name, lines in others for line in differences(name, first[1], lines)]
    for line in wrong:
        print(f"DIFFERENT {line}")
    if not wrong:
        print(f"{len(table(first[1]))} structures answer with the same bits: {', '.join(outputs)}")
    return int(bool(wrong))


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="cross", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    for name, text in (
        ("prepare", "install what is needed"),
        ("wheel", "build the wheel"),
        ("test", "run the tests"),
        ("answers", "compare"),
    ):
        one = commands.add_parser(name, help=text)
        one.add_argument("system", choices=list(TARGETS))
        if name == "wheel":
            one.add_argument("--out", type=output, default=ROOT / "build" / "wheels", help="default: build/wheels")
            one.add_argument("--interpreter", metavar="PYTHON", help="a free-threaded Python, such as python3.14t")
        if name == "test":
            one.add_argument("filters", nargs="*", help="run only tests whose names contain one of these")
            one.add_argument("--crate", action="append", default=[], help="only this crate; may be repeated")
        if name == "answers":
            one.add_argument("--rays", type=int, default=1_000_000, help="number of rays (default: 1000000)")
    files = commands.add_parser("agree", help="compare files")
    files.add_argument("files", type=Path, nargs="+")
    return command.run("cross", arguments, parser.parse_args, chosen, told=REPORTED)


def chosen(asked: argparse.Namespace) -> int:
    """Run one command. Returns the exit status."""
    if asked.command == "agree":
        if len(asked.files) < 2:
            raise CrossError("agree needs two files or more")
        return agree({path.stem: path.read_text(encoding="utf-8").splitlines() for path in asked.files})
    target = TARGETS[asked.system]
    if asked.command == "prepare":
        prepare(target)
    elif asked.command == "wheel":
        asked.out.mkdir(parents=True, exist_ok=True)
        print(shutil.copy2(package.portable_wheel(target.name, asked.interpreter), asked.out))
    elif asked.command == "test":
        test(target, asked.filters, asked.crate)
    else:
        here = TARGETS[targets.here()]
        return agree({one.name: answers(one, asked.rays) for one in (here, target)})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Deliberate faults, one at a time, and whether a test notices: `python -m scripts.dev.mutations [options]`.

Puts the faults of `deliberate_faults.py` into a copy of the sources, each behind a switch, so that one build serves
all. Exit status: 0 every fault was caught; 1 some survived; 2 the list no longer fits the sources, or the build failed;
130 stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from addon.core.base import command
from addon.lab.base.usage import Parser
from scripts.dev.deliberate_faults import FAULTS, Fault

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 600
"""Processor seconds after which a test counts as failed: the fault made it endless."""

SWITCH = """
/// Whether the fault of this number is switched on.
pub(crate) fn fault(number: u32) -> bool {
    static CHOSEN: std::sync::LazyLock<u32> = std::sync::LazyLock::new(|| {
        std::env::var("HALFSPACE_FAULT").ok().and_then(|text| text.parse().ok()).unwrap_or(0)
    });
    *CHOSEN == number
}
"""


class StaleError(ValueError):
    """A fault does not fit the sources. The message names it."""


def is_whole(text: str) -> bool:
    """Whether all brackets that open in `text` close in it, and it does not end with a comma."""
    return all(text.count(a) == text.count(b) for a, b in ("()", "[]", "{}")) and not text.rstrip().endswith(",")


def seeded(text: str, fault: Fault, number: int) -> str:
    """The source `text` with the fault in it.

    Raises StaleError unless its place is found exactly once and is a whole expression.
    """
    if not (is_whole(fault.old) and is_whole(fault.new)):
        raise StaleError(f"{fault.what}: {fault.old!r} or {fault.new!r} is a part of an expression, not a whole one")
    places = text.count(fault.old)
    if places != 1:
        raise StaleError(f"{fault.what}: {fault.old!r} occurs {places} times in {fault.file}")
    return text.replace(fault.old, f"(if crate::fault({number}) {{ {fault.new} }} else {{ {fault.old} }})")


def seed(copy: Path) -> None:
    """Put all faults into a copy of the project. Raises StaleError."""
    crates = set()
    for number, fault in enumerate(FAULTS, 1):
        path = copy / fault.file
        path.write_text(seeded(path.read_text(encoding="utf-8"), fault, number), encoding="utf-8")
        crates.add(next(folder for folder in path.parents if (folder / "Cargo.toml").is_file()))
    for crate in crates:
        library = crate / "src/lib.rs"
        # Each switched expression is in parentheses, of which some are not needed.
        text = "#![allow(unused_parens)]\n" + library.read_text(encoding="utf-8") + SWITCH
        library.write_text(text, encoding="utf-8")


def check() -> None:
    """Check that every fault fits the sources. Raises StaleError."""
    for number, fault in enumerate(FAULTS, 1):
        seeded((ROOT / fault.file).read_text(encoding="utf-8"), fault, number)


def build(copy: Path, faults: Sequence[Fault]) -> dict[str, list[Path]]:
    """Build the tests that `faults` name: program name to its files. "lib" names the unit tests of the faults' crates.

    Raises CalledProcessError.
    """
    crates = sorted({f"halfspace_{Path(fault.file).parts[1]}" for fault in faults if fault.test[0] == "lib"})
    programs = sorted({fault.test[0] for fault in faults})
    packages = [*crates, *(["halfspace"] if set(programs) != {"lib"} else [])]
    chosen = [part for name in programs for part in (["--lib"] if name == "lib" else ["--test", name])]
    command = [
        "cargo",
        "test",
        *(part for package in packages for part in ("--package", package)),
        "--release",
        "--no-run",
        "--message-format=json-render-diagnostics",
        *chosen,
    ]
    release = {"LTO": "off", "CODEGEN_UNITS": "16"}
    environment = {"CARGO_TARGET_DIR": str(ROOT / "build" / "mutations")} | dict(os.environ)
    environment |= {f"CARGO_PROFILE_RELEASE_{key}": value for key, value in release.items()}
    made = subprocess.run(command, cwd=copy / "native", env=environment, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, list[Path]] = {}
    for line in made.stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["profile"]["test"]:
            is_library = "lib" in message["target"]["kind"] or "rlib" in message["target"]["kind"]
            name = "lib" if is_library else message["target"]["name"]
            found.setdefault(name, []).append(Path(message["executable"]))
    return found


def finds(programs: Mapping[str, Sequence[Path]], test: tuple[str, str], folder: Path) -> bool:
    """Whether a program of a test's name has a test that it selects."""
    listed = [
        subprocess.run([str(program), test[1], "--list"], cwd=folder, capture_output=True, text=True, check=True).stdout
        for program in programs[test[0]]
    ]
    return any(": test" in text for text in listed)


def passes(programs: Mapping[str, Sequence[Path]], test: tuple[str, str], folder: Path, number: int) -> bool:
    """Whether a test passes in time with a fault switched on, in all programs of its name."""
    environment = {**os.environ, "HALFSPACE_FAULT": str(number), "RUST_BACKTRACE": "0"}
    # Processor time, not the clock: on a busy machine every test takes long.
    limited = ["sh", "-c", f'ulimit -t {SECONDS}; exec "$@"', "sh"]
    return all(
        subprocess.run(
            [*limited, str(program), test[1]], cwd=folder, env=environment, capture_output=True, check=False
        ).returncode
        == 0
        for program in programs[test[0]]
    )


def copy_sources(folder: Path) -> Path:
    """Copy all files that tests need into `folder`. Returns the copy's root."""
    copy = folder / "halfspace"
    everywhere = shutil.ignore_patterns("target", "__pycache__", ".git", ".venv*", ".hypothesis", ".*_cache")

    def ignored(directory: str, names: list[str]) -> set[str]:
        outputs = {"build", "out"} if Path(directory) == ROOT else set()
        return {*everywhere(directory, names), *outputs.intersection(names)}

    shutil.copytree(ROOT, copy, ignore=ignored)
    return copy


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="mutations", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("numbers", nargs="*", type=int, help="only the faults of these numbers")
    return command.run("mutations", arguments, parser.parse_args, work, told=(subprocess.CalledProcessError,))


def work(asked: argparse.Namespace) -> int:
    """Try the faults. Returns the exit status. Raises StaleError, CalledProcessError."""
    chosen = [(n, fault) for n, fault in enumerate(FAULTS, 1) if not asked.numbers or n in asked.numbers]
    check()
    with tempfile.TemporaryDirectory(prefix="halfspace-faults-") as folder:
        survived = run(copy_sources(Path(folder)), chosen)
    print(f"{len(chosen) - len(survived)} of {len(chosen)} faults caught")
    return 1 if survived else 0


def run(copy: Path, chosen: Sequence[tuple[int, Fault]]) -> list[int]:
    """Try the faults in turn. Returns the numbers of those that survived, 0 for each test that fails without one."""
    seed(copy)
    programs = build(copy, [fault for _, fault in chosen])
    survived = []
    for test in sorted({fault.test for _, fault in chosen}):
        if not finds(programs, test, copy / "native"):
            raise StaleError(f"no test is named {' '.join(test)}")
        if not passes(programs, test, copy / "native", 0):
            print(f"FAILS without any fault: {' '.join(test)}", flush=True)
            survived.append(0)
    for number, fault in chosen:
        start = time.monotonic()
        alive = passes(programs, fault.test, copy / "native", number)
        print(
            f"{'SURVIVED' if alive else 'caught':8} {number:2} {fault.what} ({time.monotonic() - start:.0f} s)",
            flush=True,
        )
        if alive:
            survived.append(number)
    return survived


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

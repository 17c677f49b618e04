# SPDX-License-Identifier: GPL-3.0-or-later
"""The checks of the project: `python3 scripts/test.py [--all] [CHECK ...]`.

Sets up what it needs, then runs formatters, linters, type checks and tests, one after another, each on all processors.
Arguments choose checks by the beginning of their names. What a day does not need is left out, and named in the summary;
with --all, as before a release, it is run. The last line is the count. Exit status: 0 nothing failed; 1 something
failed; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scripts.dev import environment
from scripts.dev.environment import CURRENT, LTS, ROOT

HEAVY = tuple(f"halfspace_{room}" for room in ("single", "papers", "group", "stream", "beam", "polybeam"))
"""Crates whose own unit tests run with --all only: kernels, which are compiled again for them, minutes each."""

DIFFERENT = ("installing", "passes", "read", "settings", "ui", "value_nodes")
"""The folders about what differs between versions of Blender: all that LTS runs without --all."""

SIDE_BY_SIDE = "-n auto --maxprocesses 8 --dist loadfile"
"""Tests of a file share what they build, and each process loads Blender."""

Check = tuple[str, list[str]]
"""A program without which the check is skipped, and the command that runs in the project's folder."""

Counts = collections.Counter
Outcome = tuple[Counts[str], str, str]
"""Tests "passed", "failed" and "skipped", what the check printed, and its seconds or why it did not run."""


def checks(everything: bool = True) -> dict[str, Check]:
    """Name to check, in order. everything: also what a day does not need."""

    def cargo(words: str, tool: str = "cargo") -> Check:
        command, *options = words.split()
        return tool, ["cargo", command, "--manifest-path", "native/Cargo.toml", *options]

    def python(words: str) -> Check:
        return "", [str(CURRENT.python), "-m", *words.split()]

    def tests(where: environment.Environment, *folders: str) -> Check:
        chosen = [] if everything else ["-m", "not slow"]
        return "", [str(where.python), "-m", "pytest", *SIDE_BY_SIDE.split(), *chosen, *folders]

    rust = "test --workspace --no-fail-fast --exclude halfspace_benches"
    rust += "" if everything else "".join(f" --exclude {crate}" for crate in HEAVY)
    lts = ["tests/blender"] if everything else [f"tests/blender/{name}" for name in DIFFERENT]
    # Go builds actionlint from versions and hashes that are locked; it needs a network only the first time.
    workflows = "go run -C requirements/actionlint -mod=readonly -trimpath github.com/rhysd/actionlint/cmd/actionlint"
    files = [str(path) for path in (ROOT / ".github" / "workflows").glob("*.yml")]
    return {
        "rustfmt": cargo("fmt --all --check", "rustfmt"),
        "deny": cargo("deny --workspace --offline check bans licenses sources", "cargo-deny"),
        "clippy": cargo("clippy --workspace --all-targets --all-features -- -D warnings", "cargo-clippy"),
        # In the profile of the wheel, and with the Python module: cargo then uses the crates that the wheel is made of.
        "rust": cargo(f"{rust} --release"),
        "overflow": cargo(rust),
        "ruff": python("ruff check ."),
        "ruff-format": python("ruff format --check ."),
        "mypy": python("mypy"),
        "imports": ("", [str(CURRENT.python.with_name("lint-imports")), "--no-cache"]),
        "workflows": ("go", [*workflows.split(), "-no-color", "-shellcheck=", "-pyflakes=", *files]),
        "core": tests(CURRENT, "tests/core"),
        "blender": tests(CURRENT, "tests/blender"),
        "blender-lts": tests(LTS, *lts),
    }


def counted(command: list[str], status: int, said: str) -> Counts[str]:
    """The counts of tests that a program printed, else one test. With another exit status than 0 something failed."""
    counts: Counts[str] = Counts()
    if command[:2] == ["cargo", "test"]:
        for line in re.findall(r"^test result: .*? (\d+) passed; (\d+) failed; (\d+) ignored;", said, re.MULTILINE):
            counts.update(dict(zip(("passed", "failed", "skipped"), map(int, line), strict=True)))
    elif "pytest" in command:
        same = {"error": "failed", "errors": "failed", "xfailed": "skipped"}
        closing = re.findall(r"^=+ (.*) in \d\S*s\b.*=$", said, re.MULTILINE)[-1:]
        for number, word in re.findall(r"(\d+) ([a-z]+)", "".join(closing)):
            counts[same.get(word, word)] += int(number)
    else:
        counts["passed"] = int(status == 0)
    counts["failed"] += int(status != 0 and not counts["failed"])
    return counts


def end(process: subprocess.Popen[str]) -> None:
    """End a process that leads a session, and all that it started: ending cargo alone would not end its tests."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL) if os.name == "posix" else process.kill()


def run(name: str, tool: str, command: list[str]) -> Outcome:
    """Run a check, printing its lines as they come. Ends it if this process is stopped."""
    if tool and shutil.which(tool) is None:
        return Counts(skipped=1), "", f"not found: {tool}"
    print(f"==== {name}", flush=True)
    began, lines = time.monotonic(), []
    pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    variables = {**os.environ, "PYO3_PYTHON": str(CURRENT.python), "CARGO_TERM_COLOR": "never"}
    options: dict[str, Any] = {"cwd": ROOT, "env": variables, "start_new_session": True}
    with subprocess.Popen(command, text=True, errors="replace", **pipes, **options) as process:
        try:
            for line in process.stdout or ():
                lines.append(line)
                print(line, end="", flush=True)
        except BaseException:
            end(process)
            raise
    said, seconds = "".join(lines), time.monotonic() - began
    ended = f", ended by signal {-process.returncode}" if process.returncode < 0 else ""
    counts = counted(command, process.returncode, said)
    print(f"==== {name}: {words(counts)} ({seconds:.0f} s{ended})", flush=True)
    return counts, said, f"{seconds:.0f} s{ended}"


def prepare(chosen: dict[str, Check]) -> None:
    """Make ready the environments that the checks need, with the native module for tests. Raises SetupError.

    If only Blender LTS cannot be set up, its check is replaced by one that fails or is skipped.
    """
    ready = [CURRENT]
    with environment.alone():
        environment.prepare(CURRENT)
        if "blender-lts" in chosen:
            try:
                environment.prepare(LTS)
                ready.append(LTS)
            except environment.NoPythonError as error:
                chosen["blender-lts"] = str(error), []
            except environment.SetupError as error:
                chosen["blender-lts"] = "", [sys.executable, "-c", f"raise SystemExit({str(error)!r})"]
        if any("pytest" in command for _, command in chosen.values()):
            environment.install_wheel(*ready)


def words(counts: Counts[str]) -> str:
    """In the words that other programs look for."""
    return ", ".join(f"{counts[word]} {word}" for word in ("passed", "failed", "skipped"))


def summary(outcomes: dict[str, Outcome], asked: argparse.Namespace) -> Counts[str]:
    """Print the last lines of what failed, a line for each check, and what was left out. Returns the sum."""
    for name, said in ((name, said) for name, (counts, said, _) in outcomes.items() if counts["failed"]):
        last = [line[:160] for line in said.splitlines() if line.strip()][-8:]
        print("\n".join([f"\n==== {name} failed, and said last:", *last]))
    print("\n==== Summary")
    total: Counts[str] = Counts()
    for name, (counts, _, remark) in outcomes.items():
        total.update(counts)
        print(f"{'FAILED ' if counts['failed'] else '':>7}{name:<14} {words(counts)} ({remark})")
    left_out = {
        "the Rust tests with checks of overflow": not asked.checks,
        "slow tests": {"core", "blender", "blender-lts"} & outcomes.keys(),
        f"in Blender LTS, all folders but {', '.join(DIFFERENT)}": "blender-lts" in outcomes,
        "three of four rays of the Rust tests' hard scenes": "rust" in outcomes,
        f"unit tests within {', '.join(HEAVY)}": "rust" in outcomes,
    }
    for text in (text for text, applies in left_out.items() if applies and not asked.all):
        print(f"left out: {text} (--all runs it)")
    return total


def read(arguments: list[str]) -> argparse.Namespace:
    """The options, without anything being set up. Ends the process with 0 after --help, with 2 after bad usage."""
    names = checks()
    description = "From nothing the checks download 1.6 GB and take half an hour on two cores, most of it to compile."
    parser = argparse.ArgumentParser(prog="test", description=description)
    parser.add_argument("--all", action="store_true", help="also what a release needs; takes an hour more")
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=f"beginnings of names: {', '.join(names)}")
    asked = parser.parse_args(arguments)
    # Refused even with known names: a check that is misspelt would else be taken for one that passed.
    for word in asked.checks:
        if not any(name.startswith(word) for name in names):
            parser.error(f"no check is called {word!r}; there are {', '.join(names)}")
    return asked


def main(arguments: list[str]) -> int:
    """Run the checks that the arguments choose. Returns the exit status."""
    try:
        return work(read(arguments))
    except KeyboardInterrupt:
        print("test: stopped", file=sys.stderr, flush=True)
        return 130


def work(asked: argparse.Namespace) -> int:
    """Run the checks and print the summary. Returns the exit status."""
    if not asked.all:
        os.environ.setdefault("HALFSPACE_TEST_SHARE", "4")
    wanted = tuple(asked.checks or (name for name in checks() if asked.all or name != "overflow"))
    chosen = {name: check for name, check in checks(asked.all).items() if name.startswith(wanted)}
    try:
        prepare(chosen)
    except environment.SetupError as error:
        print(f"The set-up failed: {error}\n\n{words(Counts(failed=1))}", flush=True)
        return 1
    total = summary({name: run(name, *check) for name, check in chosen.items()}, asked)
    print(f"\n{words(total)}", flush=True)
    return 1 if total["failed"] or not total["passed"] else 0


if __name__ == "__main__":
    # The checks lead sessions of their own: a signal from outside ends only this process, which then ends them.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    read(sys.argv[1:])
    environment.continue_in(CURRENT)
    sys.exit(main(sys.argv[1:]))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Every check of the project: `python3 scripts/test.py [CHECK ...]`.

Sets up what it needs, then runs formatters, linters, type checks and all tests. The last line is the count; the exit
status is 0 only if nothing failed. With arguments only the checks whose names begin so are run: `test.py core`; when
none begins so, nothing is run, and the exit status is 2. Stopped by Ctrl-C it is 130.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import environment
from environment import CURRENT, LTS, ROOT

MANIFEST = ["--manifest-path", "native/Cargo.toml"]
ENVIRONMENT = {**os.environ, "PYO3_PYTHON": str(CURRENT.python), "CARGO_TERM_COLOR": "never"}
TIME_LIMIT = 900
"""Seconds after which a check is ended and counts as failed."""

LAST_LINES, LINE_WIDTH = 8, 160
"""How much of what a failed check printed is printed again beside the summary, which may be all that a log keeps."""


@dataclass(frozen=True)
class Counts:
    """How many tests passed, failed and were skipped."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    said: str = field(default="", compare=False, repr=False)
    """What was printed by what failed."""

    def __add__(self, other: Counts) -> Counts:
        """Both together."""
        return Counts(
            self.passed + other.passed,
            self.failed + other.failed,
            self.skipped + other.skipped,
            self.said + other.said,
        )

    def __str__(self) -> str:
        """In the words that other programs look for."""
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


def end(process: subprocess.Popen[Any]) -> None:
    """End a process that leads a session, with all that it started: cargo's end alone would not end a test's."""
    if os.name == "posix":
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def run(command: list[str]) -> tuple[int, str]:
    """Run a command, showing its output as it comes. Returns its exit status and what it printed."""
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    assert process.stdout is not None
    # A timer, because a hanging process prints nothing that could wake a loop over its lines.
    overdue = threading.Event()

    def stop() -> None:
        overdue.set()
        end(process)

    timer = threading.Timer(TIME_LIMIT, stop)
    timer.start()
    lines = []
    try:
        with process:
            for line in process.stdout:
                print(line, end="", flush=True)
                lines.append(line)
    except BaseException:
        end(process)
        raise
    finally:
        timer.cancel()
    status = process.returncode
    if overdue.is_set():
        lines.append(f"ended after {TIME_LIMIT} s\n")
        print(lines[-1], end="", flush=True)
    return status, "".join(lines)


def gate(*command: str) -> Callable[[], Counts]:
    """A check that is one test: its exit status decides."""

    def check() -> Counts:
        status, said = run(list(command))
        return Counts(passed=1) if status == 0 else Counts(failed=1, said=said)

    return check


def python_tool(module: str, *arguments: str) -> Callable[[], Counts]:
    """A gate that is a Python module in the current environment."""
    return gate(str(CURRENT.python), "-m", module, *arguments)


class RustTests:
    """`cargo test`, which takes minutes, beside everything else: another profile and another lock than the module's."""

    def __init__(self) -> None:
        """Begin."""
        self._folder = tempfile.TemporaryDirectory(prefix="halfspace-rust-")
        self._output = Path(self._folder.name) / "output"
        with self._output.open("wb") as output:
            self._process = subprocess.Popen(
                ["cargo", "test", *MANIFEST],
                cwd=ROOT,
                env=ENVIRONMENT,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def counts(self) -> Counts:
        """Wait for the end, show what was printed, and add up the test programs."""
        limit = time.monotonic() + TIME_LIMIT
        with self._output.open(encoding="utf-8", errors="replace") as output:
            while self._process.poll() is None and time.monotonic() < limit:
                print(output.read(), end="", flush=True)
                time.sleep(0.5)
            if self._process.poll() is None:
                end(self._process)
                with self._output.open("a", encoding="utf-8") as more:
                    more.write(f"ended after {TIME_LIMIT} s\n")
            status = self._process.wait()
            print(output.read(), end="", flush=True)
        said = self._output.read_text(encoding="utf-8", errors="replace")
        # Not compiling fails no test, and so must count by itself.
        return judged(cargo_counts(said), status, said)

    def close(self) -> None:
        """End it, if it goes on, and forget what it printed."""
        if self._process.poll() is None:
            end(self._process)
            self._process.wait()
        self._folder.cleanup()


def judged(counts: Counts, status: int, said: str) -> Counts:
    """What tests have come to: a program of them that ends badly has failed, whatever it counted."""
    if status == 0 and not counts.failed:
        return counts
    return counts + Counts(failed=int(not counts.failed), said=said)


def cargo_counts(text: str) -> Counts:
    """Adds up the closing lines of `cargo test`."""
    found = re.findall(r"^test result: .*? (\d+) passed; (\d+) failed; (\d+) ignored;", text, re.MULTILINE)
    return sum((Counts(int(passed), int(failed), int(ignored)) for passed, failed, ignored in found), Counts())


def pytest_tier(where: environment.Environment, folder: str) -> Callable[[], Counts]:
    """pytest over one folder in one environment. A tier without tests has failed."""

    def check() -> Counts:
        with tempfile.TemporaryDirectory(prefix="halfspace-counts-") as temporary:
            file = Path(temporary) / "counts.json"
            arguments = ["tests/run.py", "--counts", str(file), folder]
            status, said = run([str(where.python), *arguments])
            counts = Counts(**json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else Counts()
        return judged(counts, status, said)

    return check


CHECKS: dict[str, Callable[[], Counts]] = {
    "rustfmt": gate("cargo", "fmt", *MANIFEST, "--check"),
    "clippy": gate("cargo", "clippy", *MANIFEST, "--all-targets", "--", "-D", "warnings"),
    "clippy-python": gate(
        "cargo", "clippy", *MANIFEST, "--all-targets", "--features", "python", "--", "-D", "warnings"
    ),
    "deny": gate("cargo", "deny", *MANIFEST, "--offline", "check", "bans", "licenses", "sources"),
    "dependencies": gate(str(CURRENT.python), "scripts/dependencies.py"),
    "ruff": python_tool("ruff", "check", "."),
    "ruff-format": python_tool("ruff", "format", "--check", "."),
    "mypy": python_tool("mypy"),
    "core": pytest_tier(CURRENT, "tests/core"),
    "blender": pytest_tier(CURRENT, "tests/blender"),
    "blender-lts": pytest_tier(LTS, "tests/blender"),
}
"""Name to check, in the order in which they run: the quick ones first."""

RUST = "rust"
"""The check that runs beside the others, and is waited for last."""


def why_not(name: str, lts_problem: str | None) -> str | None:
    """Why a check cannot be run on this machine, or None."""
    if name == "blender-lts":
        return lts_problem
    tools = {"rustfmt": "rustfmt", "clippy": "cargo-clippy", "clippy-python": "cargo-clippy", "deny": "cargo-deny"}
    component = tools.get(name)
    if component and shutil.which(component) is None:
        return f"{component} is not installed"
    return None


@dataclass(frozen=True)
class Ready:
    """What the set-up has come to.

    rust: its tests, which run meanwhile, if wanted. lts_missing: why there is no environment for Blender LTS, or None.
    lts_broken: whether it could not be made, though its Python is there.
    """

    rust: RustTests | None = None
    lts_missing: str | None = None
    lts_broken: bool = False


def set_up(names: list[str], beside: contextlib.ExitStack) -> Ready:
    """Make the environments ready. `beside` closes the Rust tests. Raises SetupError.

    Where only Blender LTS cannot be set up, its check fails, and the others run.
    """
    environment.prepare(CURRENT)
    rust = RustTests() if RUST in names else None
    if rust is not None:
        beside.callback(rust.close)
    environments, missing, broken = [CURRENT], None, False
    if "blender-lts" in names:
        if environment.available(LTS):
            try:
                environment.prepare(LTS)
                environments.append(LTS)
            except environment.SetupError as error:
                broken = True
                print(f"[set-up] blender-lts fails: {error}", flush=True)
        else:
            missing = f"Python {LTS.version}, which Blender {LTS.blender} needs, was not found"
    environment.install_wheel(*environments)
    return Ready(rust, missing, broken)


def main(wanted: list[str]) -> int:
    """Run the checks whose names begin with one of `wanted` (all, if none). Returns the exit status."""
    # Not as other commands end: a fault of this script itself is to be seen whole.
    try:
        return work(wanted)
    except KeyboardInterrupt:
        print("test: stopped", file=sys.stderr, flush=True)
        return 130


def work(wanted: list[str]) -> int:
    """Do so. Returns the exit status."""
    known = [*CHECKS, RUST]
    # Beside known names too: a check that is misspelt would else be taken for one that passed.
    unknown = [word for word in wanted if not any(name.startswith(word) for name in known)]
    if unknown:
        print(f"test: no check is called {unknown[0]!r}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    names = [name for name in known if not wanted or name.startswith(tuple(wanted))]
    start = time.monotonic()
    results: dict[str, tuple[Counts, str]] = {}
    with contextlib.ExitStack() as beside:
        try:
            with environment.alone():
                ready = set_up(names, beside)
        except environment.SetupError as error:
            print(f"The set-up failed: {error}\n\n{Counts(failed=1)}", flush=True)
            return 1
        checks = dict(CHECKS)
        if ready.rust is not None:
            checks[RUST] = ready.rust.counts
        if ready.lts_broken:
            checks["blender-lts"] = lambda: Counts(failed=1)
        for name in names:
            reason = why_not(name, ready.lts_missing)
            print(f"\n==== {name}" + (f": skipped, {reason}" if reason else ""), flush=True)
            began = time.monotonic()
            counts = Counts(skipped=1) if reason else checks[name]()
            results[name] = counts, reason or f"{time.monotonic() - began:.0f} s"
    for name, (counts, _) in results.items():
        if counts.failed:
            last = [line[:LINE_WIDTH] for line in counts.said.splitlines() if line.strip()][-LAST_LINES:]
            print("\n".join([f"\n==== {name} failed, and said last:", *last]))
    print(f"\n==== Summary after {time.monotonic() - start:.0f} s", flush=True)
    for name, (counts, remark) in results.items():
        print(f"{'FAILED ' if counts.failed else '':>7}{name:<14} {counts} ({remark})")
    total = sum((counts for counts, _ in results.values()), Counts())
    print(f"\n{total}", flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    # What runs here leads sessions of its own: an end from outside has to reach it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    environment.continue_in(CURRENT.version)
    sys.exit(main(sys.argv[1:]))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The checks of the project: `python3 scripts/test.py [--all] [CHECK ...]`.

Sets up what it needs, then runs formatters, linters, type checks and tests, two side by side. The last line is the
count; the exit status is 0 only if nothing failed. Arguments choose checks by the beginning of their names:
`test.py core`; if none begins so, nothing runs, and the exit status is 2. Stopped by Ctrl-C it is 130.

What a day does not need is left out, and named in the summary; with --all, as before a release, it is run: tests that
are marked slow, those in Blender LTS of what it shares with the current one, three of four rays of hard scenes, unit
tests within the crates of kernels, and `overflow`, the Rust tests with checks of overflow and debug assertions, which
can also be named.
"""

from __future__ import annotations

import argparse
import collections
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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent / "dev"))

import environment
from environment import CURRENT, LTS, ROOT

CRATES = ["--manifest-path", "native/Cargo.toml", "--workspace"]
ENVIRONMENT = {
    **os.environ,
    "PYO3_PYTHON": str(CURRENT.python),
    "CARGO_TERM_COLOR": "never",
}

SILENT_SECONDS, SILENT_WORK = 900.0, 3600.0
"""A check hangs if it printed nothing for the first and did not work meanwhile, or worked for the second.

The first is seconds of the clock, the second seconds of processors. A check that works may take any time: a busy
machine makes it no failure. The longest silence of a check that works is a compilation, of 600 seconds of processors.
"""

CHOSEN = argparse.Namespace(all=False)
"""The options of the command line."""

LAST_LINES, LINE_WIDTH = 8, 160
"""How much of a failed check's output is printed again after the summary, which may be all that a log keeps."""


@dataclass(frozen=True)
class Counts:
    """How many tests passed, failed and were skipped."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    left_out: int = 0
    """Tests that a day does not need."""
    said: str = field(default="", compare=False, repr=False)
    """The output of the checks that failed."""

    def __add__(self, other: Counts) -> Counts:
        """Both together."""
        return Counts(
            self.passed + other.passed,
            self.failed + other.failed,
            self.skipped + other.skipped,
            self.left_out + other.left_out,
            self.said + other.said,
        )

    def __str__(self) -> str:
        """In the words that other programs look for."""
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


def end(process: subprocess.Popen[Any]) -> None:
    """End a process that leads a session, and all that it started: ending cargo alone would not end its tests."""
    if os.name == "posix":
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


class Running:
    """The processes that run now, so that all can be ended at once. Safe to use from several threads."""

    def __init__(self) -> None:
        """No process yet."""
        self._lock = threading.Lock()
        self._processes: set[subprocess.Popen[str]] = set()
        self._stopped = False

    @contextlib.contextmanager
    def started(self, command: list[str]) -> Iterator[subprocess.Popen[str]]:
        """A process in a session of its own; ended if the block is left before its end. Raises StoppedError."""
        with self._lock:
            if self._stopped:
                raise StoppedError
            process = subprocess.Popen(
                command,
                cwd=ROOT,
                env=ENVIRONMENT if CHOSEN.all else DAY_SHARE | ENVIRONMENT,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=True,
            )
            self._processes.add(process)
        try:
            with process:
                yield process
        except BaseException:
            end(process)
            raise
        finally:
            with self._lock:
                self._processes.discard(process)

    def stop(self) -> None:
        """End all processes, and start no more."""
        with self._lock:
            self._stopped = True
            for process in self._processes:
                end(process)


class StoppedError(RuntimeError):
    """All checks are being ended: none starts any more."""


RUNNING = Running()
NAME = threading.local()
"""`NAME.check`: the check that this thread runs. Its lines are printed with it, since two checks run side by side."""


def show(line: str) -> None:
    """Print a line of the check that this thread runs, at once."""
    # In one piece: another thread may print meanwhile.
    sys.stdout.write(f"{getattr(NAME, 'check', 'test'):>11} | {line.rstrip()}\n")
    sys.stdout.flush()


def processor_seconds(session: int) -> float:
    """The seconds that processors worked for the processes of a session.

    Linux lists them in /proc; elsewhere returns seconds of the clock, as if one processor worked all the time.
    """
    if not Path("/proc/self/stat").is_file():
        return time.monotonic()
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # The fields after the program's name, which stands in parentheses and may contain spaces (proc(5)).
            fields = path.read_text(errors="replace").rpartition(")")[2].split()
            if int(fields[3]) == session:
                ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


class Watch:
    """Ends a process that hangs; `why` then says how it hung. See SILENT_SECONDS."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        """Watch the process from now on."""
        self.why = ""
        self._process = process
        self._printed = threading.Event()
        self._over = threading.Event()
        threading.Thread(target=self._look, daemon=True).start()

    def printed(self) -> None:
        """Note that the process printed something."""
        self._printed.set()

    def over(self) -> None:
        """Stop watching."""
        self._over.set()

    def _look(self) -> None:
        heard = worked = processor_seconds(self._process.pid)
        since = time.monotonic()
        while not self._over.wait(min(SILENT_SECONDS / 10, 10.0)):
            work = processor_seconds(self._process.pid)
            if self._printed.is_set():
                self._printed.clear()
                heard = work
            # A process that only polls uses less than this.
            if heard == work or work - worked > SILENT_SECONDS / 100:
                worked, since = work, time.monotonic()
            if time.monotonic() - since > SILENT_SECONDS:
                self.why = f"ended: it printed nothing and did not work for {SILENT_SECONDS:.0f} s\n"
            elif work - heard > SILENT_WORK:
                self.why = f"ended: it printed nothing in {SILENT_WORK:.0f} s of work\n"
            if self.why:
                end(self._process)
                return


def run(command: list[str]) -> tuple[int, str]:
    """Run a command, printing its lines as they come. Returns its exit status and what it printed."""
    lines = []
    with RUNNING.started(command) as process:
        assert process.stdout is not None
        watch = Watch(process)
        try:
            for line in process.stdout:
                watch.printed()
                show(line)
                lines.append(line)
        finally:
            watch.over()
    if watch.why:
        show(watch.why)
        lines.append(watch.why)
    return process.returncode, "".join(lines)


def gate(*command: str) -> Callable[[], Counts]:
    """A check that is one test: its exit status decides."""

    def check() -> Counts:
        status, said = run(list(command))
        return Counts(passed=1) if status == 0 else Counts(failed=1, said=said)

    return check


def python_tool(module: str, *arguments: str) -> Callable[[], Counts]:
    """A gate that is a Python module in the current environment."""
    return gate(str(CURRENT.python), "-m", module, *arguments)


def rust_tests(*profile: str) -> Callable[[], Counts]:
    """The unit, integration and documentation tests of all crates."""

    def check() -> Counts:
        without = ("halfspace_benches", *(() if CHOSEN.all else HEAVY))
        excluded = [word for crate in without for word in ("--exclude", crate)]
        status, said = run(["cargo", "test", "--no-fail-fast", *CRATES, *excluded, *profile])
        # A failed compilation fails no test, and so counts by itself.
        return judged(cargo_counts(said), status, said)

    return check


def judged(counts: Counts, status: int, said: str) -> Counts:
    """The result of tests: a test program with another exit status than 0 has failed, whatever it counted."""
    if status == 0 and not counts.failed:
        return counts
    return counts + Counts(failed=int(not counts.failed), said=said)


def cargo_counts(text: str) -> Counts:
    """Adds up the closing lines of `cargo test`."""
    found = re.findall(r"^test result: .*? (\d+) passed; (\d+) failed; (\d+) ignored;", text, re.MULTILINE)
    return sum((Counts(int(passed), int(failed), int(ignored)) for passed, failed, ignored in found), Counts())


def pytest_tier(where: environment.Environment, folder: str, by_day: Sequence[str] = ()) -> Callable[[], Counts]:
    """pytest over a folder in one environment, without --all over the folders `by_day` if there are any.

    A tier without tests has failed.
    """

    def check() -> Counts:
        with tempfile.TemporaryDirectory(prefix="halfspace-counts-") as temporary:
            file = Path(temporary) / "counts.json"
            chosen = [folder] if CHOSEN.all else [*BY_DAY, *(by_day or [folder])]
            arguments = ["tests/run.py", "--counts", str(file), *chosen]
            status, said = run([str(where.python), *arguments])
            counts = Counts(**json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else Counts()
        return judged(counts, status, said)

    return check


CARGO_CHECKS: dict[str, Callable[[], Counts]] = {
    "rustfmt": gate("cargo", "fmt", *CRATES[:2], "--all", "--check"),
    "dependencies": gate(str(CURRENT.python), "scripts/dev/dependencies.py"),
    "deny": gate("cargo", "deny", *CRATES, "--offline", "check", "bans", "licenses", "sources"),
    "clippy": gate("cargo", "clippy", *CRATES, "--all-targets", "--all-features", "--", "-D", "warnings"),
    # In the profile of the wheel, and with the Python module: cargo then uses the crates that the wheel is made of.
    "rust": rust_tests("--release"),
    "overflow": rust_tests(),
}
"""Name to check, in order. They need no wheel and begin while it is built; `rust` waits for cargo."""

LONG = {"overflow": "the Rust tests with checks of overflow"}
"""Checks that run only with --all or if they are named, and what they are."""

BY_DAY = ("-m", "not slow")
"""Options of pytest without --all."""

DIFFERENT = ("installing", "passes", "read", "settings", "ui", "value_nodes")
LTS_BY_DAY = tuple(f"tests/blender/{name}" for name in DIFFERENT)
"""The folders about what differs between versions of Blender: all that LTS runs without --all."""

HEAVY = ("halfspace_trace", "halfspace_polybeam")
"""Crates whose own unit tests run with --all only: kernels, which are compiled again for them, ten minutes each."""

DAY_SHARE = {"HALFSPACE_TEST_SHARE": "4"}
"""Variables of the Rust tests without --all: hard scenes trace one ray of four."""

PYTHON_CHECKS: dict[str, Callable[[], Counts]] = {
    "ruff": python_tool("ruff", "check", "."),
    "ruff-format": python_tool("ruff", "format", "--check", "."),
    "mypy": python_tool("mypy"),
    "imports": gate(str(CURRENT.python.with_name("lint-imports")), "--no-cache"),
    "workflows": gate(str(CURRENT.python), "scripts/dev/workflows.py"),
    "core": pytest_tier(CURRENT, "tests/core"),
    "blender": pytest_tier(CURRENT, "tests/blender"),
    "blender-lts": pytest_tier(LTS, "tests/blender", LTS_BY_DAY),
}
"""Name to check, in order. They run once the wheel is installed."""

NEED_WHEEL = {"core", "blender", "blender-lts"}

TOOLS = {"rustfmt": "rustfmt", "clippy": "cargo-clippy", "deny": "cargo-deny", "workflows": "go"}
"""The program without which a check is skipped."""


class Queue:
    """Two lists of checks for two threads: each thread takes from its own, then from the end of the other's.

    `ready` is set once the second list may begin.
    """

    def __init__(self, first: list[str], second: list[str]) -> None:
        """Nothing of either list is taken yet."""
        self.ready = threading.Event()
        self._lists = (collections.deque(first), collections.deque(second))
        self._lock = threading.Lock()

    def take(self, own: int) -> str | None:
        """The next check of the thread whose list has this index (0 or 1), None if no check is left."""
        with self._lock:
            if self._lists[own]:
                return self._lists[own].popleft()
        if own == 0:
            self.ready.wait()
        with self._lock:
            return self._lists[1 - own].pop() if self._lists[1 - own] else None


class Session:
    """One run of the chosen checks."""

    def __init__(self, names: list[str]) -> None:
        """Nothing has run yet."""
        self.names = names
        self.results: dict[str, tuple[Counts, str]] = {}
        self.checks = {**CARGO_CHECKS, **PYTHON_CHECKS}
        self.skipped: dict[str, str] = {}
        """Check to the reason why this machine cannot run it."""
        for name, tool in TOOLS.items():
            if shutil.which(tool) is None:
                self.skipped[name] = f"{tool} is not installed"
        self._queue = Queue([n for n in names if n in CARGO_CHECKS], [n for n in names if n not in CARGO_CHECKS])
        self._faults: list[BaseException] = []

    def run(self) -> None:
        """Set up and run all checks, two side by side. Raises SetupError, and what a check raised."""
        other = threading.Thread(target=self._work, args=[0], daemon=True)
        try:
            with environment.alone():
                environments = self._prepare()
                other.start()
                if NEED_WHEEL.intersection(self.names):
                    environment.install_wheel(*environments)
            self._queue.ready.set()
            self._work(1)
            other.join()
        except BaseException:
            RUNNING.stop()
            raise
        if self._faults:
            raise self._faults[0]

    def _prepare(self) -> list[environment.Environment]:
        """Make the environments ready, without the native module. Returns those that are. Raises SetupError.

        If only Blender LTS cannot be set up, its check fails or is skipped, and the others run.
        """
        environment.prepare(CURRENT)
        if "blender-lts" not in self.names:
            return [CURRENT]
        try:
            environment.prepare(LTS)
        except environment.NoPythonError as error:
            self.skipped["blender-lts"] = str(error)
            return [CURRENT]
        except environment.SetupError as error:
            said = f"[set-up] blender-lts fails: {error}"
            print(said, flush=True)
            self.checks["blender-lts"] = lambda: Counts(failed=1, said=said)
            return [CURRENT]
        return [CURRENT, LTS]

    def _work(self, own: int) -> None:
        """Run checks until none is left, as one of two threads."""
        try:
            while (name := self._queue.take(own)) is not None:
                self._check(name)
        except BaseException as error:
            if own == 1:
                raise
            self._faults.append(error)

    def _check(self, name: str) -> None:
        reason = self.skipped.get(name)
        print(f"==== {name}" + (f": skipped, {reason}" if reason else ""), flush=True)
        began = time.monotonic()
        NAME.check = name
        counts = Counts(skipped=1) if reason else self.checks[name]()
        self.results[name] = counts, reason or f"{time.monotonic() - began:.0f} s"
        print(f"==== {name}: {counts}", flush=True)


def left_out(names: list[str], total: Counts) -> list[str]:
    """What a day does not need of these checks, one line each."""
    if CHOSEN.all:
        return []
    lines = [text for name, text in LONG.items() if name not in names and not CHOSEN.checks]
    if total.left_out:
        lines.append(f"{total.left_out} slow tests")
    if "blender-lts" in names:
        lines.append(f"in Blender LTS, all folders but {', '.join(DIFFERENT)}")
    if {"rust", "overflow"} & {*names}:
        lines += ["three of four rays of the Rust tests' hard scenes", f"unit tests within {' and '.join(HEAVY)}"]
    return lines


def main(arguments: list[str]) -> int:
    """Run the checks that the arguments choose. Returns the exit status."""
    # Unlike other commands, shows the whole traceback of a fault of this script itself.
    try:
        return work(arguments)
    except KeyboardInterrupt:
        print("test: stopped", file=sys.stderr, flush=True)
        return 130


def read(arguments: list[str]) -> None:
    """Read the options, without anything being set up for that. Ends the process after --help and bad usage."""
    parser = argparse.ArgumentParser(
        prog="test",
        description="The checks of the project. From nothing they download 1.6 GB and take half an hour on two cores, "
        "most of it for compilation.",
    )
    parser.add_argument("--all", action="store_true", help="also what a release needs; takes an hour more")
    parser.add_argument(
        "checks", nargs="*", metavar="CHECK", help=f"beginnings of names: {', '.join([*CARGO_CHECKS, *PYTHON_CHECKS])}"
    )
    vars(CHOSEN).update(vars(parser.parse_args(arguments)))


def work(arguments: list[str]) -> int:
    """Run the checks and print the summary. Returns the exit status."""
    known = [*CARGO_CHECKS, *PYTHON_CHECKS]
    read(arguments)
    wanted = CHOSEN.checks
    # Refused even with known names: a check that is misspelt would else be taken for one that passed.
    unknown = [word for word in wanted if not any(name.startswith(word) for name in known)]
    if unknown:
        print(f"test: no check is called {unknown[0]!r}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    start = time.monotonic()
    names = [name for name in known if (name.startswith(tuple(wanted)) if wanted else CHOSEN.all or name not in LONG)]
    session = Session(names)
    try:
        session.run()
    except environment.SetupError as error:
        print(f"The set-up failed: {error}\n\n{Counts(failed=1)}", flush=True)
        return 1
    results = {name: session.results[name] for name in session.names}
    for name, (counts, _) in results.items():
        if counts.failed:
            last = [line[:LINE_WIDTH] for line in counts.said.splitlines() if line.strip()][-LAST_LINES:]
            print("\n".join([f"\n==== {name} failed, and said last:", *last]))
    print(f"\n==== Summary after {time.monotonic() - start:.0f} s", flush=True)
    for name, (counts, remark) in results.items():
        print(f"{'FAILED ' if counts.failed else '':>7}{name:<14} {counts} ({remark})")
    total = sum((counts for counts, _ in results.values()), Counts())
    for line in left_out(session.names, total):
        print(f"left out: {line} (--all runs it)")
    print(f"\n{total}", flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    # The checks lead sessions of their own: a signal from outside ends only this process, which then ends them.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    read(sys.argv[1:])
    environment.continue_in(CURRENT)
    sys.exit(main(sys.argv[1:]))

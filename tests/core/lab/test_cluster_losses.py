# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps on a cluster of real processes, as users start them, whose workers or scheduler are killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from addon.lab.bench import cluster
from addon.lab.commands import bench
from tests.sweep_runs import OPTIONS, ROWS, table

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem())),
    pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals"),
]

PROGRAM = str(Path(sys.executable).with_name("dask"))
LOCAL = ("--host", "127.0.0.1", "--no-dashboard")


class Farm:
    """A scheduler, workers by name, and a gate that rows wait at while it is shut. All waits end with the sweep."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.over = threading.Event()
        """Set when the sweep has ended: nothing more can be waited for."""
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.hold = folder / "hold"
        file = folder / "scheduler.json"
        self.start("scheduler", *LOCAL, "--port", "0", "--scheduler-file", str(file))
        self.until(lambda: self.alive("scheduler") and file.is_file() and file.read_text().endswith("}"))
        self.address = json.loads(file.read_text(encoding="utf-8"))["address"]

    def start(self, name: str, *words: str) -> None:
        """Start `dask scheduler`, or a worker with any other name."""
        command = [PROGRAM, name if name == "scheduler" else "worker", *words]
        with (self.folder / f"{name}.log").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                command,
                stdout=log,
                stderr=log,
                env={**os.environ, "GATE": str(self.folder), "GATE_NAME": f"{name} waits"},
                start_new_session=True,
            )

    def worker(self, name: str) -> None:
        gate = Path(__file__).parents[2] / "gated_worker.py"
        words = ("--nthreads", "1", "--preload", str(gate), "--local-directory", str(self.folder / name))
        self.start(name, self.address, *LOCAL, *words)

    def alive(self, name: str) -> bool:
        """True; fails if the process has ended by itself."""
        assert self.processes[name].poll() is None, (self.folder / f"{name}.log").read_text()
        return True

    def kill(self, name: str) -> None:
        """End a process and all that it started, as `kill -9` does."""
        process = self.processes.pop(name)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def until(self, happened: Callable[[], bool]) -> None:
        """Wait; fails if the sweep ends before."""
        while not happened():
            assert not self.over.is_set(), "the sweep ended too early"
            time.sleep(0.02)

    def shut(self, *names: str) -> None:
        """Shut the gate, and wait until each of these workers has a row that waits there."""
        self.hold.touch()
        self.until(lambda: all(self.alive(name) and (self.folder / f"{name} waits").exists() for name in names))

    def open(self) -> None:
        self.hold.unlink(missing_ok=True)


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[Farm]:
    """A scheduler with two workers, ended afterwards."""
    (tmp_path / "farm").mkdir()
    made = Farm(tmp_path / "farm")
    try:
        made.worker("one")
        made.worker("two")
        yield made
    finally:
        for name in list(made.processes):
            made.kill(name)


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each row of a scene was handed to a worker."""
    count: Counter[str] = Counter()

    def say(text: str) -> None:
        row, placed, _ = text.partition(" on tcp:")
        count.update([row] if placed else [])

    monkeypatch.setattr(bench, "say", say)
    # A busy machine may need minutes to start a worker.
    monkeypatch.setattr(cluster, "START_SECONDS", 3600.0)
    return count


def disturbed(farm: Farm, arguments: list[str], disturb: Callable[[], None]) -> int:
    """Run a sweep on the farm, and `disturb` next to it. Returns the exit status of the sweep."""

    def beside() -> None:
        try:
            disturb()
        finally:
            farm.open()

    with ThreadPoolExecutor(1) as pool:
        ran = pool.submit(beside)
        try:
            status = bench.main([*arguments, "--cluster", farm.address])
        finally:
            farm.over.set()
        ran.result()
    return status


def finished(out: Path) -> int:
    journal = out / "rows.jsonl"
    return journal.read_text(encoding="utf-8").count('"key"') if journal.is_file() else 0


def test_both_workers_are_killed_one_after_the_other_and_come_back(
    farm: Farm, scenes: list[str], tmp_path: Path, whole: list[Any], handed: Counter[str]
) -> None:
    out = tmp_path / "out"

    def disturb() -> None:
        farm.until(lambda: finished(out) >= 2)
        farm.shut("one", "two")
        farm.kill("one")
        # The sweep goes on with the other worker alone.
        before = finished(out)
        farm.open()
        farm.until(lambda: finished(out) > before)
        farm.shut("two")
        farm.kill("two")
        assert not (out / "bench.json").exists()
        farm.worker("three")
        farm.worker("four")
        farm.shut("three", "four")

    assert disturbed(farm, [*scenes, *OPTIONS, "--out", str(out)], disturb) == 0
    assert sum(handed.values()) > len(handed), "rows that were in flight are handed out again"
    assert finished(out) == 2 * (ROWS + 1), "with Embree's; nothing is doubled"
    assert table(out) == whole


def test_a_killed_scheduler_ends_the_sweep_in_one_line_and_a_second_run_continues_it(
    farm: Farm,
    scenes: list[str],
    tmp_path: Path,
    whole: list[Any],
    handed: Counter[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    arguments = [*scenes, *OPTIONS, "--out", str(out)]

    def disturb() -> None:
        farm.until(lambda: finished(out) >= 2)
        farm.shut("one", "two")
        farm.kill("scheduler")

    assert disturbed(farm, arguments, disturb) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("bench:")]
    assert lines == [
        "bench: the scheduler is gone, rows of soup-1 are missing: start a cluster and run this command again"
    ]
    assert bench.main(arguments) == 0
    assert finished(out) == 2 * (ROWS + 1), "what was kept is not measured again"
    assert table(out) == whole

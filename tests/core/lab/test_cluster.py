# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps on a cluster: no row is lost or doubled after kills, and a lost cluster is reported in one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import halfspace_native
import pytest

from addon.core.measure import benchmark
from addon.core.scene import workload
from addon.lab.bench import cluster
from addon.lab.commands import bench
from scripts.dev import environment
from tests.sweep_runs import OPTIONS, ROWS, soups, table

pytestmark = pytest.mark.slow

BENCH = str(environment.ROOT / "scripts" / "bench.py")

LARGE = os.environ.get("HALFSPACE_LARGE_SWEEP")
"""Set it for the check of 2,079 rows on a cluster; it takes some minutes."""


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
@pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals")
def test_a_sweep_that_is_killed_twice_gives_the_rows_of_an_undisturbed_one(
    scenes: list[str], tmp_path: Path, whole: list[Any]
) -> None:
    out = tmp_path / "out"
    command = [sys.executable, BENCH, *scenes, *OPTIONS, "--cluster", "local:2", "--out", str(out)]
    resumed_after_kills(command, out, (2, 6), seconds=500)
    assert _finished(out) <= 2 * (ROWS + 1), "nothing is doubled"
    assert table(out) == whole


@pytest.mark.timeout(0)
@pytest.mark.skipif(not LARGE, reason="takes minutes; set HALFSPACE_LARGE_SWEEP=1")
@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
def test_three_scenes_twelve_structures_all_k_and_seven_seeds_survive_two_kills(tmp_path: Path) -> None:
    structures = halfspace_native.structures()
    with_both = [s["id"] for s in structures if {"k", "seed"} <= {p["name"] for p in s["parameters"]}]
    assert len(with_both) == 12
    chosen = ",".join(f"{name}:traversal=dir" for name in with_both)
    command = [*soups(tmp_path, 3, 64), "--structures", chosen, "--k", "2-10", "--seeds", "1-7"]
    command += ["--size", "16x16", "--repeats", "1", "--check-rays", "64", "--curve", "none", "--only-rays"]
    assert bench.main([*command, "--out", str(tmp_path / "whole")]) == 0
    whole = table(tmp_path / "whole")
    # Trees whose directions include the axes have at least three.
    assert len(whole) == 3 * 7 * sum(8 if "-plus" in name else 9 for name in with_both)
    out = tmp_path / "out"
    command = [sys.executable, BENCH, *command, "--cluster", "local:2", "--out", str(out)]
    resumed_after_kills(command, out, (len(whole) // 3, 2 * len(whole) // 3), seconds=3600)
    assert _finished(out) <= len(whole) + 3, "nothing is doubled"
    assert table(out) == whole


def resumed_after_kills(command: list[str], out: Path, rows_at_kills: tuple[int, ...], seconds: float) -> None:
    """Run a command, kill it with all its workers at each of these numbers of rows, and let the last run end.

    Checks that the last run keeps the finished rows. seconds: time limit of each run.
    """
    for enough in rows_at_kills:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
        try:
            deadline = time.monotonic() + seconds
            while _finished(out) < enough:
                assert process.poll() is None, "it ended before it could be killed"
                assert time.monotonic() < deadline
                time.sleep(0.02)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        assert not (out / "report.html").exists()
    kept = _finished(out)
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, done.stderr
    assert kept < _finished(out), "what was kept is not measured again"


def _finished(folder: Path) -> int:
    journal = folder / "rows.jsonl"
    return journal.read_text(encoding="utf-8").count('"key"') if journal.is_file() else 0


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
def test_a_lost_scheduler_raises_a_cluster_error_not_a_folder_error(scenes: list[str]) -> None:
    class Gone:
        def scatter(self, *_: Any, **__: Any) -> None:
            """The scene is accepted before the scheduler is lost."""

        def scheduler_info(self, **_: Any) -> Any:
            raise OSError("ConnectionPool closing.")

    loaded = workload.load_npz(Path(scenes[0]))
    with pytest.raises(
        cluster.ClusterError, match=r"the scheduler is gone, rows of soup-1 are missing: .* \(Connection"
    ):
        list(cluster._measure(Gone(), loaded, ["kd"], None, benchmark.Options(), lambda _: None))


LOSSES = {"killed, and another comes": 0, "gone for good": 2}
"""Exit status by the loss of the only worker, which alone has the scene."""


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
@pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals")
@pytest.mark.parametrize("loss", LOSSES)
def test_a_sweep_survives_the_loss_of_its_scene_or_fails_in_one_line(
    scenes: list[str], tmp_path: Path, capsys: Any, monkeypatch: Any, loss: str
) -> None:
    import distributed

    lost: list[str] = []

    def say(text: str) -> None:
        if " on tcp:" in text and not lost:
            lost.append(text)
            client = distributed.default_client()
            if LOSSES[loss]:
                monkeypatch.setattr(cluster, "START_SECONDS", 1.0)
                client.cluster.scale(0)
            else:
                (worker,) = client.run(os.getpid).values()
                os.kill(worker, signal.SIGKILL)

    monkeypatch.setattr(bench, "say", say)
    out = tmp_path / "out"
    arguments = [scenes[0], *OPTIONS, "--curve", "none", "--cluster", "local:1", "--out", str(out)]
    assert bench.main(arguments) == LOSSES[loss]
    assert lost
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("bench:")]
    if LOSSES[loss]:
        assert len(lines) == 1
        assert "workers are gone" in lines[0]
    else:
        assert len(table(out)) == ROWS
        assert not lines


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
@pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals")
def test_a_finished_row_lost_with_its_worker_is_given_up_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    monkeypatch.setattr(cluster, "HANDING_SECONDS", 1.0)
    with cluster.measurer("local:1", benchmark.Options(), lambda _: None):
        client = distributed.default_client()
        (worker,) = cluster._workers(client)
        task = client.submit(os.getpid, pure=False, workers=[worker], allow_other_workers=False)
        distributed.wait([task], timeout=300)
        assert task.done()
        (process,) = client.run(os.getpid).values()
        os.kill(process, signal.SIGKILL)
        assert cluster._ended(task) == (None, None)


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
def test_local_workers_start_while_the_default_port_is_taken() -> None:
    import socket
    import urllib.request

    import distributed

    with socket.socket() as taken:
        try:
            taken.bind(("", 8787))  # the default port of Dask's dashboard
            taken.listen()
        except OSError:
            pass  # another program has it
        with cluster.measurer("local:1", benchmark.Options(), lambda _: None):
            port = distributed.default_client().scheduler_info()["services"]["dashboard"]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=300) as answer:
                assert answer.status == 200


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
def test_an_unreachable_cluster_fails_in_one_line(
    scenes: list[str], tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(cluster, "START_SECONDS", 0.5)
    assert bench.main([*scenes, *OPTIONS, "--cluster", "tcp://127.0.0.1:9", "--out", str(tmp_path / "out")]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("bench:")]
    assert len(lines) == 1
    assert "no workers" in lines[0]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps on a cluster: killed and resumed, without workers, without a scheduler; no row is lost or doubled."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bench
import halfspace_native
import pytest
from sweep_runs import OPTIONS, ROWS, soups, table

from addon.core.measure import benchmark
from addon.core.scene import workload
from lab.bench import cluster

LARGE = os.environ.get("HALFSPACE_LARGE_SWEEP")
"""Set it for the check of 2,079 rows on a cluster; it takes some minutes."""


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
@pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals")
def test_a_sweep_on_a_cluster_that_is_killed_twice_ends_as_if_it_had_not(
    scenes: list[str], tmp_path: Path, whole: list[Any]
) -> None:
    out = tmp_path / "out"
    command = [sys.executable, bench.__file__, *scenes, *OPTIONS, "--cluster", "local:2", "--out", str(out)]
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
    # Where the axes are among the directions there are three at least.
    assert len(whole) == 3 * 7 * sum(8 if "-plus" in name else 9 for name in with_both)
    out = tmp_path / "out"
    command = [sys.executable, bench.__file__, *command, "--cluster", "local:2", "--out", str(out)]
    resumed_after_kills(command, out, (len(whole) // 3, 2 * len(whole) // 3), seconds=3600)
    assert _finished(out) <= len(whole) + 3, "nothing is doubled"
    assert table(out) == whole


def resumed_after_kills(command: list[str], out: Path, rows_at_kills: tuple[int, ...], seconds: float) -> None:
    """Run it, kill it with all its workers after so many rows, each time, and let it end. Checks what was kept."""
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
def test_a_scheduler_that_goes_is_no_folder_that_cannot_be_written(scenes: list[str]) -> None:
    class Gone:
        def scatter(self, *_: Any, **__: Any) -> None:
            """The scene was still taken."""

        def scheduler_info(self, **_: Any) -> Any:
            raise OSError("ConnectionPool closing.")

    loaded = workload.load_npz(Path(scenes[0]))
    with pytest.raises(cluster.ClusterError, match="the cluster is gone, rows of soup-1 are missing: Connection"):
        list(cluster._measure(Gone(), loaded, ["kd"], None, benchmark.Options(), lambda _: None))


LOSSES = {"killed, and another comes": 0, "gone for good": 2}
"""What befalls the only worker, which alone has the scene, and the exit status."""


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
@pytest.mark.skipif(os.name == "nt", reason="processes are killed by signals")
@pytest.mark.parametrize("loss", LOSSES)
def test_a_worker_that_takes_the_scene_with_it_is_survived_or_said_in_one_line(
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
    asked = [scenes[0], *OPTIONS, "--curve", "none", "--cluster", "local:1", "--out", str(out)]
    assert bench.main(asked) == LOSSES[loss]
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
def test_a_finished_row_that_goes_with_its_worker_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_workers_here_are_started_whoever_else_has_some() -> None:
    import socket
    import urllib.request

    import distributed

    with socket.socket() as taken:
        try:
            taken.bind(("", 8787))  # where a Dask scheduler listens if nobody tells it otherwise
            taken.listen()
        except OSError:
            pass  # somebody has some
        with cluster.measurer("local:1", benchmark.Options(), lambda _: None):
            port = distributed.default_client().scheduler_info()["services"]["dashboard"]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=300) as answer:
                assert answer.status == 200


@pytest.mark.skipif(cluster.problem() is not None, reason=str(cluster.problem()))
def test_a_cluster_that_is_not_there_is_one_line(
    scenes: list[str], tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(cluster, "START_SECONDS", 0.5)
    assert bench.main([*scenes, *OPTIONS, "--cluster", "tcp://127.0.0.1:9", "--out", str(tmp_path / "out")]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("bench:")]
    assert len(lines) == 1
    assert "no workers" in lines[0]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps on a Dask cluster, one timed row per worker at a time.

Workers need numpy and the native module; the scene and this package are sent to them. A row that is lost with its
worker is retried on another one.
"""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import tempfile
import time
import zipfile
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

from ...core.base import native
from ...core.base.native import first_line
from ...core.measure import benchmark, rows
from ...core.measure.benchmark import Finished, Options, Prepared
from ...core.report import results
from ...core.scene.workload import Workload
from ...core.structures import specs
from . import sweep
from .sweep import Measured, Measurer

ATTEMPTS = 3
"""Number of attempts per row. A row whose worker died on each of them is given up: it may be the cause."""

POLL_SECONDS = 1.0
"""Interval at which workers and rows are checked."""

START_SECONDS = 60.0
"""Time limit for the first worker to appear, in seconds."""

HANDING_SECONDS = 60.0
"""Time limit for fetching a finished row, in seconds; a row has a few kilobytes."""


class ClusterError(RuntimeError):
    """The cluster cannot be used. The message gives the reason in one line."""


def problem() -> str | None:
    """The reason why clusters cannot be used here, or None."""
    return None if importlib.util.find_spec("distributed") else "the package distributed is not installed"


MOST_WORKERS = 1024
"""Limit on the processes started here, the same as for threads."""


def check(address: str) -> None:
    """Check a cluster's address and that Dask is installed. Raises ClusterError."""
    count = local_workers(address)
    if count is not None and not 1 <= count <= MOST_WORKERS:
        raise ClusterError(f"--cluster: expected local:N with N workers, 1 to {MOST_WORKERS}, got {address!r}")
    reason = problem()
    if reason:
        raise ClusterError(f"--cluster: {reason}")


def local_workers(address: str) -> int | None:
    """The N of "local:N", 0 if it is not a number, None for the address of a remote cluster."""
    kind, _, number = address.partition(":")
    if kind != "local":
        return None
    return int(number) if specs.is_whole(number) else 0


@contextlib.contextmanager
def measurer(address: str, options: Options, say: Callable[[str], None]) -> Iterator[Measurer]:
    """Yield a measurer for the cluster at `address`; "local:N" starts N workers here. Raises ClusterError."""
    check(address)
    import distributed

    with contextlib.ExitStack() as stack:
        target: Any = address
        count = local_workers(address)
        if count is not None:
            target = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=None,
                    # Dask listens even without a dashboard: restrict it to this machine, on any free port.
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    silence_logs=logging.ERROR,
                )
            )
        try:
            client = stack.enter_context(distributed.Client(target, timeout=START_SECONDS))
            client.wait_for_workers(1, timeout=START_SECONDS)
        except (OSError, ValueError, TimeoutError) as error:
            raise ClusterError(f"--cluster {address}: no workers: {error}") from error
        client.upload_file(str(_package(Path(stack.enter_context(tempfile.TemporaryDirectory())))))
        say(f"{len(_workers(client))} workers at {client.scheduler_info()['address']}")
        yield lambda workload, wanted, anchor: _measure(client, workload, wanted, anchor, options, say)


def _package(folder: Path) -> Path:
    """Zip `core` and `lab`, which need no Blender, for workers to import. Returns the path."""
    path = folder / "halfspace-core.zip"
    package = __name__.partition(".lab.")[0]  # `addon`, or that of the installed package
    root = Path(__file__).resolve().parents[2]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{package}/__init__.py", "")
        for one in sorted([*(root / "core").rglob("*.py"), *(root / "lab").rglob("*.py")]):
            archive.write(one, f"{package}/{one.relative_to(root).as_posix()}")
    return path


def _workers(client: Any) -> list[str]:
    return list(client.scheduler_info(n_workers=-1)["workers"])


def _measure(
    client: Any,
    workload: Workload,
    wanted: Sequence[str],
    anchor: str | None,
    options: Options,
    say: Callable[[str], None],
) -> Iterator[Measured]:
    """Measure on a cluster that may disappear at any time. Raises ClusterError."""
    try:
        yield from _hand_out(client, workload, wanted, anchor, options, say)
    except OSError as error:
        raise ClusterError(f"{_gone(workload)} ({first_line(error)})") from error


def _gone(workload: Workload) -> str:
    return f"the scheduler is gone, rows of {workload.name} are missing: start a cluster and run this command again"


def _hand_out(
    client: Any,
    workload: Workload,
    wanted: Sequence[str],
    anchor: str | None,
    options: Options,
    say: Callable[[str], None],
) -> Iterator[Measured]:
    """Hand out rows, one at a time to each worker, and yield them as they finish. Raises ClusterError and OSError."""
    import distributed

    # Keep the state of the hand-out: rows to measure, their attempts, and the row of each worker.
    waiting = deque(wanted)
    attempts: Counter[str] = Counter()
    running: dict[str, tuple[str, Any]] = {}
    scene = None
    seen = time.monotonic()
    while waiting or running:
        # Give up when no worker has been alive for START_SECONDS.
        alive = _workers(client)
        if alive:
            seen = time.monotonic()
        elif time.monotonic() - seen > START_SECONDS:
            raise ClusterError(
                f"all workers are gone; {len(waiting) + len(running)} rows of {workload.name} are missing"
            )
        if alive and scene is None:
            scene = _sent(client, workload)
        # Give each idle worker a row.
        for address in alive if scene is not None else ():
            if address not in running and waiting:
                spec = waiting.popleft()
                attempts[spec] += 1
                say(f"{workload.name}: {spec} on {address}")
                task = client.submit(
                    _row, scene, spec, anchor, options, pure=False, workers=[address], allow_other_workers=False
                )
                running[address] = spec, task
        # Rows lost together with the scene are cancelled; waiting for them raises.
        with contextlib.suppress(TimeoutError, CancelledError):
            tasks = [task for _, task in running.values()]
            distributed.wait(tasks, timeout=POLL_SECONDS, return_when="FIRST_COMPLETED")
        # Without a scheduler all rows are lost at once, which is no fault of theirs.
        if client.status != "running":
            raise ClusterError(_gone(workload))
        # Collect finished rows, and requeue those lost with their worker.
        for address, (spec, task) in list(running.items()):
            lost = address not in alive or task.status in ("lost", "cancelled")
            if not (lost or task.done()):
                continue
            del running[address]
            measured, failure = (None, None) if lost else _ended(task)
            if measured is not None:
                yield measured
            elif (failure is None or isinstance(failure, distributed.KilledWorker)) and attempts[spec] < ATTEMPTS:
                task.cancel()
                waiting.append(spec)
                scene = None  # the scene may be lost with the worker
            else:
                reason = failure or RuntimeError(f"{ATTEMPTS} workers died on it")
                yield rows.failed(native.load(), workload, spec, options.threads, reason), {"name": address}


def _sent(client: Any, workload: Workload) -> Any:
    """The scene on all workers, so that it survives the death of any one of them; None if the last has just died."""
    try:
        return client.scatter(workload, hash=False, broadcast=True)
    except ValueError:
        # Dask refuses to copy to no worker at all.
        return None


def _ended(task: Any) -> tuple[Measured | None, BaseException | None]:
    """The row of a finished task, or its failure; neither if it was lost at the last moment."""
    try:
        failure = task.exception(timeout=HANDING_SECONDS)
        return (task.result(timeout=HANDING_SECONDS), None) if failure is None else (None, failure)
    except (CancelledError, TimeoutError):
        # Fetching a row that is lost with its worker would wait for that worker forever.
        return None, None


_scenes: dict[tuple[str, Options], Prepared] = {}
"""Cache of a worker: the scene it measured last, with its rays and the reference's answers."""


def _row(workload: Workload, spec: str, anchor: str | None, options: Options) -> Measured:
    """Measure one row, on a worker."""
    module = native.load()
    module.use_level(options.level)
    place = workload.fingerprint(), options
    if place not in _scenes:
        _scenes.clear()
        _scenes[place] = benchmark.prepared(module, workload, options)
    chosen = sweep.beside([spec], anchor)
    for event in benchmark.events(module, workload, chosen, options, _scenes[place], anchor):
        if isinstance(event, Finished) and event.row["spec"] == spec:
            return event.row, results.machine(module)
    raise RuntimeError(f"{spec} gave no row")

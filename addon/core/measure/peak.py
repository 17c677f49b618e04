# SPDX-License-Identifier: GPL-3.0-or-later
"""Peak memory of a build, measured in a separate process.

The process holds only the scene; the result is the largest growth of its resident memory during the build.
"""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..base.interface import Native
    from .preparation import Options
    from .timing import Candidate

TIME_LIMIT = 600
"""Seconds after which the process of a build is killed."""


class PeakError(RuntimeError):
    """The memory could not be measured. The message gives the reason in one line."""


def save_scene(vertices: Any, triangles: Any) -> Path:
    """Save the arrays to a temporary file for a `Measurement`; the caller removes it. Raises OSError."""
    handle, name = tempfile.mkstemp(prefix="halfspace-peak-", suffix=".npz")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, vertices=vertices, triangles=triangles)
    except BaseException:
        Path(name).unlink()
        raise
    return Path(name)


class Measurement:
    """A build in its own process, started at once.

    scene: a file of `save_scene`. memory_limit: bytes that the build may use, None for the native module's limit.
    Raises PeakError.
    """

    def __init__(self, native: Native, scene: Path, spec: str, threads: int, memory_limit: int | None = None) -> None:
        # Let the process import the compiled module and NumPy from their current places.
        library = str(Path(native.__file__ or "").resolve().parent)
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([library, str(Path(np.__file__).parents[1])])}
        # Pass the source text, not the file's path: this module may lie in an archive.
        arguments = [str(scene), spec, str(threads), *([] if memory_limit is None else [str(memory_limit)])]
        command = [sys.executable, "-c", inspect.getsource(sys.modules[__name__]), *arguments]
        self.spec = spec
        self._deadline = time.monotonic() + TIME_LIMIT
        try:
            self._process = subprocess.Popen(
                command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
        except OSError as error:
            raise PeakError(str(error)) from error

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds`; whether the process has ended by itself or was killed at its time limit."""
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            if time.monotonic() < self._deadline:
                return False
            self._process.kill()
            self._process.wait()
        return True

    def result(self) -> int:
        """The bytes, once the process has ended. Raises PeakError."""
        out, errors = self._process.communicate()
        if self._process.returncode != 0 or not out.strip().isdigit():
            status = f"the process that measured it ended with status {self._process.returncode}"
            raise PeakError((errors.strip().splitlines() or [status])[-1])
        return int(out)

    def stop(self) -> None:
        """Kill the process if it still runs."""
        self._process.kill()
        self._process.communicate()


def of_builds(
    native: Native, candidates: Sequence[Candidate], scene: Path, options: Options
) -> Iterator[tuple[str, bool]]:
    """Measure the builds of candidates in processes of their own, one per core; nothing else may be timed meanwhile.

    scene: a file of `save_scene`. Sets `peak_bytes` of each candidate, or adds the reason to its `left_out`. Yields
    the text of what runs next, and whether a build begins. Close the iterator to stop the processes.
    """
    # Import here: the process of a `Measurement` runs this file's text alone.
    from ..base.native import first_line

    at_once = max(1, (os.cpu_count() or 1) // options.threads)
    running: dict[str, Measurement] = {}
    waiting = list(candidates)
    try:
        while waiting or running:
            # Start processes while cores are free.
            while waiting and len(running) < at_once:
                spec = waiting.pop(0).spec
                running[spec] = Measurement(native, scene, spec, options.threads, options.memory_limit)
                yield f"{spec}: building in a process of its own, for the memory", True
            # Collect the results of those that ended.
            ended = [spec for spec, one in running.items() if one.wait(0.05)]
            if not ended:
                yield f"{', '.join(running)}: building, for the memory", False
            for candidate in (c for c in candidates if c.spec in ended):
                try:
                    candidate.peak_bytes = running.pop(candidate.spec).result()
                except PeakError as error:
                    candidate.left_out.append(f"peak memory: {first_line(error)}")
    except PeakError as error:
        # No process can be started: note the reason for all candidates without a result.
        for candidate in candidates:
            if candidate.peak_bytes is None:
                candidate.left_out.append(f"peak memory: {first_line(error)}")
    finally:
        for one in running.values():
            one.stop()


def _resident() -> tuple[int, int]:
    """Resident bytes now and at their peak. Only Linux reports both; elsewhere the peak is given for both."""
    status = Path("/proc/self/status")
    if status.exists():
        lines = dict(line.split(":", 1) for line in status.read_text(encoding="utf-8").splitlines())
        now, most = (int(lines[key].split()[0]) * 1024 for key in ("VmRSS", "VmHWM"))
        return now, most
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return most, most


def _forget_peak() -> None:
    """Reset the peak to the current resident size, where the system supports it."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    except OSError:
        # The peak so far then counts as the baseline: the growth comes out too small rather than too large.
        return


def main(arguments: list[str]) -> int:
    """Build once and print the bytes. Returns the exit status."""
    import halfspace_native

    path, spec, threads, *limit = arguments
    with np.load(path) as file:
        vertices, triangles = file["vertices"], file["triangles"]
    # Start the thread pool and other one-time allocations with a build of one triangle.
    halfspace_native.build(vertices[:3], np.array([[0, 1, 2]], np.int32), spec, threads=int(threads))
    _forget_peak()
    before, peak_before = _resident()
    memory_limit = int(limit[0]) if limit else None
    halfspace_native.build(vertices, triangles, spec, threads=int(threads), memory_limit=memory_limit)
    _, peak_after = _resident()
    print(peak_after - (before if peak_after > peak_before else peak_after))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

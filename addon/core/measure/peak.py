# SPDX-License-Identifier: GPL-3.0-or-later
"""The most memory that a build takes, measured in a process of its own.

The process holds the scene and nothing else; the number is by how much its resident memory rose at most while it built.
"""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..base.interface import Native

TIME_LIMIT = 600
"""Seconds after which a build is given up."""


class PeakError(RuntimeError):
    """The memory could not be measured. The message says why, in one line."""


def save_scene(vertices: Any, triangles: Any) -> Path:
    """The arrays in a temporary file for a `Measurement`; whoever asked removes it. Raises OSError."""
    handle, name = tempfile.mkstemp(prefix="halfspace-peak-", suffix=".npz")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, vertices=vertices, triangles=triangles)
    except BaseException:
        Path(name).unlink()
        raise
    return Path(name)


class Measurement:
    """A build in a process of its own, begun at once.

    scene: a file of `save_scene`. memory_limit: bytes that it may take, None for what the native module allows.
    Raises PeakError.
    """

    def __init__(self, native: Native, scene: Path, spec: str, threads: int, memory_limit: int | None = None) -> None:
        # Let the process import the compiled module and NumPy from their current places.
        library = str(Path(native.__file__ or "").resolve().parent)
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([library, str(Path(np.__file__).parents[1])])}
        # The text, not the file: this module may lie in an archive.
        asked = [str(scene), spec, str(threads), *([] if memory_limit is None else [str(memory_limit)])]
        command = [sys.executable, "-c", inspect.getsource(sys.modules[__name__]), *asked]
        self.spec = spec
        self._deadline = time.monotonic() + TIME_LIMIT
        try:
            self._process = subprocess.Popen(
                command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
        except OSError as error:
            raise PeakError(str(error)) from error

    def wait(self, seconds: float) -> bool:
        """Wait for at most so long; whether it has ended, by itself or because its time was over."""
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            if time.monotonic() < self._deadline:
                return False
            self._process.kill()
            self._process.wait()
        return True

    def result(self) -> int:
        """The bytes, once it has ended. Raises PeakError."""
        out, errors = self._process.communicate()
        if self._process.returncode != 0 or not out.strip().isdigit():
            status = f"the process that measured it ended with status {self._process.returncode}"
            raise PeakError((errors.strip().splitlines() or [status])[-1])
        return int(out)

    def stop(self) -> None:
        """End it, if it has not ended."""
        self._process.kill()
        self._process.communicate()


def _resident() -> tuple[int, int]:
    """Bytes that are resident now and that were at most. Linux tells both; elsewhere the second stands for both."""
    status = Path("/proc/self/status")
    if status.exists():
        lines = dict(line.split(":", 1) for line in status.read_text(encoding="utf-8").splitlines())
        now, most = (int(lines[key].split()[0]) * 1024 for key in ("VmRSS", "VmHWM"))
        return now, most
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return most, most


def _forget_peak() -> None:
    """Let the peak begin again at what is resident now, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    except OSError:
        # The peak so far then counts as what was there before: the rise comes out too small rather than too large.
        return


def main(arguments: list[str]) -> int:
    """Build once and print the bytes. Returns the exit status."""
    import halfspace_native

    path, spec, threads, *limit = arguments
    with np.load(path) as file:
        vertices, triangles = file["vertices"], file["triangles"]
    # Starts the thread pool and whatever else a first build brings with it.
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

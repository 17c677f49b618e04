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
from pathlib import Path
from typing import Any

import numpy as np

TIME_LIMIT = 600
"""Seconds after which a build is given up."""


class PeakError(RuntimeError):
    """The memory could not be measured. The message says why, in one line."""


def save_scene(vertices: Any, triangles: Any) -> Path:
    """The arrays in a temporary file for `of_build`; whoever asked removes it. Raises OSError."""
    handle, name = tempfile.mkstemp(prefix="halfspace-peak-", suffix=".npz")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, vertices=vertices, triangles=triangles)
    except BaseException:
        Path(name).unlink()
        raise
    return Path(name)


def of_build(native: Any, scene: Path, spec: str, threads: int) -> int:
    """Bytes. scene: a file of `save_scene`. Raises PeakError."""
    library = str(Path(native.__file__).resolve().parent)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([library, str(Path(np.__file__).parents[1])])}
    # The text, not the file: this module may lie in an archive.
    command = [sys.executable, "-c", inspect.getsource(sys.modules[__name__]), str(scene), spec, str(threads)]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise PeakError(str(error).splitlines()[0]) from error
    if done.returncode != 0 or not done.stdout.strip().isdigit():
        last = (done.stderr.strip().splitlines() or [f"the process ended with status {done.returncode}"])[-1]
        raise PeakError(last)
    return int(done.stdout)


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

    path, spec, threads = arguments
    with np.load(path) as file:
        vertices, triangles = file["vertices"], file["triangles"]
    # Starts the thread pool and whatever else a first build brings with it.
    halfspace_native.build(vertices[:3], np.array([[0, 1, 2]], np.int32), spec, threads=int(threads))
    _forget_peak()
    before, peak_before = _resident()
    halfspace_native.build(vertices, triangles, spec, threads=int(threads))
    _, peak_after = _resident()
    print(peak_after - (before if peak_after > peak_before else peak_after))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

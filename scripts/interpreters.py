# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the Python that a Blender version needs. Runs under any Python 3.8 or newer."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

PROBE = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2]); print(sys.executable)"
"""A Python that cannot run this (Debian ships one without ensurepip) cannot make an environment."""

WHOLE = "; import importlib.metadata as m; assert m.distribution('pip').read_text('INSTALLER')"
"""Added to the probe of an environment. pip writes this file about itself when all of it is there: where it is missing,
the making of the environment was cut short, even if pip starts."""


def find(version: str) -> Path | None:
    """A Python of this version ("3.13") that can make virtual environments, or None.

    What a shim stands for, not the shim: that may stand for another Python tomorrow.
    """
    answers_of_all = map(_ask, _candidates(version))
    return next((Path(lines[1]) for lines in answers_of_all if lines[:1] == (version,)), None)


def answers(path: Path, version: str) -> bool:
    """Whether the interpreter at `path` starts, has this version and can make virtual environments."""
    return _ask(path)[:1] == (version,)


def answers_in_environment(path: Path, version: str) -> bool:
    """Whether the interpreter at `path` answers so, and is that of an environment whose making came to its end."""
    return _ask(path, PROBE + WHOLE)[:1] == (version,)


def _ask(path: Path, probe: str = PROBE) -> tuple[str, ...]:
    """The version and the real place of the interpreter at `path`; empty when it does not answer.

    Whatever PYTHONPATH and the like add to it.
    """
    try:
        done = subprocess.run([str(path), "-I", "-c", probe], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ()
    return tuple(done.stdout.splitlines()) if done.returncode == 0 else ()


def _candidates(version: str) -> Iterator[Path]:
    """Where a Python of this version may be: ourselves, the PATH, pyenv, uv, and the launcher of Windows."""
    if sys.version_info[:2] == tuple(int(part) for part in version.split(".")):
        # Inside an environment, the Python that the environment was made from: it outlives the environment.
        yield Path(getattr(sys, "_base_executable", None) or sys.executable)
    for name in ("python" + version, "python3", "python"):
        found = shutil.which(name)
        if found:
            yield Path(found)
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for folder in newest_first(pyenv.glob(version + "*")):
        yield folder / "bin" / "python3"
    uv = Path.home() / ".local" / "share" / "uv" / "python"
    for folder in newest_first(uv.glob("cpython-" + version + "*")):
        yield folder / "bin" / "python3"
    launcher = shutil.which("py")
    if launcher:
        arguments = [launcher, "-" + version, "-c", "import sys; print(sys.executable)"]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            yield Path(done.stdout.strip())


def newest_first(folders: Iterator[Path]) -> list[Path]:
    """Folders named by version ("3.13.2"), the newest first; compares numbers, so that 3.13.10 beats 3.13.9."""
    return sorted(folders, key=lambda folder: [int(n) for n in re.findall(r"\d+", folder.name)], reverse=True)

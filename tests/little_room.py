# SPDX-License-Identifier: GPL-3.0-or-later
"""A command under a limit on the size of files, as on a disk that is nearly full."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SCRIPT = str(Path(__file__).resolve().parents[1] / "scripts" / "halfspace.py")

PROGRAM = """
import resource, runpy, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
sys.argv = [{script!r}, *{arguments!r}]
runpy.run_path({script!r}, run_name="__main__")
"""


def run(room: int, command: str, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run it to its end. Needs a system with Python's module `resource`."""
    program = PROGRAM.format(room=room, script=SCRIPT, arguments=[command, *arguments])
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=300, env=environment, check=False
    )

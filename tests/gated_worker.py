# SPDX-License-Identifier: GPL-3.0-or-later
"""Preloaded by Dask's workers in tests: while the file `hold` exists, a row waits at its beginning.

The folder GATE holds that file, and one with the worker's name GATE_NAME while a row waits.
"""

from __future__ import annotations

import functools
import inspect
import os
import time
from pathlib import Path

import halfspace_native

FOLDER = Path(os.environ["GATE"])
WAITING = FOLDER / os.environ["GATE_NAME"]

# Dask loads this file twice.
_use_level = inspect.unwrap(halfspace_native.use_level)


@functools.wraps(_use_level)
def use_level(level: str) -> None:
    while (FOLDER / "hold").exists():
        WAITING.touch()
        time.sleep(0.02)
    WAITING.unlink(missing_ok=True)
    _use_level(level)


# The first call of a row into the module.
halfspace_native.use_level = use_level

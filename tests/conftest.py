# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests with and without Blender share, and what each process that runs tests is."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from addon.core.report import results

# A shell that starts the tests in the background has them ignore Ctrl-C, and all processes that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Before bpy is imported: tests must neither read nor write the settings of the user's own Blender, nor of one another.
resources = tempfile.TemporaryDirectory(prefix="halfspace-blender-")
os.environ["BLENDER_USER_RESOURCES"] = resources.name

# A slow machine is no fault of what is tested. The same is drawn everywhere: left alone, hypothesis does so only where
# it sees a CI, and what fails there passes anywhere else. `--hypothesis-profile=search` draws anew at each run.
settings.register_profile("halfspace", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, derandomize=False)
settings.load_profile("halfspace")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave at once after the last words: Blender 4.5 as a module hangs when Python ends after a render."""

    def leave() -> None:
        resources.cleanup()
        os._exit(int(session.exitstatus))

    if "bpy" in sys.modules:
        atexit.register(leave)


@pytest.fixture
def disk_full_at_the_last() -> Callable[[Path], AbstractContextManager[None]]:
    """While the disk is full for the last of as many files as a folder holds, none of these files may change."""

    @contextmanager
    def full(folder: Path) -> Iterator[None]:
        old = {path.name: path.read_bytes() for path in folder.iterdir()}
        written: list[int] = []

        def write(handle: int) -> None:
            written.append(handle)
            if len(written) == len(old):
                raise OSError(28, "No space left on device")

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(results.os, "fsync", write)
            yield
        assert len(written) == len(old) > 1, "it came to the last file"
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == old, "all old, or all new"

    return full

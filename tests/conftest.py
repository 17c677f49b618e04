# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests with and without Blender share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from addon.core.report import results

# A slow machine is no fault of what is tested. The same is drawn everywhere: left alone, hypothesis does so only where
# it sees a CI, and what fails there passes anywhere else. `--hypothesis-profile=search` draws anew at each run.
settings.register_profile("halfspace", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, derandomize=False)
settings.load_profile("halfspace")


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

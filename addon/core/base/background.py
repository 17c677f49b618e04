# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in steps on its own thread, so that a window stays responsive while structures are measured."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any


class Background:
    """Runs an iterator on a daemon thread. A stop takes effect between two steps."""

    def __init__(self, steps: Iterator[Any], see: Callable[[Any], None]) -> None:
        """Start the thread. see: called with each item, on that thread."""
        self._stop = threading.Event()
        self._error: BaseException | None = None

        def work() -> None:
            try:
                for item in steps:
                    if self._stop.is_set():
                        return
                    see(item)
            except BaseException as error:
                self._error = error

        self._thread = threading.Thread(target=work, name="halfspace-measure", daemon=True)
        self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds` for the thread to end. Returns whether it has ended; raises the exception of a failed
        step.
        """
        self._thread.join(seconds)
        if self._thread.is_alive():
            return False
        if self._error is not None:
            raise self._error
        return True

    def stop(self) -> None:
        """Request a stop without waiting: the running step continues, and its result is dropped."""
        self._stop.set()

    def join(self, seconds: float) -> None:
        """Request a stop and wait at most `seconds` for it."""
        self.stop()
        self._thread.join(seconds)

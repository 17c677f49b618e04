# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in steps on a thread of its own, so that a window stays alive while structures are measured."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any


class Background:
    """Goes through an iterator on a thread. Stopping takes effect between two steps."""

    def __init__(self, steps: Iterator[Any], see: Callable[[Any], None]) -> None:
        """Begin. see: called with each item, on that thread."""
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
        """Wait at most so long for the end, whichever it is. Returns whether it has come. Raises what a step raised."""
        self._thread.join(seconds)
        if self._thread.is_alive():
            return False
        if self._error is not None:
            raise self._error
        return True

    def stop(self) -> None:
        """Ask for the end, and do not wait for it: the step that runs goes on, and its result is dropped."""
        self._stop.set()

    def join(self, seconds: float) -> None:
        """Stop and wait, at most so long."""
        self.stop()
        self._thread.join(seconds)

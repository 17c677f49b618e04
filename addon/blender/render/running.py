# SPDX-License-Identifier: GPL-3.0-or-later
"""The final renders in progress. Blender renders on a thread of its own, and may unregister the engine meanwhile."""

from __future__ import annotations

import logging
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

END_SECONDS = 10.0
"""Longest wait for renders to end. Native work ends within a tenth of a second, reading a scene may take longer."""

FREE_SECONDS = 1.0
"""Longest wait for Blender to free the engines of ended renders; with persistent data it keeps them."""

STEP_SECONDS = 0.01
"""Interval of the checks while waiting."""

log = logging.getLogger(__name__)

watchers: list[Callable[[float], None]] = []
"""Called with the share of a picture that is done, 0 to 1, on the thread that renders it."""

_closing = threading.Event()
_threads: dict[int, int] = {}
"""Number of pictures in progress, by the thread that renders them."""

_engines: weakref.WeakSet[Any] = weakref.WeakSet()
"""The engines of pictures, until Blender frees them: its own code uses the class up to then."""


@contextmanager
def picture(engine: Any) -> Iterator[None]:
    """Mark that this thread renders a picture with this engine."""
    thread = threading.get_ident()
    _threads[thread] = _threads.get(thread, 0) + 1
    _engines.add(engine)
    try:
        yield
    finally:
        _threads[thread] -= 1
        if not _threads[thread]:
            del _threads[thread]


def closing() -> bool:
    """Whether renders shall end because the engine is being unregistered."""
    return _closing.is_set()


def start() -> None:
    """Allow renders."""
    _closing.clear()


def stop() -> None:
    """End all renders on other threads, and wait until Blender has freed their engines."""
    _closing.set()
    own = threading.get_ident()
    if not _wait(lambda: not _threads.keys() - {own}, END_SECONDS):
        log.warning("Halfspace was closed during a render that did not end within %g seconds", END_SECONDS)
    if own not in _threads:
        _wait(lambda: not _engines, FREE_SECONDS)


def _wait(done: Callable[[], bool], seconds: float) -> bool:
    """Wait at most `seconds` until `done()`, without the interpreter's lock. Returns whether it is."""
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(STEP_SECONDS)
    return True

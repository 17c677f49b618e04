# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C while a program is being loaded: an exception there would leave modules half imported, and end in a traceback.

Imports only what Python has loaded by itself, so that a script can guard all its other imports.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any

STOPPED = 130
"""Exit status of a program interrupted from the keyboard, as shells report it."""


class _Leave:
    """A handler of SIGINT that ends the process at once with one line and the status STOPPED."""

    def __init__(self, name: str) -> None:
        self._line = f"{name}: stopped\n"

    def __call__(self, *_: object) -> None:
        if sys.stderr is not None:
            with suppress(OSError, ValueError):
                os.write(sys.stderr.fileno(), self._line.encode())  # takes no lock that the interrupted code may hold
        os._exit(STOPPED)


class _Program:
    """The guarded program's handler; None in a process that imports this module for something else."""

    handler: _Leave | None = None


def guard(name: str) -> None:
    """From now on an interrupt ends the process at once. Only while nothing has begun that needs an end."""
    # A process in the background ignores interrupts, and Blender has its own handler.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        _Program.handler = _Leave(name)
        signal.signal(signal.SIGINT, _Program.handler)


@contextmanager
def raising() -> Iterator[None]:
    """Within this context an interrupt raises KeyboardInterrupt, also in a guarded program."""
    is_guarded = _Program.handler is not None and signal.getsignal(signal.SIGINT) is _Program.handler
    with _handler(signal.default_int_handler) if is_guarded else nullcontext():
        yield


@contextmanager
def guarded() -> Iterator[None]:
    """Guard a guarded program again for the time of this context.

    For imports of Blender's module, which an exception may end in a crash, or which may lose the exception.
    """
    own = _Program.handler
    is_free = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with _handler(own) if own is not None and is_free else nullcontext():
        yield


@contextmanager
def _handler(handler: Callable[..., Any]) -> Iterator[None]:
    """Set a handler of SIGINT, and restore the former one at the end."""
    kept = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, kept)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The common frame of all command lines: one line of text and an exit status for every way to end."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from . import interrupt
from .interrupt import STOPPED
from .native import FAILURES, PANIC, in_one_line, reason

BAD_INPUT = 2

INTERRUPTED = "interrupted"
"""Message of the render engine's error for an interrupted render; Blender wraps it in an error of its own."""


class OutputError(Exception):
    """Standard output cannot be written. Not an OSError, because those are reported with the output folder."""


def run(
    name: str,
    arguments: Sequence[str],
    read: Callable[[Sequence[str]], argparse.Namespace],
    work: Callable[[argparse.Namespace], int],
    *,
    keeps: Callable[[argparse.Namespace], Path | None] = lambda _: None,
    told: tuple[type[Exception], ...] = (),
) -> int:
    """Parse a command line and run its work. Returns the exit status: 2 after a failure, 130 after Ctrl-C.

    keeps: returns the folder whose journal holds the finished rows, for the message after an interrupt. told:
    exceptions reported in one line, in addition to FAILURES and OSError, and to ImportError, of libraries that are
    loaded when they are needed.
    """
    caught: tuple[type[Exception], ...] = (*FAILURES, OSError, ImportError, OutputError, *told)
    asked = None
    try:
        with interrupt.raising(), _output():
            asked = read(arguments)
            return work(asked)
    except KeyboardInterrupt:
        return _stopped(name, None if asked is None else keeps(asked))
    except caught as error:
        line = in_one_line(error)
        if line == INTERRUPTED:
            return _stopped(name, None)
        _tell(f"{name}: {line}")
        return BAD_INPUT
    except BaseException as error:
        if type(error).__name__ != PANIC:
            raise
        # Python would end with the status of wrong answers.
        _tell(f"{name}: {reason(error)}")
        return BAD_INPUT


def _stopped(name: str, folder: Path | None) -> int:
    """Report the interrupt, and the folder that holds finished rows if there is one."""
    there = False
    with contextlib.suppress(OSError):
        there = folder is not None and any(b'"key"' in path.read_bytes() for path in folder.glob("rows*.jsonl"))
    _tell(f"{name}: stopped" + (f"; what was finished is kept in {folder}" if there else ""))
    return STOPPED


def _tell(line: str) -> None:
    if sys.stderr is None:  # print would fall back to standard output
        return
    with contextlib.suppress(OSError):  # no other channel is left
        print(line, file=sys.stderr, flush=True)


@contextlib.contextmanager
def _output() -> Iterator[None]:
    """Within this context standard output accepts any character, and a failed write raises OutputError.

    Characters that the encoding lacks are written as escapes, on standard error too.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            with contextlib.suppress(OSError):
                stream.reconfigure(errors="backslashreplace")
    if sys.stdout is None:  # closed before Python started; print does nothing then
        yield
        return
    checked = _Checked(sys.stdout)
    try:
        # Flush inside the context, so that a failed write is reported as this command's error.
        with contextlib.redirect_stdout(checked):
            try:
                yield
            except SystemExit:  # after --help
                checked.flush()
                raise
            checked.flush()
    except BaseException:
        try:
            checked.flush()
        except OutputError:
            _forget(checked)
        raise


def _forget(stream: Any) -> None:
    """Redirect a broken stream to the null device, so that Python's final flush does not fail again."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class _Checked:
    """A text stream that raises OutputError in place of OSError."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write as the wrapped stream does. Raises OutputError."""
        written = self._asked(self._stream.write, text)
        return len(text) if written is None else int(written)  # streams of embedding programs may return None

    def flush(self) -> None:
        """Flush as the wrapped stream does. Raises OutputError."""
        self._asked(self._stream.flush)

    def _asked(self, work: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return work(*arguments)
        except OSError as error:
            raise OutputError(f"standard output cannot be written: {error.strerror or error}") from error

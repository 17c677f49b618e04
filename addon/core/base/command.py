# SPDX-License-Identifier: GPL-3.0-or-later
"""What all command lines share around their work: one line and a status for whatever ends it."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from .native import FAILURES, in_one_line

BAD_INPUT = 2

STOPPED = 130
"""What shells say of a program that was stopped from the keyboard."""

INTERRUPTED = "interrupted"
"""What the render engine says of a render that was stopped so; Blender makes it an error of its own."""


class OutputError(Exception):
    """Standard output cannot be written. No OSError, since those are told with the folder that is being written."""


def run(
    name: str,
    arguments: Sequence[str],
    read: Callable[[Sequence[str]], argparse.Namespace],
    work: Callable[[argparse.Namespace], int],
    *,
    keeps: Callable[[argparse.Namespace], Path | None] = lambda _: None,
    told: tuple[type[Exception], ...] = (),
) -> int:
    """Read a command line and do its work. Returns the exit status: 2 after a failure, 130 after Ctrl-C.

    keeps: the folder whose journal holds what is finished, if the work is stopped. told: what is told in one line,
    beside FAILURES and OSError.
    """
    caught: tuple[type[Exception], ...] = (*FAILURES, OSError, OutputError, *told)
    asked = None
    try:
        with _output():
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


def _stopped(name: str, folder: Path | None) -> int:
    there = False
    with contextlib.suppress(OSError):
        there = folder is not None and any(b'"key"' in path.read_bytes() for path in folder.glob("rows*.jsonl"))
    _tell(f"{name}: stopped" + (f"; what was finished is kept in {folder}" if there else ""))
    return STOPPED


def _tell(line: str) -> None:
    if sys.stderr is None:  # what is printed there would go to standard output
        return
    with contextlib.suppress(OSError):  # there is nowhere else to say it
        print(line, file=sys.stderr, flush=True)


@contextlib.contextmanager
def _output() -> Iterator[None]:
    """While it lasts, standard output takes any character, and what it cannot take for want of room is an OutputError.

    Characters that its encoding lacks are written as escapes, by standard error too.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            with contextlib.suppress(OSError):
                stream.reconfigure(errors="backslashreplace")
    if sys.stdout is None:  # closed before Python began: it prints nothing then
        yield
        return
    checked = _Checked(sys.stdout)
    try:
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
    """Let the system swallow what a broken stream still holds, so that Python's end does not fail on it once more."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class _Checked:
    """A stream of text whose OSErrors are OutputErrors."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write as the stream itself. Raises OutputError."""
        written = self._asked(self._stream.write, text)
        return len(text) if written is None else int(written)  # streams of programs around us may tell nothing

    def flush(self) -> None:
        """Flush as the stream itself. Raises OutputError."""
        self._asked(self._stream.flush)

    def _asked(self, work: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return work(*arguments)
        except OSError as error:
            raise OutputError(f"standard output cannot be written: {error.strerror or error}") from error

# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of commands: lines that stay, and in a terminal one refreshed line with the time left."""

from __future__ import annotations

import os
import shutil
import sys
import time
from datetime import timedelta
from types import TracebackType

EARLY, SHORT = 0.01, 1.0
"""Share of the work and seconds before which no time left is stated: it would be a guess."""


class Progress:
    """The progress of a piece of work, within a `with` statement, whose end removes the refreshed line.

    name: of the command. quiet: seconds before the first line and between two lines where the output is no terminal.
    """

    def __init__(self, name: str, quiet: float = 0.0) -> None:
        self.name, self.quiet = name, quiet
        self._began = self._told = time.monotonic()
        self._width = 0

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def say(self, text: str) -> None:
        """Print a line that stays."""
        self.clear()
        print(f"[{self.name}] {text}", flush=True)

    def show(self, text: str, done: float | None = None) -> None:
        """Show the step at hand. done: share of the whole work, 0 to 1; None where it is unknown."""
        now = time.monotonic()
        if not in_terminal():
            if now - self._told >= self.quiet:
                self._told = now
                print(f"[{self.name}] {text}", flush=True)
            return
        rest = left(now - self._began, done)
        line, room = f"[{self.name}] {text}", max(shutil.get_terminal_size().columns - 1 - len(rest), 1)
        line = (line if len(line) <= room else line[: room - 1] + "…") + rest
        # Spaces remove the rest of a longer line, also in terminals without control sequences.
        print(f"\r{line.ljust(self._width)}", end="", flush=True)
        self._width = len(line)

    def clear(self) -> None:
        """Remove the refreshed line."""
        if self._width:
            print(f"\r{' ' * self._width}\r", end="", flush=True)
            self._width = 0


def in_terminal() -> bool:
    """Whether standard output is a terminal that can return to the beginning of a line."""
    return sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


def left(seconds: float, done: float | None) -> str:
    """The time that is left in words, after a comma, if work goes on as in these seconds; nothing while unknown."""
    if done is None or not EARLY <= done < 1.0 or seconds < SHORT:
        return ""
    return f", {timedelta(seconds=round(seconds * (1.0 - done) / done))} left"

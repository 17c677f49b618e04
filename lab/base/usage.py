# SPDX-License-Identifier: GPL-3.0-or-later
"""Command lines whose mistakes are told in one line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NoReturn


class UsageError(ValueError):
    """The command line or the input is wrong. The message is one line."""


class Parser(argparse.ArgumentParser):
    """A parser that raises UsageError instead of ending the process, which may be Blender."""

    def error(self, message: str) -> NoReturn:
        """Raise the UsageError."""
        raise UsageError(message)


def output(text: str) -> Path:
    """Where a command writes, as the type of an option. An empty name, which is `.` to a path, is a mistake."""
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a name, got {text!r}")
    return Path(text)

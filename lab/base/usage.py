# SPDX-License-Identifier: GPL-3.0-or-later
"""Command-line parsers that report each mistake in one line."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NoReturn


class UsageError(ValueError):
    """Wrong command line or input. The message is one line."""


class Parser(argparse.ArgumentParser):
    """An argument parser that raises UsageError instead of ending the process, which may be Blender."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with argparse's message."""
        raise UsageError(message)


def output(text: str) -> Path:
    """The `type` of an option that names an output file or folder. Rejects the empty name, which Path would read as
    `.`.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a name, got {text!r}")
    return Path(text)


def website(text: str) -> str:
    """The `type` of an option with the address of a page, which begins with http:// or https://."""
    if not re.fullmatch(r'https?://[^\s"\\]+', text):
        raise argparse.ArgumentTypeError(f"{text!r} is not the address of a page, http://... or https://...")
    return text

# SPDX-License-Identifier: GPL-3.0-or-later
"""Command-line parsers that report each mistake in one line."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any, NoReturn


class UsageError(ValueError):
    """Wrong command line or input. The message is one line."""


class Parser(argparse.ArgumentParser):
    """An argument parser that raises UsageError instead of ending the process, which may be Blender."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with argparse's message."""
        raise UsageError(message)

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        """Refuse empty values, which commands would take for options that are not given."""
        if action.type is None and not arg_string.strip():
            raise argparse.ArgumentError(action, f"expected a value, got {arg_string!r}")
        return super()._get_value(action, arg_string)


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

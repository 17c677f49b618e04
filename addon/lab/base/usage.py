# SPDX-License-Identifier: GPL-3.0-or-later
"""Command-line parsers that report each mistake in one line."""

from __future__ import annotations

import argparse
import importlib.util
import re
import sys
from pathlib import Path
from typing import Any, NoReturn

NO_BLENDER = "needs Blender: the module bpy is not installed; the extra `blender` installs it"
"""Message of a command that needs Blender, where there is none."""


class UsageError(ValueError):
    """Wrong command line or input. The message is one line."""


class Parser(argparse.ArgumentParser):
    """An argument parser that raises UsageError instead of ending the process, which may be Blender."""

    def __init__(self, *, prog: str, **options: Any) -> None:
        super().__init__(prog=typed(prog), **options)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with argparse's message."""
        raise UsageError(message)

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        """Refuse empty values, which commands would take for options that are not given."""
        if action.type is None and not arg_string.strip():
            raise argparse.ArgumentError(action, f"expected a value, got {arg_string!r}")
        return super()._get_value(action, arg_string)


def typed(name: str) -> str:
    """A command as it was called: `halfspace bench`, `scripts/halfspace.py bench`, `scripts/bench.py`, or its name."""
    for word in sys.orig_argv[1:]:
        path = Path(word)
        if path.suffix == ".py" and path.stem in ("halfspace", name):
            return word if path.stem == name else f"{word} {name}"
        if path.stem == "halfspace" and path.suffix in ("", ".exe"):
            return f"halfspace {name}"
    return name


def no_blender(error: ImportError) -> str:
    """Why a command that needs Blender stops: the module is missing, or cannot be imported."""
    return NO_BLENDER if importlib.util.find_spec("bpy") is None else f"needs Blender: {error}"


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

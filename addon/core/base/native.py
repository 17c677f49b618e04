# SPDX-License-Identifier: GPL-3.0-or-later
"""The only importer of the compiled module."""

from __future__ import annotations

import importlib
from functools import cache
from typing import cast

from .interface import Native

VERSION = "0.1.0"
"""The version of this package; the compiled module must have the same."""


class NativeError(RuntimeError):
    """The compiled module is missing, broken or of another version. The message is meant for the user."""


TRACEBACK = "Traceback (most recent call last):"


def first_line(error: BaseException) -> str:
    """What an exception says, in one line; its type where it says nothing."""
    return next(iter(_lines(error)), type(error).__name__)


def in_one_line(error: BaseException) -> str:
    """All that an exception says, without repetitions, in one line; its type where it says nothing."""
    return " ".join(dict.fromkeys(_lines(error))) or type(error).__name__


def _lines(error: BaseException) -> list[str]:
    """What an exception says: without the word with which Blender's operators begin, and of a traceback its end."""
    lines = str(error).splitlines()
    beginnings = [number for number, line in enumerate(lines) if line.endswith(TRACEBACK)]
    if beginnings:
        # Operators written in Python report all of it, and before it those of its causes; the calls are indented, and
        # after the error comes the place.
        lines = [after for after in lines[beginnings[-1] + 1 :] if after[:1].strip()][:1] or lines
    found = (" ".join(line.removeprefix("Error:").split()) for line in lines)
    return [line for line in found if line]


FAILURES = (ValueError, RuntimeError, MemoryError)
"""What a build or a trace may end with, and scenes, specs and the module itself: what is told in one line."""


@cache
def load() -> Native:
    """The module `halfspace_native`. Raises NativeError, in one line, when it cannot be used."""
    try:
        module = importlib.import_module("halfspace_native")
    except ImportError as error:
        raise NativeError(f"The native module of Halfspace cannot be loaded: {error}") from error
    found = getattr(module, "__version__", "unknown")
    if found != VERSION:
        raise NativeError(
            f"Halfspace {VERSION} found its native module in version {found}: restart Blender, "
            "or install the extension again"
        )
    return cast(Native, module)


def problem() -> str | None:
    """Why the compiled module cannot be used, or None when it can."""
    try:
        load()
    except NativeError as error:
        return str(error)
    return None

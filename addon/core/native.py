# SPDX-License-Identifier: GPL-3.0-or-later
"""The only importer of the compiled module."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

VERSION = "0.1.0"
"""The version of this package; the compiled module must have the same."""


class NativeError(RuntimeError):
    """The compiled module is missing, broken or of another version. The message is meant for the user."""


def first_line(error: BaseException) -> str:
    """What an exception says, in one line; its type where it says nothing."""
    # Blender's operators begin theirs with a word of their own.
    lines = [line.removeprefix("Error: ").strip() for line in str(error).splitlines() if line.strip()]
    return lines[0] if lines else type(error).__name__


FAILURES = (ValueError, RuntimeError, MemoryError)
"""What a build or a trace may end with, and scenes, specs and the module itself: what is told in one line."""


@cache
def load() -> Any:
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
    return module


def problem() -> str | None:
    """Why the compiled module cannot be used, or None when it can."""
    try:
        load()
    except NativeError as error:
        return str(error)
    return None

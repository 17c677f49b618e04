# SPDX-License-Identifier: GPL-3.0-or-later
"""The only importer of the compiled module."""

from __future__ import annotations

import importlib
from functools import cache
from typing import cast

from . import installation
from .interface import Native

VERSION = "0.1.0"
"""The version of this package; the compiled module must have the same."""


class NativeError(RuntimeError):
    """The compiled module is missing, broken or of another version. The message is meant for the user."""


TRACEBACK = "Traceback (most recent call last):"


def first_line(error: BaseException) -> str:
    """The first line of an exception's text, or its type if the text is empty."""
    return next(iter(_lines(error)), type(error).__name__)


def in_one_line(error: BaseException) -> str:
    """An exception's text without repetitions in one line, or its type if the text is empty."""
    return " ".join(dict.fromkeys(_lines(error))) or type(error).__name__


def _lines(error: BaseException) -> list[str]:
    """The lines of an exception's text without the prefix of Blender's operators; only the error itself if the text is
    a traceback.
    """
    lines = str(error).splitlines()
    beginnings = [number for number, line in enumerate(lines) if line.endswith(TRACEBACK)]
    if beginnings:
        # Python operators report the whole traceback, preceded by those of its causes: calls are indented, and the
        # place follows the error.
        lines = [after for after in lines[beginnings[-1] + 1 :] if after[:1].strip()][:1] or lines
    found = (" ".join(line.removeprefix("Error:").split()) for line in lines)
    return [line for line in found if line]


PANIC = "PanicException"
"""Name of the class of panics of the native module. PyO3 makes it, and no module has it as an attribute."""


def reason(error: BaseException) -> str:
    """The text of an error that ends a piece of work, in one line. Raises what ends the program: KeyboardInterrupt,
    SystemExit, GeneratorExit.

    For all others: a panic of the native module reaches Python as an exception that is no `Exception`.
    """
    if isinstance(error, KeyboardInterrupt | SystemExit | GeneratorExit):
        raise error
    text = " ".join(str(error).split()) or type(error).__name__
    return text if isinstance(error, Exception) else f"internal error: {text}"


FAILURES = (ValueError, RuntimeError, MemoryError)
"""Exceptions of the native module, of wrong configurations and of a missing module, all reported in one line."""


@cache
def load() -> Native:
    """The module `halfspace_native`, under its name here. Raises NativeError, in one line, if it cannot be used."""
    if (reason := installation.processor_problem()) is not None:
        raise NativeError(reason)
    # Blender may have unpacked it a moment ago, after Python had read the folder.
    importlib.invalidate_caches()
    try:
        module = importlib.import_module(installation.module_name())
    except ImportError as error:
        raise NativeError(installation.why_missing(error)) from error
    found = getattr(module, "__version__", "unknown")
    if found != VERSION:
        raise NativeError(
            f"Halfspace {VERSION} found its native module in version {found}: restart Blender, "
            "or install the extension or the Python package again"
        )
    return cast(Native, module)


def problem() -> str | None:
    """The reason why the compiled module cannot be used, or None."""
    try:
        load()
    except NativeError as error:
        return str(error)
    return None

# SPDX-License-Identifier: GPL-3.0-or-later
"""The instruction set of a command's measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.base import native
from .usage import UsageError

if TYPE_CHECKING:
    from argparse import ArgumentParser

    from ...core.base.interface import Native


def add_option(parser: ArgumentParser) -> None:
    """Add `--level`."""
    names = "instruction set: best (default), avx512, avx2, sse4.2 or neon"
    parser.add_argument("--level", default="best", help=names)


def load_module(level: str) -> Native:
    """The native module, using this instruction set. Raises UsageError."""
    module = native.load()
    try:
        module.use_level(level)
    except ValueError as error:
        raise UsageError(f"--{error}") from error
    return module

# SPDX-License-Identifier: GPL-3.0-or-later
"""The message of a command that fails, as a user reads it, with what it logs to standard error."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


@contextmanager
def logging_to_stderr() -> Iterator[None]:
    """As outside of pytest, whose own handlers would take whatever is logged, tracebacks with it, and hide it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logging.getLogger(), "handlers", [])
        yield


def told(command: Any, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on standard error of a command that ends with status 2."""
    with logging_to_stderr():
        assert command.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    return said

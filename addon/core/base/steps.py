# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in steps on the caller's thread, so that a window stays responsive while Blender's data is read."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Generic, TypeVar

T = TypeVar("T")

Steps = Generator[None, None, T]
"""Work that may pause wherever it yields. Returns its result."""


def completed(steps: Steps[T]) -> T:
    """The result of all steps, without a pause. Raises their exceptions."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]


class Stepwise(Generic[T]):
    """Steps that are advanced a slice at a time. ended: whether `result` is there."""

    result: T

    def __init__(self, steps: Steps[T]) -> None:
        self.ended = False
        self._steps = steps

    def advance(self, seconds: float) -> bool:
        """Work for about this time, at least one step. Returns whether all is done. Raises the exceptions of the
        steps.
        """
        end = time.perf_counter() + seconds
        while not self.ended:
            try:
                next(self._steps)
            except StopIteration as stop:
                self.result, self.ended = stop.value, True
            if time.perf_counter() >= end:
                break
        return self.ended

    def close(self) -> None:
        """Drop what is not done, with everything that it holds."""
        self._steps.close()

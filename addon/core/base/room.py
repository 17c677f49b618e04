# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory checks before Python and Blender allocate large arrays, by the same rule as in the native module."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .interface import Native

MB = 1_000_000

SMALL = 64 << 20
"""Bytes below which the free memory is not queried."""


def check(native: Native, what: str, needed: int) -> None:
    """Raise MemoryError, with `what` in its message, if `needed` bytes exceed the memory that a build may use now."""
    if needed <= SMALL:
        return
    free = native.free_memory()
    if needed > free:
        # Round needed up and free down, so that the message never shows two equal numbers.
        raise MemoryError(f"{what}: needs about {-(-needed // MB)} MB, of {free // MB} MB that are free")

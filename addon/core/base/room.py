# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what Python and Blender allocate fits into memory; asked before it is allocated, as by the native module."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .interface import Native

MB = 1_000_000

SMALL = 64 << 20
"""Less than this is not worth asking the system about."""


def check(native: Native, what: str, needed: int) -> None:
    """Raise MemoryError, which names what it is about, where so many bytes are more than a build might take now."""
    if needed <= SMALL:
        return
    free = native.free_memory()
    if needed > free:
        # Rounded apart, lest both are the same number.
        raise MemoryError(f"{what}: needs about {-(-needed // MB)} MB, of {free // MB} MB that are free")

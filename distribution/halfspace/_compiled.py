# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled module for those who import the package: what prevents its use is one ImportError."""

from __future__ import annotations

from .core.base import installation, native
from .core.base.interface import Native


def module() -> Native:
    """The module `halfspace_native`. Raises ImportError, whose text is one sentence, if it cannot be used here."""
    try:
        return native.load()
    except native.NativeError as error:
        raise ImportError(str(error), name=installation.MODULE) from None

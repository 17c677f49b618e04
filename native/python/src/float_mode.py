# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets the floating-point mode of the calling thread through the C library."""

from __future__ import annotations

import ctypes
import ctypes.util
import sys
from collections.abc import Callable
from functools import partial

MODE_BITS = 0x03000000 | 0x00000300
"""_MCW_DN | _MCW_RC of Microsoft's float.h: how subnormal numbers are treated, and rounding; all 0 by default."""


def setters() -> tuple[Callable[[], object], Callable[[], object]]:
    """Two functions that set the mode of the calling thread: the default one, and that of now.

    They are no Python code, so that Ctrl-C cannot interrupt them. Raises OSError or AttributeError where the C library
    has no such functions.
    """
    if sys.platform == "win32":
        control = ctypes.CDLL("ucrtbase")._controlfp_s  # noqa: SLF001 (its public name)
        former, read = ctypes.c_uint(), ctypes.c_uint()
        control(ctypes.byref(former), 0, 0)
        return partial(control, ctypes.byref(read), 0, MODE_BITS), partial(
            control, ctypes.byref(read), former, MODE_BITS
        )
    library = ctypes.CDLL(None)
    if not hasattr(library, "fesetenv"):
        library = ctypes.CDLL(ctypes.util.find_library("m"))
    # Larger than the fenv_t of any C library.
    now = ctypes.create_string_buffer(512)
    if sys.platform == "darwin":
        default: object = ctypes.byref(ctypes.c_char.in_dll(library, "_FE_DFL_ENV"))
    else:
        # FE_DFL_ENV of glibc and musl.
        default = ctypes.c_void_p(-1)
    library.fegetenv(now)
    return partial(library.fesetenv, default), partial(library.fesetenv, now)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures over triangles, traced exactly, and the core of the renderer: all names of the compiled module."""

from . import halfspace_native
from .halfspace_native import *  # noqa: F403 (the names in its __all__)

__all__ = halfspace_native.__all__

# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules that Blender brings along for its own libraries."""

from __future__ import annotations

import importlib
from typing import Any

import bpy

from .nodes import Unsupported


def bundled(name: str) -> Any:
    """The module of this name, which Blender's Python has since 4.4. Raises Unsupported."""
    try:
        return importlib.import_module(name)
    except ImportError:
        # With Blender as a module, the modules that it comes with are hidden at first.
        expose = getattr(bpy.utils, "expose_bundled_modules", None)
        if expose is not None:
            expose()
        try:
            return importlib.import_module(name)
        except ImportError as error:
            raise Unsupported(f"Blender's module {name} is missing") from error

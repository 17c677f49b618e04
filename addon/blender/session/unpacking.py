# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel that Blender was to unpack and did not.

Where files are locked, as those of a loaded module on Windows, Blender cannot replace them. It removes them at its next
start, and does not unpack the wheel then: it does so only if a manifest has changed.
"""

from __future__ import annotations

import importlib.util
import os

import addon_utils

from ...core.base import installation

MANIFEST = installation.WHEELS.parent / "blender_manifest.toml"


def ensure(package: str) -> None:
    """Let Blender unpack the wheel of the extension in `package` if its module is missing and a wheel fits."""
    if not installation.has_wheel() or _is_unpacked():
        return
    try:
        os.utime(MANIFEST)
    except OSError:
        return  # a folder that cannot be written: the panels give the reason
    addon_utils.extensions_refresh(addon_modules_pending=[package])


def _is_unpacked() -> bool:
    """Whether Python finds the module; what is left of a removed one is a folder without `__init__.py`."""
    importlib.invalidate_caches()
    found = importlib.util.find_spec(installation.module_name())
    return found is not None and found.origin is not None

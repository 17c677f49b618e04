# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered 3D view without a window."""

from __future__ import annotations

import time

import pytest

from addon.blender.render.viewport import Viewport

MOST_REDRAWS = 5000
"""Far more than reading a small scene takes."""


def settle(view: Viewport) -> None:
    """Do what redraws would do, until the scene is read and placed."""
    for _ in range(MOST_REDRAWS):
        if not view._incoming:
            return
        view._read()
        time.sleep(0.001)
    pytest.fail("the scene is never read")

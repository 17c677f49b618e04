# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: the depth sliders of the overlay, over a kd-tree. See `stage.py`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import stage
from window_areas import area_of, within

DEEPEST = 12
"""The last level that is shown."""

QUICK, SLOW = 260, 1400
"""Milliseconds of a frame, and of the first and the last one."""


def steps() -> Iterator[Any]:
    """Build a kd-tree and move both ends of the depth."""
    film = stage.Film("depth")
    yield from stage.furnish({"HALFSPACE_PT_view_overlay"}, {"HALFSPACE_PT_view_costs", "HALFSPACE_PT_view_statistics"})
    stage.look(*stage.VIEW)
    overlay = bpy.context.scene.halfspace.overlay
    overlay.auto_update, overlay.show = False, True
    with within(area_of("VIEW_3D")):
        bpy.ops.halfspace.build_structure()
    overlay.depth_auto = False
    yield 1.0
    for first, last in [(0, level) for level in range(DEEPEST + 1)] + [(level, DEEPEST) for level in range(1, 10)]:
        overlay.depth_min, overlay.depth_max = first, last
        yield from film.frame(SLOW if (first, last) in ((0, 0), (0, DEEPEST), (9, DEEPEST)) else QUICK)
    film.write()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: a ray is picked with the pointer, then followed step by step. See `stage.py`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import stage
from mathutils import Vector
from window_areas import area_of, within

(EYE, TARGET), SIDE = stage.VIEW, (0.8, -9.4, 4.6)
"""Where the ray is picked from and what is in the middle, and the place next to it from which its path is seen."""

PATH = ((0.10, 0.20), (0.18, 0.30), (0.25, 0.42), (0.31, 0.50))
"""Places of the pointer, as shares of the 3D view; the last one is clicked."""

FRAMES = 22
"""Largest number of steps that are shown."""

TURN = 6
"""Frames in which the view turns."""

QUICK, SLOW = 300, 1400
"""Milliseconds of a frame, and of one that is to be read."""


def steps() -> Iterator[Any]:
    """Pick a ray, turn the view next to it, and follow its steps."""
    film = stage.Film("ray")
    yield from stage.furnish({"HALFSPACE_PT_view_ray"}, {"HALFSPACE_PT_view_costs", "HALFSPACE_PT_view_statistics"})
    stage.look(EYE, TARGET)
    scene = bpy.context.scene
    overlay = scene.halfspace.overlay
    overlay.auto_update, overlay.parts, overlay.show = False, {"RAY"}, True
    stage.point(*PATH[0])
    with within(area_of("VIEW_3D")):
        bpy.ops.halfspace.build_structure()
        yield from film.frame(SLOW)
        bpy.ops.halfspace.pick_ray("INVOKE_DEFAULT")
    for place in PATH:
        stage.point(*place)
        yield from film.frame(QUICK)
    stage.click()
    yield from film.frame(SLOW)
    # Turn the view, so that the ray is seen from its side.
    for share in np.linspace(0, 1, TURN)[1:].tolist():
        stage.look(Vector(EYE).lerp(Vector(SIDE), share), TARGET)
        yield from film.frame(QUICK)
    settings = scene.halfspace.inspector
    settings.replaying, settings.step = True, 1
    yield from film.frame(SLOW)
    found = stage.part("blender.overlay.replaying").known(scene)
    for step in np.unique(np.linspace(1, len(found), min(len(found), FRAMES)).astype(int)).tolist():
        settings.step = step
        yield from film.frame(SLOW if step == len(found) else QUICK)
    film.write()

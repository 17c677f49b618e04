# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: *Compare* measures some structures, and *Use This One* takes the best. See `stage.py`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import bpy
import stage
from window_areas import area_of, within

COMPARED = ("kd", "bih", "bsp-wn-plus-kd")

SAMPLES = 4
"""Samples per pixel of the picture whose time is predicted."""

OPEN = {"HALFSPACE_PT_view_structure", "HALFSPACE_PT_view_compare"}
HIDDEN = {f"HALFSPACE_PT_view_{name}" for name in ("statistics", "overlay", "ray", "costs", "tree", "worst", "levels")}

MOST = 12
"""Largest number of frames while structures are measured."""

QUICK, SLOW, LAST = 350, 2200, 4000
"""Milliseconds of a frame, of one that is to be read, and of the last one."""


def steps() -> Iterator[Any]:
    """Compare structures and use the best one."""
    film = stage.Film("use-this-one")
    yield from stage.furnish(OPEN, HIDDEN)
    stage.look(*stage.VIEW)
    scene, comparing = bpy.context.scene, stage.part("blender.measure.comparing")
    group = scene.halfspace
    tick = stage.part("blender.settings.properties").tick
    for row in stage.part("core.structures.catalogue").load().structures:
        setattr(group.compared, tick(row.id), row.id in COMPARED)
    group.samples = SAMPLES
    overlay = group.overlay
    overlay.parts, overlay.depth_auto, overlay.auto_update, overlay.show = {"PLANES"}, True, True, True
    overlay.style = "OUTLINE"
    yield from stage.built()
    yield from film.frame(SLOW)
    with within(area_of("VIEW_3D")):
        bpy.ops.halfspace.compare("INVOKE_DEFAULT")
    start, told = time.perf_counter(), ""
    while (now := comparing.progress()) is not None and time.perf_counter() < start + stage.LONGEST:
        if now[1] != told and len(film.frames) < MOST:
            told = now[1]
            yield from film.frame(QUICK)
        yield 0.1
    found = comparing.last(scene).comparison
    yield from film.frame(SLOW)
    with within(area_of("VIEW_3D")):
        bpy.ops.halfspace.use_spec(spec=found.best.spec)
    yield from film.frame(SLOW)
    yield from stage.built()
    yield from film.frame(LAST)
    film.write()

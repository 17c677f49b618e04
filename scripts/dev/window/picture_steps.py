# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: a final render from its first picture on, the rendered viewport, and two cost maps.

Runs inside Blender, with the extension installed; see `panel_steps.py`. The times of the pictures shown, in seconds
after the build, and the numbers of windows are written as JSON to picture_steps.json.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from window_areas import EXTENSION, area_of, within

OUT = Path(os.environ.get("WINDOW_OUT", "/job/out"))

LONGEST = 300
"""Seconds after which a render counts as hanging."""

found: dict[str, Any] = {}


def watch_result() -> None:
    """Record when the structure was built and when each picture was given to Blender, with its share of pixels."""
    trees: Any
    result: Any
    trees, result = (sys.modules[f"{EXTENSION}.blender.{name}"] for name in ("session.trees", "render.result"))
    keep, fill = trees.keep, result.Result.fill
    found["shown"] = []

    def kept(*arguments: Any, **options: Any) -> Any:
        found["built"] = time.perf_counter()
        return keep(*arguments, **options)

    def filled(self: Any, buffers: Any, view: int) -> Any:
        whole = np.reshape(buffers["Combined"], (-1, 4))
        done = fill(self, buffers, view)
        seconds = time.perf_counter() - found["built"]
        found["shown"].append((round(seconds, 3), round(float((whole[:, 3] > 0).mean()), 4)))
        return done

    trees.keep = kept
    result.Result.fill = filled


def final_render() -> Iterator[Any]:
    """Start a render as F12 does, and take pictures of it."""
    scene = bpy.context.scene
    scene.halfspace.samples = 256
    bpy.context.preferences.view.render_display_type = "AREA"
    watch_result()
    with within(area_of("VIEW_3D")):
        bpy.ops.render.render("INVOKE_DEFAULT")
    start = time.perf_counter()
    while "built" not in found and time.perf_counter() < start + LONGEST:
        yield 0.05
    yield 0.4
    yield "f12-first"
    yield 1.0
    yield "f12-later"
    while bpy.app.is_job_running("RENDER") and time.perf_counter() < start + LONGEST:
        yield 0.2
    yield 0.5
    found["finished"] = not bpy.app.is_job_running("RENDER")
    yield "f12-done"


def viewport() -> Iterator[Any]:
    """Show the rendered viewport through the camera."""
    area = max(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)
    area.type = "VIEW_3D"
    area.spaces.active.region_3d.view_perspective = "CAMERA"
    area.spaces.active.shading.type = "RENDERED"
    yield 0.5
    yield "viewport-first"
    yield 5.0
    yield "viewport-later"
    area.spaces.active.shading.type = "SOLID"


def cost_maps() -> Iterator[Any]:
    """Make two cost maps without an Image Editor: the second is shown in the window of the first."""
    area = area_of("VIEW_3D")
    for number, quantity in enumerate(("STEPS", "TESTS")):
        bpy.context.scene.halfspace.cost = quantity
        with within(area):
            found[f"map {number}"] = list(bpy.ops.halfspace.cost_map())
        yield 1.5
        found[f"windows {number}"] = len(bpy.context.window_manager.windows)
        yield f"map-{number}"


def steps() -> Iterator[Any]:
    """Make all pictures."""
    scene = bpy.context.scene
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    for part in (final_render, viewport, cost_maps):
        yield from part()
    (OUT / "picture_steps.json").write_text(json.dumps(found), encoding="utf-8")

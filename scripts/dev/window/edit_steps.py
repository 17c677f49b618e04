# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in a real window: the cost of the first picture of a view, and of the next one after an object has moved.

Opens each .blend file next to this one in both engines, shows it rendered with one sample, and moves the objects whose
names are in the scene's property `moved`. `scripts/dev/edits.py` makes the files and prints what `edits.json` holds.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import gpu
import numpy as np
from window_areas import area_of

OUT = Path(os.environ.get("WINDOW_OUT", "/job/out"))

CALLS = {"HALFSPACE": ("Viewport", ("update", "draw", "tick")), "CYCLES": ("engine", ("reset", "sync", "view_draw"))}
"""Engines, and what Blender's calls and timers of each lead to: an object of the engine's module, and its functions."""

TICK = 0.005
"""Seconds between two looks at the clock of the main thread."""

QUIET, SHARE = 2.0, 0.08
"""Seconds after which a view is ready if the process took less than this share of them."""

LONGEST = 150.0
"""Seconds after which a view counts as never ready."""

SIDE, BLOCK = 256, 16
"""Pixels of the square that is compared, and of its blocks."""


class Watch:
    """The main thread's pauses, and what the 3D view showed at each of its redraws.

    pause: the longest time in which the main thread did not return to Blender's loop, in seconds. call: the longest
    call of the engine, to update a view, to draw it, or of its timer; the rest of a pause is Blender's own. shown:
    seconds, processor seconds and the means of blocks of pixels around the middle of the view.
    """

    def __init__(self) -> None:
        self.pause, self.call, self._last = 0.0, 0.0, time.perf_counter()
        self.shown: list[tuple[float, float, Any]] = []
        bpy.app.timers.register(self._tick, persistent=True)
        bpy.types.SpaceView3D.draw_handler_add(self._drawn, (), "WINDOW", "POST_PIXEL")

    def begin(self) -> None:
        """Forget all but what the view shows now."""
        self.pause, self.call, self._last, self.shown = 0.0, 0.0, time.perf_counter(), self.shown[-1:]

    def follow(self, engine: str) -> None:
        """Time the calls of an engine from here on."""
        owner = next(one for one in bpy.types.RenderEngine.__subclasses__() if getattr(one, "bl_idname", "") == engine)
        name, calls = CALLS[engine]
        for call in calls:
            self._time(getattr(sys.modules[owner.__module__], name), call)

    def _time(self, owner: Any, name: str) -> None:
        called = getattr(owner, name)
        if hasattr(called, "timed"):
            return

        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.perf_counter()
            try:
                return called(*arguments, **named)
            finally:
                self.call = max(self.call, time.perf_counter() - start)

        timed.timed = True  # type: ignore[attr-defined]
        setattr(owner, name, timed)

    def picture(self) -> tuple[float, float]:
        """Seconds and processor seconds of the first redraw that is closer to the last one than to the first one."""
        away = [float(np.abs(blocks - self.shown[-1][2]).mean()) for _, _, blocks in self.shown]
        if len(away) < 2 or away[0] == 0.0:
            raise RuntimeError("the view showed nothing new")
        first = next(one for one, far in zip(self.shown, away, strict=True) if far <= away[0] / 2)
        return first[:2]

    def _tick(self) -> float:
        now = time.perf_counter()
        self.pause, self._last = max(self.pause, now - self._last), now
        return TICK

    def _drawn(self) -> None:
        region = bpy.context.region
        corner = region.width // 2 - SIDE // 2, region.height // 2 - SIDE // 2
        now = time.perf_counter(), time.process_time()
        read = gpu.state.active_framebuffer_get().read_color(*corner, SIDE, SIDE, 4, 0, "UBYTE")
        pixels = np.frombuffer(read, np.uint8).reshape(SIDE // BLOCK, BLOCK, SIDE // BLOCK, BLOCK, 4)
        self.shown.append((*now, pixels.mean((1, 3))))


def ready(watch: Watch, act: Callable[[], None]) -> Generator[Any, None, dict[str, float]]:
    """Act, and wait until the process rests.

    Returns seconds and processor seconds to the first picture, processor seconds in all, the longest pause and call.
    """
    watch.begin()
    start, begun = time.perf_counter(), time.process_time()
    act()
    marks = [(start, begun)]
    while True:
        yield 0.1
        marks.append((time.perf_counter(), time.process_time()))
        # Compare with the last mark that is old enough; a process that rests waits for events only.
        old = [mark for mark in marks if marks[-1][0] - mark[0] >= QUIET]
        if old and marks[-1][1] - old[-1][1] < SHARE * QUIET:
            seconds, processor = watch.picture()
            return {
                "seconds": seconds - start,
                "processor": processor - begun,
                "all": old[-1][1] - begun,
                "pause": watch.pause,
                "call": watch.call,
            }
        if marks[-1][0] - start > LONGEST:
            raise RuntimeError("the view was not ready in time")


def steps() -> Iterator[Any]:
    """Show each file in each engine, then move its objects twice: what a first edit makes is there for the second."""
    watch, found = Watch(), []
    for path in sorted(Path(__file__).parent.glob("*.blend")):
        for engine in CALLS:
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
            yield 1.0
            scene = bpy.context.scene
            scene.render.engine, scene.halfspace.preview_samples = engine, 1
            watch.follow(engine)
            shading = area_of("VIEW_3D").spaces.active
            shading.region_3d.view_perspective = "CAMERA"
            first = yield from ready(watch, partial(setattr, shading.shading, "type", "RENDERED"))
            yield f"{path.stem}-{engine.lower()}"
            found.append({"scene": path.stem, "engine": engine, "what": "first picture", **first})
            for number in (1, 2):
                after = yield from ready(watch, partial(_move, scene))
                found.append({"scene": path.stem, "engine": engine, "what": f"edit {number}", **after})
            shading.shading.type = "SOLID"
            yield 1.0
    (OUT / "edits.json").write_text(json.dumps(found), encoding="utf-8")


def _move(scene: Any) -> None:
    for name in scene["moved"]:
        scene.objects[name].location.x += 0.5

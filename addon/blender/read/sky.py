# SPDX-License-Identifier: GPL-3.0-or-later
"""Sky Textures as pixels: another Blender process renders each once with Cycles, and the result is cached by settings.

The sun's disc is separate from the sky, uniformly bright with its exact power: a light if the sky is the world's
colour, else a part of the world's program. Thus a picture of moderate resolution does not blur it.
"""

from __future__ import annotations

import atexit
import json
import math
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...core.base.arrays import F32
from ...core.scene.scene import RGB, Light
from ...core.session.session import Cancelled
from .nodes import scaled

TIMEOUT = 300
"""Time limit of the other Blender process, in seconds."""

MOST = 8
"""Largest number of cached skies; otherwise an animated sun would fill the memory."""

POLL = 0.2
"""Interval between checks for a finished sky, in seconds."""

STOP_SECONDS = 5.0
"""Time that `stop` waits for threads whose process it has ended, in seconds."""


class SkyError(Exception):
    """The sky cannot be rendered, or is not ready. The message gives the reason to the user."""


@dataclass(frozen=True, eq=False)
class Sky:
    """A rendered Sky Texture.

    pixels: (h, w, 4) float32 radiance of all directions without the sun, rows from the bottom. sun: radiance of its
    disc, None without one. direction: towards it. angle: its diameter in radians.
    """

    pixels: F32
    sun: RGB | None
    direction: tuple[float, float, float]
    angle: float

    def light(self, strength: float) -> Light:
        """The sun as a light, which is visible to the camera."""
        assert self.sun is not None
        turned = Vector(self.direction).to_track_quat("Z", "Y").to_matrix().to_4x4()
        to_world = np.array([list(row) for row in turned], np.float64)
        power = scaled(self.sun, strength * math.pi * math.sin(self.angle / 2) ** 2)
        return Light("sun", to_world, power, angle=self.angle, hidden_from=(), name="Sky Texture")


class _Bake(threading.Thread):
    """Thread that renders the sky of these settings and caches it, or its error."""

    def __init__(self, key: str) -> None:
        super().__init__(name="halfspace sky", daemon=True)
        self.key = key
        self.process: subprocess.Popen[bytes] | None = None
        self.cancelled = False
        self.found: Sky | SkyError = SkyError("not rendered: stopped")

    def run(self) -> None:
        self.found = _keep(self)

    def cancel(self) -> None:
        """End the other Blender process, and wait until its folder is removed."""
        with _starting:
            self.cancelled = True
            if self.process is not None:
                self.process.kill()
        self.join(STOP_SECONDS)
        if _running.get(self.key) is self and self.key not in _looks:
            del _running[self.key]


_kept: dict[str, Sky | SkyError] = {}
"""The cached skies and errors, by settings."""

_running: dict[str, _Bake] = {}
"""The threads that render, by settings."""
_looks: dict[str, Callable[[], float | None]] = {}
"""The timers that check for a finished sky, by settings."""

_processes: set[subprocess.Popen[bytes]] = set()
"""The running Blender processes."""

_stopping = threading.Event()
_starting = threading.Lock()
"""Held while a process starts, so that none starts while all are being ended."""


def of_node(node: Any, *, wait: bool, keep_going: Callable[[], bool] | None = None) -> Sky:
    """The sky of a node. Without `wait` it is rendered in the background, and worlds are updated when it is ready.

    keep_going: polled while waiting; returns False to stop. Raises SkyError, and Cancelled if it was stopped.
    """
    key = json.dumps(_settings(node), sort_keys=True)
    found = _kept.get(key)
    if found is None:
        if not wait:
            _begin(key)
            raise SkyError("being prepared")
        found = _wait(key, keep_going)
    if isinstance(found, SkyError):
        if wait:
            _kept.pop(key, None)  # the next render tries again
        raise found
    return found


def _wait(key: str, keep_going: Callable[[], bool] | None) -> Sky | SkyError:
    """Wait for the sky of these settings, or its error; the thread has its own time limit. Raises Cancelled."""
    bake = _running.get(key)
    if bake is None or not bake.is_alive():
        _end_at_exit()
        bake = _running[key] = _Bake(key)
        bake.start()
    try:
        while bake.is_alive():
            bake.join(POLL)
            if keep_going is not None and not keep_going():
                raise Cancelled
    except BaseException:  # also KeyboardInterrupt
        bake.cancel()
        raise
    if _running.get(key) is bake and key not in _looks:
        del _running[key]
    return bake.found


def _settings(node: Any) -> dict[str, Any]:
    """The settings of a Sky Texture, by their names in this version of Blender."""
    common = set(bpy.types.ShaderNode.bl_rna.properties.keys())
    found = {}
    for item in node.bl_rna.properties:
        if item.identifier in common or item.is_readonly or item.type not in ("FLOAT", "INT", "BOOLEAN", "ENUM"):
            continue
        value = getattr(node, item.identifier)
        found[item.identifier] = list(value) if getattr(item, "is_array", False) else value
    return found


def _keep(bake: _Bake) -> Sky | SkyError:
    """Render a sky and cache it, or its error unless it was cancelled; never raises."""
    found: Sky | SkyError
    try:
        found = _render(bake)
    except subprocess.TimeoutExpired:
        found = SkyError(f"took more than {TIMEOUT} s")
    except (OSError, subprocess.SubprocessError, ValueError, KeyError) as error:
        found = SkyError(f"not rendered: {error}")
    if bake.cancelled and isinstance(found, SkyError):
        return found
    while len(_kept) >= MOST:
        _kept.pop(next(iter(_kept)))
    _kept[bake.key] = found
    return found


def _render(bake: _Bake) -> Sky:
    with tempfile.TemporaryDirectory(prefix="halfspace-sky-") as folder:
        (Path(folder) / "node.json").write_text(bake.key)
        _run(_command(folder), bake)
        with np.load(Path(folder) / "sky.npz") as found:
            rgb, sun = found["sky"], found["sun"]
            direction, angle = found["direction"], float(found["angle"])
    # Convert the files' arrays; the disc's irradiance becomes radiance.
    pixels = np.ones((*rgb.shape[:2], 4), np.float32)
    pixels[..., :3] = rgb
    x, y, z = (float(c) for c in direction)
    radiance = None
    if sun.max() > 0:
        r, g, b = (float(c) for c in sun / (np.pi * np.sin(angle / 2) ** 2))
        radiance = (r, g, b)
    return Sky(pixels, radiance, (x, y, z), angle)


def _command(folder: str) -> list[str]:
    """The command line of the other Blender process."""
    script = str(Path(__file__).with_name("sky_bake.py"))
    blender = bpy.app.binary_path
    if not blender:
        return [sys.executable, script, folder]
    quiet = ["--background", "--factory-startup", "--python-exit-code", "1"]
    return [blender, *quiet, "--python", script, "--", folder]


def _run(command: list[str], bake: _Bake | None = None) -> None:
    """Run a program to its end, unless its bake is cancelled. Raises OSError and subprocess.SubprocessError."""
    with _starting:
        if _stopping.is_set() or (bake is not None and bake.cancelled):
            raise subprocess.SubprocessError("stopped")
        _end_at_exit()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _processes.add(process)
        if bake is not None:
            bake.process = process
    try:
        status = process.wait(TIMEOUT)
    finally:
        process.kill()
        process.wait()
        _processes.discard(process)
    if status:
        raise subprocess.CalledProcessError(status, command)


def _end() -> None:
    """End the other Blender processes; each thread removes its folder."""
    _stopping.set()
    with _starting:
        for process in tuple(_processes):
            process.kill()
    for bake in tuple(_running.values()):
        bake.join(STOP_SECONDS)


def _end_at_exit() -> None:
    """Call `_end` when Python ends.

    With Blender as a module, Python ends without disabling extensions, which would leave processes and folders behind.
    """
    atexit.unregister(_end)
    atexit.register(_end)


def stop() -> None:
    """End the other Blender processes and the timers, and forget all skies."""
    atexit.unregister(_end)
    _end()
    for look in _looks.values():
        if bpy.app.timers.is_registered(look):
            bpy.app.timers.unregister(look)
    _running.clear()
    _looks.clear()
    _kept.clear()
    _stopping.clear()


def _begin(key: str) -> None:
    """Render a sky in the background; worlds are updated when it is ready."""
    if key in _looks:
        return
    bake = _running.get(key)
    if bake is None or not bake.is_alive():
        _end_at_exit()
        bake = _running[key] = _Bake(key)
        bake.start()

    def look() -> float | None:
        if bake.is_alive():
            return POLL
        if _running.get(key) is bake:
            del _running[key]
        _looks.pop(key, None)
        for world in bpy.data.worlds:
            world.update_tag()
        return None

    _looks[key] = look
    bpy.app.timers.register(look, first_interval=POLL, persistent=True)

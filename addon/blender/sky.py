# SPDX-License-Identifier: GPL-3.0-or-later
"""Sky Textures as numbers: another Blender renders them once with Cycles, and what comes back is kept by content.

The sun's disc is apart from the sky, evenly bright with the power that it has there: a light where the sky is the
world's colour, else a part of the world's program. So a picture of moderate size does not blur it.
"""

from __future__ import annotations

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

from ..core.scene import F32, RGB, Light
from .nodes import scaled

TIMEOUT = 300
"""Seconds that the other Blender may take."""

MOST = 8
"""Skies that are kept; an animated sun would fill the memory otherwise."""

POLL = 0.2
"""Seconds between looks at whether a sky has come."""

STOP_SECONDS = 5.0
"""How long `stop` waits for those whose program it has ended."""


class SkyError(Exception):
    """The sky cannot be had, or not yet. The message says why, for the user."""


@dataclass(frozen=True, eq=False)
class Sky:
    """What a Sky Texture shows.

    pixels: (h, w, 4) float32 radiance of all directions without the sun, rows from the bottom. sun: radiance of its
    disc, None where there is none. direction: towards it. angle: its diameter in radians.
    """

    pixels: F32
    sun: RGB | None
    direction: tuple[float, float, float]
    angle: float

    def light(self, strength: float) -> Light:
        """The sun as a light, which the camera sees as well."""
        assert self.sun is not None
        turned = Vector(self.direction).to_track_quat("Z", "Y").to_matrix().to_4x4()
        to_world = np.array([list(row) for row in turned], np.float64)
        power = scaled(self.sun, strength * math.pi * math.sin(self.angle / 2) ** 2)
        return Light("sun", to_world, power, angle=self.angle, hidden_from=())


_kept: dict[str, Sky | SkyError] = {}
_running: dict[str, threading.Thread] = {}
_looks: dict[str, Callable[[], float | None]] = {}
"""The timers that look whether a sky has come."""

_processes: set[subprocess.Popen[bytes]] = set()
"""The other Blenders that run."""

_stopping = threading.Event()
_starting = threading.Lock()
"""Held while a program starts, so that none starts unseen while all are ended."""


def of_node(node: Any, *, wait: bool) -> Sky:
    """What the node shows. Without `wait` it is prepared in the background, and depsgraphs are told when it is there.

    Raises SkyError.
    """
    key = json.dumps(_settings(node), sort_keys=True)
    found = _kept.get(key)
    if found is None:
        if not wait:
            _begin(key)
            raise SkyError("being prepared")
        if (thread := _running.get(key)) is not None:
            thread.join(TIMEOUT)
        found = _kept.get(key) or _keep(key)
    if isinstance(found, SkyError):
        if wait:
            _kept.pop(key, None)  # the next render tries again
        raise found
    return found


def _settings(node: Any) -> dict[str, Any]:
    """The numbers and choices of a Sky Texture, by the names that this Blender has for them."""
    common = set(bpy.types.ShaderNode.bl_rna.properties.keys())
    found = {}
    for item in node.bl_rna.properties:
        if item.identifier in common or item.is_readonly or item.type not in ("FLOAT", "INT", "BOOLEAN", "ENUM"):
            continue
        value = getattr(node, item.identifier)
        found[item.identifier] = list(value) if getattr(item, "is_array", False) else value
    return found


def _keep(key: str) -> Sky | SkyError:
    """Render the sky of these settings and keep it, or why it failed; never raises."""
    found: Sky | SkyError
    try:
        found = _render(key)
    except subprocess.TimeoutExpired:
        found = SkyError(f"took more than {TIMEOUT} s")
    except (OSError, subprocess.SubprocessError, ValueError, KeyError) as error:
        found = SkyError(f"not rendered: {error}")
    while len(_kept) >= MOST:
        _kept.pop(next(iter(_kept)))
    _kept[key] = found
    return found


def _render(key: str) -> Sky:
    with tempfile.TemporaryDirectory(prefix="halfspace-sky-") as folder:
        (Path(folder) / "node.json").write_text(key)
        _run(_command(folder))
        with np.load(Path(folder) / "sky.npz") as found:
            rgb, sun = found["sky"], found["sun"]
            direction, angle = found["direction"], float(found["angle"])
    pixels = np.ones((*rgb.shape[:2], 4), np.float32)
    pixels[..., :3] = rgb
    x, y, z = (float(c) for c in direction)
    radiance = None
    if sun.max() > 0:
        r, g, b = (float(c) for c in sun / (np.pi * np.sin(angle / 2) ** 2))
        radiance = (r, g, b)
    return Sky(pixels, radiance, (x, y, z), angle)


def _command(folder: str) -> list[str]:
    """What another Blender is started with."""
    script = str(Path(__file__).with_name("sky_bake.py"))
    blender = bpy.app.binary_path
    if not blender:
        return [sys.executable, script, folder]
    quiet = ["--background", "--factory-startup", "--python-exit-code", "1"]
    return [blender, *quiet, "--python", script, "--", folder]


def _run(command: list[str]) -> None:
    """Run a program to its end. Raises OSError and subprocess.SubprocessError."""
    with _starting:
        if _stopping.is_set():
            raise subprocess.SubprocessError("stopped")
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _processes.add(process)
    try:
        status = process.wait(TIMEOUT)
    finally:
        process.kill()
        process.wait()
        _processes.discard(process)
    if status:
        raise subprocess.CalledProcessError(status, command)


def stop() -> None:
    """End the other Blenders and the timers, and forget all skies."""
    _stopping.set()
    with _starting:
        for process in tuple(_processes):
            process.kill()
    for thread in tuple(_running.values()):
        thread.join(STOP_SECONDS)
    for look in _looks.values():
        if bpy.app.timers.is_registered(look):
            bpy.app.timers.unregister(look)
    _running.clear()
    _looks.clear()
    _kept.clear()
    _stopping.clear()


def _begin(key: str) -> None:
    """Prepare a sky in the background; when it is there, worlds are read again."""
    if key in _running:
        return
    thread = threading.Thread(target=_keep, args=(key,), name="halfspace sky", daemon=True)
    _running[key] = thread
    thread.start()

    def look() -> float | None:
        if thread.is_alive():
            return POLL
        _running.pop(key, None)
        _looks.pop(key, None)
        for world in bpy.data.worlds:
            world.update_tag()
        return None

    _looks[key] = look
    bpy.app.timers.register(look, first_interval=POLL, persistent=True)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The times at which a moving scene is read."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

POSES = 5
"""Poses of a moving camera, ends included: a turn by 90 degrees differs from a steady one by less than 0.001."""

OPENS = {"START": 0.0, "CENTER": -0.5, "END": -1.0}
"""When the shutter opens, relative to the frame, in lengths of its opening."""


def interval(scene: Any) -> tuple[float, float] | None:
    """The frames at which the shutter opens and closes, not stretched in time; None if the picture shows one moment."""
    render = scene.render
    if not render.use_motion_blur:
        return None
    length = float(render.motion_blur_shutter)
    if not (length > 0 and math.isfinite(length)):
        return None
    start = scene.frame_float + OPENS[render.motion_blur_position] * length
    return start, start + length


def moments(span: tuple[float, float], count: int) -> list[float]:
    """`count` frames from the first to the last of `span`."""
    start, end = span
    return [start + (end - start) * i / (count - 1) for i in range(count)]


def middles(span: tuple[float, float], count: int) -> list[float]:
    """The middles of `count` equal parts of `span`."""
    start, end = span
    return [start + (end - start) * (i + 0.5) / count for i in range(count)]


def at(engine: Any, frame: float, read: Callable[[], Any]) -> Any:
    """The result of `read` while the render's scene is that of a frame, which need not be whole."""
    whole = math.floor(frame)
    engine.frame_set(whole, subframe=frame - whole)
    return read()

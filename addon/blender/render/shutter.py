# SPDX-License-Identifier: GPL-3.0-or-later
"""The times at which a moving scene is read."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.base.arrays import F64

POSES = 5
"""Poses of a moving camera, ends included: a turn by 90 degrees differs from a steady one by less than 0.001."""

UNEVEN_POSES = 33
"""The same with a shutter whose curve is not flat: the time between two poses is even."""

CURVE_POINTS = 257
"""Number of points at which the curve of the shutter is read: one more than in Cycles."""

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


def curve(scene: Any) -> F64 | None:
    """The times, 0 to 1, at which equal shares of the light have passed the shutter, (n,); None if they are even."""
    mapping = scene.render.motion_blur_shutter_curve
    mapping.initialize()
    times = np.linspace(0.0, 1.0, CURVE_POINTS)
    open_by = np.maximum([mapping.evaluate(mapping.curves[0], float(time)) for time in times], 0.0)
    if np.ptp(open_by) < 1e-6 or not open_by.any():
        return None
    # Invert the integral of the curve.
    passed = np.concatenate([[0.0], np.cumsum(open_by[1:] + open_by[:-1])])
    return np.interp(times, passed / passed[-1], times)


def rolling(scene: Any) -> float | None:
    """The share of the opening for which a row is exposed, one after the other; None if all are exposed together."""
    cycles = getattr(scene, "cycles", None)  # missing while that extension is disabled
    if getattr(cycles, "rolling_shutter_type", "NONE") != "TOP":
        return None
    return min(max(float(cycles.rolling_shutter_duration), 0.0), 1.0)


def moments(span: tuple[float, float], count: int, uneven: F64 | None = None) -> list[float]:
    """`count` frames from the first to the last of `span`. uneven: as from `curve`."""
    return _spread(span, [i / (count - 1) for i in range(count)], uneven)


def middles(span: tuple[float, float], count: int, uneven: F64 | None = None) -> list[float]:
    """The middles of `count` equal parts of `span`, or of the light within it. uneven: as from `curve`."""
    return _spread(span, [(i + 0.5) / count for i in range(count)], uneven)


def _spread(span: tuple[float, float], shares: list[float], uneven: F64 | None) -> list[float]:
    """The frames at these shares of the time, or of the light, within `span`."""
    start, end = span
    if uneven is not None:
        shares = np.interp(shares, np.linspace(0.0, 1.0, len(uneven)), uneven).tolist()
    return [start + (end - start) * share for share in shares]


def at(engine: Any, frame: float, read: Callable[[], Any]) -> Any:
    """The result of `read` while the render's scene is that of a frame, which need not be whole."""
    whole = math.floor(frame)
    engine.frame_set(whole, subframe=frame - whole)
    return read()

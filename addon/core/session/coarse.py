# SPDX-License-Identifier: GPL-3.0-or-later
"""Coarse first pictures of a final render: one sample in large pixels, spread over the whole picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .session import RenderError

if TYPE_CHECKING:
    from ..base.arrays import F32
    from ..scene.scene import Camera
    from ..structures.settings import RenderSettings
    from .session import Session

FIRST_PIXELS = 4_000
"""Largest number of large pixels in the first picture."""

SECONDS = 0.25
"""Longest expected time of the second picture."""

FINEST = 4
"""Smallest side of large pixels: the second picture takes at most a sixteenth of the time of one sample."""

POLL_MILLISECONDS = 10


def pictures(
    session: Session, camera: Camera, settings: RenderSettings, keep_going: Callable[[], bool]
) -> Iterator[F32]:
    """At most two coarse pictures of the part that `settings` render, the second finer: flat float32 RGBA.

    A picture that is small enough to appear at once has none. Ends early if `keep_going`, which is polled, returns
    False. Raises RenderError.
    """
    width, height = settings.size
    side = 1
    while width * height > FIRST_PIXELS * side * side:
        side *= 2
    if side < FINEST:
        return
    seconds = 0.0
    while True:
        # Render one sample of each large pixel.
        coarse = enlarged(settings, side)
        job = session.render(camera, coarse)
        while not job.wait(POLL_MILLISECONDS):
            if not keep_going():
                job.cancel()
                return
        if job.error is not None:
            raise RenderError(job.error)
        across, up = coarse.size
        pixels = np.empty(across * up * 4, np.float32)
        job.copy_into("Combined", pixels)
        yield spread(pixels.reshape(up, across, 4), coarse, settings).reshape(-1)
        # Halve the pixels of the second picture while it is expected in time.
        if seconds > 0.0:
            return
        seconds, first = max(job.statistics["seconds"], 1e-6), side
        while side > FINEST and seconds * (2 * first / side) ** 2 < SECONDS:
            side //= 2
        if side == first:
            return


def enlarged(settings: RenderSettings, side: int) -> RenderSettings:
    """Settings of the same part of the frame in pixels of `side` × `side`, one sample each."""
    width, height = max(settings.width // side, 1), max(settings.height // side, 1)
    border = None
    if settings.border is not None:
        # Include every large pixel that the border touches.
        x0, y0, x1, y1 = settings.border
        x0, x1 = x0 * width // settings.width, -(-x1 * width // settings.width)
        y0, y1 = y0 * height // settings.height, -(-y1 * height // settings.height)
        border = x0, y0, x1, y1
    return replace(
        settings, width=width, height=height, border=border, samples=1, passes=("Combined",), noise_threshold=0.0
    )


def spread(pixels: F32, coarse: RenderSettings, settings: RenderSettings) -> F32:
    """The (h, w, 4) picture of `settings` whose pixels have the value of the large pixel at their centre."""
    x0, y0, x1, y1 = settings.border or (0, 0, settings.width, settings.height)
    left, low = coarse.border[:2] if coarse.border is not None else (0, 0)
    columns = (2 * np.arange(x0, x1) + 1) * coarse.width // (2 * settings.width) - left
    rows = (2 * np.arange(y0, y1) + 1) * coarse.height // (2 * settings.height) - low
    return pixels[rows[:, None], columns]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Text in pictures with Blender's own font, without a window or a graphics card."""

from __future__ import annotations

import tempfile
from pathlib import Path

import blf
import imbuf
import numpy as np

from ...core.base.arrays import F32
from . import pictures

FONT = 0
"""Blender's number of its default font."""


def width(text: str, size: float) -> int:
    """Width of a line of text in pixels."""
    blf.size(FONT, size)
    return int(np.ceil(blf.dimensions(FONT, text)[0]))


def write(
    picture: F32,
    lines: list[tuple[str, float, float]],
    size: float,
    rgb: tuple[float, float, float] = (0.92, 0.93, 0.95),
) -> None:
    """Write lines (text, x, y of the baseline's left end, from the bottom) into (h, w, 3) display values, in place."""
    if not lines:
        return
    # Draw the lines in white on black, with Blender's software rasterizer.
    height, across = picture.shape[:2]
    buffer = imbuf.new((across, height))
    blf.size(FONT, size)
    blf.color(FONT, 1.0, 1.0, 1.0, 1.0)
    with blf.bind_imbuf(FONT, buffer):
        for text, x, y in lines:
            blf.position(FONT, x, y, 0.0)
            blf.draw_buffer(FONT, text)
    # Read the pixels back through a file.
    with tempfile.TemporaryDirectory(prefix="halfspace-text-") as folder:
        path = Path(folder) / "text.png"
        imbuf.write(buffer, filepath=str(path))
        ink = pictures.load(path)
    buffer.free()
    # Blend the colour over the picture, with the text as its coverage.
    share = ink[..., :1] * ink[..., 3:]
    picture += share * (np.array(rgb, np.float32) - picture)

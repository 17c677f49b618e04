# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of cost maps: maps side by side with histograms, a range, one cursor over all of them, and one scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.base.arrays import F32, F64
from ...core.inspector import histogram
from ...core.measure import costmap
from . import lettering

BACK = (0.09, 0.095, 0.11)
MARGIN, TEXT, BAR, HISTOGRAM = 14, 15.0, 18, 56
"""Pixels around and between maps, of the letters' height, and of the heights of the colour bar and of histograms."""

HANDLE_RGB, CURSOR_RGB, OUTSIDE_RGB = (0.95, 0.95, 0.97), (0.35, 1.0, 0.55), (0.42, 0.43, 0.46)
"""Colours of the ends of a range, of the cursor, and of the bins outside of the range."""

LINES = 3
"""Lines of text over each map."""

GRIP = 4
"""Half the width of a range's handle in pixels."""


@dataclass(frozen=True)
class Look:
    """low, high: range in shares of the scale, 0 to 1. cursor: column and row from the bottom on every map, or None."""

    low: float = 0.0
    high: float = 1.0
    cursor: tuple[int, int] | None = None

    @property
    def is_whole(self) -> bool:
        """Whether the range includes every pixel."""
        return self.low <= 0 and self.high >= 1


def compose(maps: Sequence[tuple[str, F64]], what: costmap.Quantity, looks: Sequence[Look] = ()) -> F32:
    """Maps under their titles and histograms, above one colour bar with numbers: (h, w, 3) display values.

    looks: one for each map; none for whole ranges without a cursor.
    """
    height, width = maps[0][1].shape
    end = costmap.scale_end([values for _, values in maps])
    line = int(TEXT * 1.4)
    top = foot() + height
    across = MARGIN + len(maps) * (width + MARGIN)
    picture = np.tile(np.array(BACK, np.float32), (top + 2 * MARGIN + HISTOGRAM + LINES * line, across, 1))
    words = []
    # Place the maps with their histograms and titles.
    for i, ((title, values), look) in enumerate(zip(maps, looks or [Look()] * len(maps), strict=True)):
        x = left(i, width)
        low, high = look.low * end, look.high * end
        picture[foot() : top, x : x + width] = histogram.ranged(values, low, high, end)
        _draw_histogram(picture[top + MARGIN // 2 :][:HISTOGRAM, x : x + width], values, look, end)
        if look.cursor is not None:
            _draw_cursor(picture[foot() : top, x : x + width], look.cursor)
        baseline = top + MARGIN + HISTOGRAM
        lines = [title, f"{what.label} {what.unit}: {costmap.summary(values)}", _range_text(values, what, look, end)]
        words += [(text, x, baseline + (LINES - 1 - k) * line + 5.0) for k, text in enumerate(lines) if text]
    # Draw the colour bar and its numbers.
    bar = across - 2 * MARGIN
    scale = np.linspace(0, end, bar)
    picture[MARGIN + line : MARGIN + line + BAR, MARGIN : MARGIN + bar] = costmap.coloured(scale, end)
    words += _numbers(end, what.unit, bar)
    lettering.write(picture, words, TEXT)
    return picture


def _numbers(end: float, unit: str, bar: int) -> list[tuple[str, float, float]]:
    """The numbers under the colour bar of this width, with their places; those without room are left out."""
    words, free = [], float(2 * MARGIN + bar)
    for tick in reversed(costmap.ticks(end)):
        text = costmap.number(tick) if tick < end else f"{costmap.number(tick)} {unit}"
        across = lettering.width(text, TEXT)
        place = MARGIN + bar * tick / end - (across if tick else 0) / (1 if tick == end else 2)
        if place + across + MARGIN / 2 <= free:
            words.append((text, place, float(MARGIN)))
            free = place
    return words


def foot() -> int:
    """Pixels below the maps."""
    return 2 * MARGIN + int(TEXT * 1.4) + BAR


def left(number: int, width: int) -> int:
    """Pixels left of a map."""
    return MARGIN + number * (width + MARGIN)


def pixel_at(x: float, y: float, count: int, size: tuple[int, int]) -> tuple[int, int] | None:
    """Column and row from the bottom of the map's pixel at a place of the picture; None outside of all maps.

    size: width and height of each of `count` maps.
    """
    width, height = size
    row = int(y) - foot()
    for number in range(count):
        column = int(x) - left(number, width)
        if 0 <= column < width and 0 <= row < height:
            return column, row
    return None


def _range_text(values: F64, what: costmap.Quantity, look: Look, end: float) -> str:
    """The number under the cursor, or the share of the range; "" for the whole range."""
    if look.cursor is not None:
        column, row = look.cursor
        return f"{costmap.number(float(values[row, column]))} {what.unit} at the cursor"
    return "" if look.is_whole else histogram.sentence(values, look.low * end, look.high * end, end)


def _draw_histogram(strip: F32, values: F64, look: Look, end: float) -> None:
    """Draw the histogram of a map with the ends of the range, in place. Heights are square roots of numbers."""
    height, width = strip.shape[:2]
    found = histogram.histogram(values, end)
    tall = np.sqrt(found.counts / max(int(found.counts.max()), 1)) * (height - GRIP)
    place = (np.arange(width) + 0.5) / width
    bins = np.minimum((place * histogram.BINS).astype(int), histogram.BINS - 1)
    rgb = costmap.coloured(place * end, end)
    rgb[(place < look.low) | (place > look.high)] = OUTSIDE_RGB
    filled = np.arange(height)[:, None] < np.ceil(tall[bins])[None]
    strip[filled] = np.broadcast_to(np.maximum(rgb, 0.22), strip.shape)[filled]
    for share in (look.low, look.high):
        x = min(int(share * width), width - 1)
        strip[:, x] = HANDLE_RGB
        strip[-GRIP:, max(x - GRIP, 0) : x + GRIP + 1] = HANDLE_RGB


def _draw_cursor(drawn: F32, cursor: tuple[int, int]) -> None:
    """Draw crossed lines around a pixel of a map, in place; the pixel itself stays visible."""
    column, row = cursor
    kept = drawn[row, column].copy()
    drawn[row, :] = CURSOR_RGB
    drawn[:, column] = CURSOR_RGB
    drawn[row, column] = kept

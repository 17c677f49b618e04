# SPDX-License-Identifier: GPL-3.0-or-later
"""The legend of the overlay's colours in the lower left corner of a 3D view."""

from __future__ import annotations

import blf
import gpu
from gpu_extras.batch import batch_for_shader

from ...core.overlay.legend import Entry

FONT, SIZE, LINE, SWATCH, MARGIN = 0, 12.0, 18.0, 22.0, 16.0
"""Number of Blender's font; height of the letters, of a line, width of a colour and distance from the corner, in pixels
of a display without scaling.
"""

BACK = (0.06, 0.065, 0.08, 0.72)
TEXT = (0.92, 0.93, 0.95, 1.0)


def draw(entries: list[Entry], left: float, scale: float) -> None:
    """Draw the lines upwards from the corner of the current region. left: width of panels over it. scale: of the
    display.
    """
    if not entries:
        return
    blf.size(FONT, SIZE * scale)
    wide = max(blf.dimensions(FONT, entry.text)[0] for entry in entries) + (SWATCH + 3 * MARGIN / 2) * scale
    x, y = left + MARGIN * scale, MARGIN * scale
    gpu.state.blend_set("ALPHA")
    try:
        _rectangle(x, y, wide, (len(entries) * LINE + MARGIN / 2) * scale, BACK)
        for number, entry in enumerate(reversed(entries)):
            bottom = y + (number * LINE + MARGIN / 2) * scale
            _swatch(entry, x + MARGIN / 2 * scale, bottom, scale)
            blf.color(FONT, *TEXT)
            indent = SWATCH + MARGIN if entry.colours else MARGIN / 2
            blf.position(FONT, x + indent * scale, bottom, 0.0)
            blf.draw(FONT, entry.text)
    finally:
        gpu.state.blend_set("NONE")


def _swatch(entry: Entry, x: float, y: float, scale: float) -> None:
    """The colours of an entry, side by side."""
    part = SWATCH * scale / max(len(entry.colours), 1)
    for number, rgb in enumerate(entry.colours):
        _rectangle(x + number * part, y - 1, part, SIZE * scale, (*rgb[:3], 1.0))


def _rectangle(x: float, y: float, width: float, height: float, rgba: tuple[float, ...]) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y), (x + width, y + height), (x, y + height)]
    batch = batch_for_shader(shader, "TRIS", {"pos": corners})
    shader.bind()
    shader.uniform_float("color", rgba)
    batch.draw(shader)

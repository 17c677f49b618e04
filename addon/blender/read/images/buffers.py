# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that only Blender can read: generated, painted and packed ones, and frames of movies."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import files
from .numbers import Memory, Numbers, colourful

PLAIN = (("png", "uint8"), ("jpeg", "uint8"))
"""Formats and types of files that Blender and OpenImageIO decode to the same bytes."""

_frames: dict[str, tuple[int, Numbers]] = {}
"""The last frame of each movie. To read one makes a data block, at which Blender updates its views."""


def needed(image: Any) -> bool:
    """Whether the picture is not, or not as it is shown, in a file of its own."""
    return bool(
        image.source in ("GENERATED", "MOVIE") or image.packed_file or len(image.packed_files) or image.is_dirty
    )


def read(image: Any, frame: int = 0) -> Numbers | None:
    """The picture in Blender's memory, of a movie at this frame; None if it is missing or empty."""
    if image.source != "MOVIE":
        return _copied(image)
    path = files.path_of(image, 0)
    if path not in _frames or _frames[path][0] != frame:
        with _shown(image, frame):
            found = _copied(image)
        if found is None:
            return None
        _frames[path] = frame, found
    number, found = _frames[path]
    return Numbers(Memory.of(found.memory.pixels), found.linear) if number == frame else None


def packed(image: Any, *, opaque: bool) -> Numbers | None:
    """The picture of a packed file of bytes, with the channels and alpha that Blender would give it; None for another
    one. Blender's own numbers take four times the memory.
    """
    if image.source != "FILE" or image.is_dirty or len(image.packed_files) != 1:
        return None
    with tempfile.TemporaryDirectory(prefix="halfspace-packed-") as folder:
        path = Path(folder) / f"packed{Path(image.filepath).suffix or '.png'}"
        path.write_bytes(image.packed_files[0].packed_file.data)
        found = files.read(str(path), opaque=opaque, kinds=PLAIN)
    return found and Numbers(colourful(found.memory, opaque=opaque), multiplied=found.multiplied)


@contextmanager
def _shown(image: Any, frame: int) -> Iterator[None]:
    """Make Blender hold this frame of a movie as the image: that of the texture that was evaluated last."""
    texture: Any = bpy.data.textures.new("Frame", "IMAGE")
    try:
        texture.image = image.original
        texture.image_user.frame_current = frame
        texture.evaluate((0.0, 0.0, 0.0))
        yield
    finally:
        bpy.data.textures.remove(texture)


def _copied(image: Any) -> Numbers | None:
    """A copy of the numbers; what Blender read for it is freed again."""
    held = image.has_data
    # A missing file has no size or raises.
    try:
        width, height = image.size
        count = len(image.pixels)
    except RuntimeError:
        return None
    channels = image.channels
    if not width or not height or count != width * height * channels:
        return None
    memory = Memory((height, width, channels), np.float32)
    pixels = memory.pixels
    image.pixels.foreach_get(pixels.reshape(-1))
    linear = bool(image.is_float)
    if not held and not image.is_dirty:
        image.buffers_free()
    if linear:
        return Numbers(memory, linear=True, multiplied=True)
    # Keep bytes, and alpha only if anything is transparent.
    kept = 3 if channels == 4 and bool((pixels[..., 3] == 1).all()) else channels
    pixels *= 255.0
    return Numbers(Memory.of(np.rint(pixels, out=pixels)[..., :kept], np.uint8))


@contextmanager
def tiles(image: Any) -> Iterator[dict[int, str]]:
    """Temporary files with the tiles of an image that are packed or painted, by their UDIM numbers."""
    packed = {file.tile_number: bytes(file.packed_file.data) for file in image.packed_files}
    suffix = Path(image.filepath).suffix or ".png"
    with tempfile.TemporaryDirectory(prefix="halfspace-tiles-") as folder:
        pattern = Path(folder) / f"tile.<UDIM>{suffix}"
        found = files.tiles(image, str(pattern))
        if image.is_dirty or not packed:
            image.save(filepath=str(pattern), save_copy=True)
        else:
            for number in found.keys() & packed.keys():
                Path(found[number]).write_bytes(packed[number])
        yield found

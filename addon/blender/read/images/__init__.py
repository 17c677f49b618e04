# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as arrays, each read once: as their files store them, in the way of Cycles."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ....core.scene.scene import Image
from ..nodes import Unsupported
from . import buffers, colours, files
from .numbers import Numbers, associated, multiply

if TYPE_CHECKING:
    from ....core.base.arrays import F32
    from ....core.base.notes import Notes

__all__ = ["Gallery", "associated", "read_image"]

EMPTY = np.zeros((0, 0, 4), np.float32)
"""A missing image: the native module shows Blender's pink for it."""

Use = tuple[Any, int]
"""An image and the frame of it that is shown; 0 if it has only one."""


class Gallery:
    """Collects the images of nodes; the pixels of those in use are read at the end. frame: that of the scene. known:
    images that were read before, by their identity and frame, to which those read here are added.
    """

    def __init__(self, frame: int = 1, known: dict[Any, Image] | None = None) -> None:
        self._frame = frame
        self._known = {} if known is None else known
        self._images: list[Image | Use] = []
        self._numbers: dict[tuple[int, int], int] = {}

    def number(self, image: Any, user: Any = None) -> int:
        """The number in the scene of the image, or of the frame that a node's `image_user` selects."""
        frame = 0
        if user is not None and image.source in ("SEQUENCE", "MOVIE"):
            frame = frame_of(user, self._frame)
        return self._number((image.original.as_pointer(), frame), (image, frame))

    def add(self, name: str, pixels: F32) -> int:
        """The number of a generated picture, (h, w, 4) linear float32."""
        return self._number((id(pixels), 0), Image(name, pixels))

    def _number(self, key: tuple[int, int], image: Image | Use) -> int:
        if key not in self._numbers:
            self._numbers[key] = len(self._images)
            self._images.append(image)
        return self._numbers[key]

    def read(self, used: set[int], notes: Notes) -> tuple[Image, ...]:
        """All images by number; unused ones stay empty."""
        found = []
        for number, image in enumerate(self._images):
            if isinstance(image, Image):
                found.append(image if number in used else Image(image.name, EMPTY))
            else:
                item, frame = image
                found.append(self._of(item, frame, notes) if number in used else Image(item.name, EMPTY))
        return tuple(found)

    def _of(self, item: Any, frame: int, notes: Notes) -> Image:
        """A frame of an image, read once."""
        key = item.original.as_pointer(), frame
        if key not in self._known:
            self._known[key] = read_image(item, notes, frame)
        return self._known[key]


def frame_of(user: Any, frame: int) -> int:
    """The frame of a sequence or movie at a frame of the scene."""
    at, length = frame - user.frame_start + 1, user.frame_duration
    if length == 0:
        return 0
    at = (at - 1) % length + 1 if user.use_cyclic else min(max(at, 0), length)
    return int(at + user.frame_offset)


def read_image(image: Any, notes: Notes, frame: int = 0) -> Image:
    """The image, or a frame of it, its colours multiplied by alpha as in Cycles; zero rows if it is missing."""
    if image.source != "TILED":
        path = None if buffers.needed(image) else files.path_of(image, frame)
        return _one(image, image.name, path, frame, notes)
    with buffers.tiles(image) if buffers.needed(image) else nullcontext(files.tiles(image)) as tiles:
        read = tuple(
            (number, _one(image, f"{image.name} ({number})", path, frame, notes)) for number, path in tiles.items()
        )
    return Image(image.name, EMPTY, tiles=read)


def _one(image: Any, name: str, path: str | None, frame: int, notes: Notes) -> Image:
    """An image, or one tile of it, from its file or, without one, from Blender's memory."""
    stored = None
    if path is not None:
        stored = files.read(path)
    # What Blender reads and its OpenImageIO does not is taken from Blender.
    if stored is None and image.source != "TILED" and (path is None or image.source != "SEQUENCE"):
        stored = buffers.read(image, frame)
    if stored is None:
        notes.add("Image is missing or empty, shown in pink", name)
        return Image(name, EMPTY)
    space = image.colorspace_settings.name
    try:
        space = colours.RAW if stored.linear else colours.kind(space)
    except Unsupported as unsupported:
        notes.add(f"Colour space {space} is taken for sRGB ({unsupported}), in image", name)
        space = colours.SRGB
    pixels = _texels(stored, opaque=image.alpha_mode == "NONE")
    if pixels.dtype.kind == "f" and not np.isfinite(pixels).all():
        faulty = ~np.isfinite(pixels)
        notes.add("Image has values that are not finite, replaced by 0", name, int(faulty.any(axis=-1).sum()))
        pixels[faulty] = 0
    # As in Cycles, only what is declared as straight is multiplied by alpha, whatever its format, and no grey. Before
    # Blender 5.0 the format decides.
    declared = image.alpha_mode == "STRAIGHT" if bpy.app.version >= (5, 0) else not stored.multiplied
    straight = declared and associated(image)
    if space not in (colours.RAW, colours.SRGB):
        pixels = colours.converted(pixels, space, divided=associated(image) and not straight)
    if straight and stored.pixels.shape[2] >= 4:
        pixels = np.array(pixels)
        multiply(pixels)
    # Memory of this kind is shared with the native module.
    shared = np.ndarray(pixels.shape, pixels.dtype, buffer=pixels.tobytes())
    return Image(name, shared, space == colours.SRGB)


def _texels(stored: Numbers, *, opaque: bool) -> Any:
    """(h, w, 1 or 4) numbers as they are stored; more than one channel become four."""
    found = stored.pixels
    height, width, channels = found.shape
    if channels == 1:
        return found
    if channels >= 4 and not opaque:
        return found[..., :4]
    pixels = np.empty((height, width, 4), found.dtype)
    pixels[..., 3] = 1 if found.dtype.kind == "f" else np.iinfo(found.dtype).max
    if channels == 2:
        pixels[..., :3] = found[..., :1]
        if not opaque:
            pixels[..., 3] = found[..., 1]
    else:
        pixels[..., :3] = found[..., :3]
    return pixels

# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as RGBA arrays, each read once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Color

from ...core.base.arrays import F32
from ...core.scene.scene import Image

if TYPE_CHECKING:
    from ...core.base.notes import Notes

RAW_SPACES = {"Non-Color", "Raw", "Generic Data", "scene_linear", "data"}
"""Colour spaces whose numbers are used unchanged."""

LINEAR_SPACES = {"Linear", "Linear Rec.709"}
"""Colour spaces with the primaries of sRGB and linear values."""

EMPTY = np.zeros((0, 0, 4), np.float32)
"""A missing image: the native module shows Blender's pink for it."""


class Gallery:
    """Collects the images of nodes; the pixels of those in use are read at the end."""

    def __init__(self) -> None:
        self._images: list[Any] = []
        self._numbers: dict[int, int] = {}

    def number(self, image: Any) -> int:
        """The image's number in the scene."""
        key = image.original.as_pointer()
        if key not in self._numbers:
            self._numbers[key] = len(self._images)
            self._images.append(image)
        return self._numbers[key]

    def add(self, name: str, pixels: F32) -> int:
        """The number of a generated picture, (h, w, 4) linear float32."""
        key = id(pixels)
        if key not in self._numbers:
            self._numbers[key] = len(self._images)
            self._images.append(Image(name, pixels))
        return self._numbers[key]

    def read(self, used: set[int], notes: Notes) -> tuple[Image, ...]:
        """All images by number; unused ones stay empty."""
        return tuple(
            (image if isinstance(image, Image) else read_image(image, notes))
            if number in used
            else Image(image.name, EMPTY)
            for number, image in enumerate(self._images)
        )


def read_image(image: Any, notes: Notes) -> Image:
    """The image with its colours multiplied by alpha; zero rows if it is missing."""
    space = image.colorspace_settings.name
    raw = image.is_float or space in RAW_SPACES or space == _working_space()  # floats are converted when loaded
    encoded = not raw and space not in LINEAR_SPACES
    if encoded and space != "sRGB":
        notes.add(f"Colour space {space} is not supported yet, taken for sRGB, in image", image.name)
    pixels = _pixels(image, notes)
    colours, alpha = pixels[..., :3], pixels[..., 3:]
    primaries = _primaries()
    if raw or np.allclose(primaries, np.eye(3), atol=1e-4):
        if not image.is_float and image.alpha_mode == "STRAIGHT" and associated(image):
            colours *= alpha
        return Image(image.name, pixels, encoded)
    # As in Cycles, convert straight colours: encoded values are not proportional to light.
    if image.alpha_mode == "PREMUL":
        np.divide(colours, alpha, out=colours, where=alpha != 0)
    if encoded:
        colours[:] = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    colours[:] = colours @ primaries
    if associated(image):
        colours *= alpha
    return Image(image.name, pixels, srgb=False)


def _working_space() -> str:
    """Name of the file's working space; before Blender 5.0 files have none."""
    return bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else "scene_linear"


def _primaries() -> F32:
    """(3, 3) primaries of sRGB in the working space of the file or of the user's configuration."""
    return np.array([Color(row).from_srgb_to_scene_linear() for row in np.eye(3)], np.float32)


def associated(image: Any) -> bool:
    """Whether its colours are multiplied by alpha: neither for data, nor if alpha is ignored or channel-packed."""
    return image.alpha_mode in ("STRAIGHT", "PREMUL") and not image.colorspace_settings.is_data


def _pixels(image: Any, notes: Notes) -> F32:
    """(h, w, 4) float32 stored values; greyscale is expanded, and non-finite values become 0."""
    name = image.name
    # Note sources of which only a part is read.
    if image.source == "TILED":
        notes.add("Image tiles (UDIM) are not supported yet, the first one is used", name)
    elif image.source in ("SEQUENCE", "MOVIE"):
        notes.add("Image sequences and movies are not supported yet, one frame is used", name)
    # Read the stored values; a missing file has no size or raises.
    try:
        width, height = image.size
        count = len(image.pixels)
    except RuntimeError:
        width = height = count = 0
    channels = image.channels
    if not width or not height or count != width * height * channels:
        notes.add("Image is missing or empty, shown in pink", name)
        return EMPTY
    flat = np.empty(count, np.float32)
    image.pixels.foreach_get(flat)
    found = flat.reshape(height, width, channels)
    # Expand one channel to grey, and two to grey with alpha.
    pixels = np.ones((height, width, 4), np.float32)
    if channels >= 3:
        pixels[..., : min(channels, 4)] = found[..., :4]
    else:
        pixels[..., :3] = found[..., :1]
        if channels == 2:
            pixels[..., 3] = found[..., 1]
    faulty = ~np.isfinite(pixels)
    if faulty.any():
        notes.add("Image has values that are not finite, replaced by 0", name, int(faulty.any(axis=-1).sum()))
        pixels[faulty] = 0
    if image.alpha_mode == "NONE":
        pixels[..., 3] = 1
    return pixels

# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as RGBA arrays, read once each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from mathutils import Color

from ..core.scene import F32, Image

if TYPE_CHECKING:
    from ..core.notes import Notes

RAW_SPACES = {"Non-Color", "Raw", "Generic Data", "Linear", "Linear Rec.709", "scene_linear", "data"}
"""Colour spaces whose numbers are taken as they are."""

EMPTY = np.zeros((0, 0, 4), np.float32)
"""A missing image: the native module shows Blender's pink for it."""


class Gallery:
    """Collects the images that nodes ask for; their pixels are read at the end, for those in use."""

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
        """The number of a picture that Blender has not, (h, w, 4) linear float32."""
        key = id(pixels)
        if key not in self._numbers:
            self._numbers[key] = len(self._images)
            self._images.append(Image(name, pixels))
        return self._numbers[key]

    def read(self, used: set[int], notes: Notes) -> tuple[Image, ...]:
        """All images by number; those that nobody uses stay empty."""
        return tuple(
            (image if isinstance(image, Image) else read_image(image, notes))
            if number in used
            else Image(image.name, EMPTY)
            for number, image in enumerate(self._images)
        )


def read_image(image: Any, notes: Notes) -> Image:
    """The image with its colours times alpha; no rows when it is missing."""
    space = image.colorspace_settings.name
    encoded = not image.is_float and space not in RAW_SPACES
    if encoded and space != "sRGB":
        notes.add(f"Colour space {space} is not supported yet, taken for sRGB, in image", image.name)
    straight = not image.is_float and image.alpha_mode == "STRAIGHT" and associated(image)
    pixels = _pixels(image, notes, straight=straight)
    primaries = _primaries()
    if not encoded or np.allclose(primaries, np.eye(3), atol=1e-4):
        return Image(image.name, pixels, encoded)
    coded = pixels[..., :3]
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    pixels[..., :3] = linear @ primaries
    return Image(image.name, pixels, srgb=False)


def _primaries() -> F32:
    """What the red, green and blue of sRGB are in the space that the file, or the user's configuration, renders in."""
    return np.array([Color(row).from_srgb_to_scene_linear() for row in np.eye(3)], np.float32)


def associated(image: Any) -> bool:
    """Whether its colours count times alpha: not those of data, nor where alpha is ignored or a channel like others."""
    return image.alpha_mode in ("STRAIGHT", "PREMUL") and not image.colorspace_settings.is_data


def _pixels(image: Any, notes: Notes, *, straight: bool) -> F32:
    name = image.name
    if image.source == "TILED":
        notes.add("Image tiles (UDIM) are not supported yet, the first one is used", name)
    elif image.source in ("SEQUENCE", "MOVIE"):
        notes.add("Image sequences and movies are not supported yet, one frame is used", name)
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
    if straight:
        pixels[..., :3] *= pixels[..., 3:]
    if image.alpha_mode == "NONE":
        pixels[..., 3] = 1
    return pixels

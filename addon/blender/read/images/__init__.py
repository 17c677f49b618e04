# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as arrays, each read once: as their files store them, in the way of Cycles."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ....core.base import native
from ....core.base.steps import Steps
from ....core.scene.scene import Image
from ..nodes import Unsupported
from . import buffers, colours, files
from .numbers import Memory, Numbers, associated, colourful, halvings, multiply, smaller

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ....core.base.arrays import F32
    from ....core.base.notes import Notes

__all__ = ["Gallery", "associated", "read_image"]

EMPTY = np.zeros((0, 0, 4), np.float32)
"""A missing image: the native module shows Blender's pink for it."""

SHARE = 0.5
"""Share of the free memory that images may take, next to geometry and structures."""

UNLIMITED = 1 << 31
"""More than the texels of any side of an image."""

Use = tuple[Any, int]
"""An image and the frame of it that is shown; 0 if it has only one."""


class Gallery:
    """Collects the images of nodes; the pixels of those in use are read at the end. frame: that of the scene. known:
    images that were read before, by their identity and frame, to which those read here are added. most: texels of a
    side, see `smaller`.
    """

    def __init__(self, frame: int = 1, known: dict[Any, Image] | None = None, most: int | None = None) -> None:
        self._frame, self._most = frame, most
        self._fitting = UNLIMITED if most is None else most
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

    def read(self, used: set[int], notes: Notes) -> Steps[tuple[Image, ...]]:
        """All images by number, read one at a time; unused ones stay empty."""
        self._fit([image for number, image in enumerate(self._images) if number in used], notes)
        found = []
        for number, image in enumerate(self._images):
            if isinstance(image, Image):
                found.append(image if number in used else Image(image.name, EMPTY))
            else:
                item, frame = image
                found.append(self._of(item, frame, notes) if number in used else Image(item.name, EMPTY))
            yield
        return tuple(found)

    def _of(self, item: Any, frame: int, notes: Notes) -> Image:
        """A frame of an image, read once."""
        key = self._key(item, frame)
        if key not in self._known:
            self._known[key] = read_image(item, notes, frame, self._fitting)
        return self._known[key]

    def _key(self, item: Any, frame: int) -> Any:
        return item.original.as_pointer(), frame, self._most

    def _fit(self, images: Iterable[Image | Use], notes: Notes) -> None:
        """Halve the largest of these images until those to be read fit into a share of the free memory."""
        new = [use for use in images if not isinstance(use, Image) and self._key(*use) not in self._known]
        sizes = [(image.name, size) for image, frame in new for size in _sizes(image, frame)]
        room = SHARE * native.load().free_memory() if sizes else 0

        def needed() -> float:
            return sum(x * y * bytes_ / halvings(x, y, self._fitting) ** 2 for _, (x, y, bytes_) in sizes)

        whole = needed()
        while needed() > room and self._fitting > 1:
            self._fitting = min(self._fitting, max(max(size[:2]) for _, size in sizes)) // 2
        for name in {name: None for name, size in sizes if max(size[:2]) > self._fitting and needed() < whole}:
            text = f"Images would need {whole / 2**30:.1f} GiB of memory: rendered with a side of at most"
            notes.add(f"{text} {self._fitting:,} texels", name)


def _sizes(image: Any, frame: int) -> list[files.Size]:
    """The sizes of an image, or of its tiles, that are known without reading it."""
    if buffers.needed(image):
        return [(*image.size, image.channels * (4 if image.is_float else 1))] if image.has_data else []
    paths = files.tiles(image).values() if image.source == "TILED" else [files.path_of(image, frame)]
    return [size for path in paths if (size := files.size(path)) is not None]


def frame_of(user: Any, frame: int) -> int:
    """The frame of a sequence or movie at a frame of the scene."""
    at, length = frame - user.frame_start + 1, user.frame_duration
    if length == 0:
        return 0
    at = (at - 1) % length + 1 if user.use_cyclic else min(max(at, 0), length)
    return int(at + user.frame_offset)


def read_image(image: Any, notes: Notes, frame: int = 0, most: int = UNLIMITED) -> Image:
    """The image, or a frame of it, its colours multiplied by alpha as in Cycles; zero rows if it is missing. most: see
    `smaller`.
    """
    if image.source != "TILED":
        path = None if buffers.needed(image) else files.path_of(image, frame)
        return _one(image, image.name, path, frame, notes, most)
    with buffers.tiles(image) if buffers.needed(image) else nullcontext(files.tiles(image)) as tiles:
        read = tuple(
            (number, _one(image, f"{image.name} ({number})", path, frame, notes, most))
            for number, path in tiles.items()
        )
    return Image(image.name, EMPTY, tiles=read)


def _one(image: Any, name: str, path: str | None, frame: int, notes: Notes, most: int) -> Image:
    """An image, or one tile of it, from its file or, without one, from Blender's memory."""
    opaque = image.alpha_mode == "NONE"
    stored = buffers.packed(image, opaque=opaque) if path is None else files.read(path, opaque=opaque)
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
    memory = _texels(stored, opaque=opaque)
    faulty = _repaired(memory.pixels)
    if faulty:
        notes.add("Image has values that are not finite, replaced by 0", name, faulty)
    # As in Cycles, only what is declared as straight is multiplied by alpha, whatever its format, and no grey. Before
    # Blender 5.0 the format decides.
    declared = image.alpha_mode == "STRAIGHT" if bpy.app.version >= (5, 0) else not stored.multiplied
    straight = declared and associated(image)
    if space not in (colours.RAW, colours.SRGB):
        wide = colourful(memory) if memory.pixels.shape[2] == 2 else memory
        memory = colours.converted(wide.pixels, space, divided=associated(image) and not straight)
    if straight and stored.memory.pixels.shape[2] == 4:
        multiply(memory.pixels)
    return Image(name, smaller(memory, most).shared(), space == colours.SRGB)


def _texels(stored: Numbers, *, opaque: bool) -> Memory:
    """The numbers as they are stored, opaque where alpha is ignored."""
    pixels = stored.memory.pixels
    if opaque and pixels.shape[2] == 2:
        return colourful(stored.memory, opaque=True)
    if opaque and pixels.shape[2] == 4:
        pixels[..., 3] = 1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
    return stored.memory


def _repaired(pixels: Any) -> int:
    """The number of texels with values that are not finite, which become 0."""
    count = 0
    if pixels.dtype.kind == "f":
        # Row by row, which takes little memory.
        for row in pixels:
            faulty = ~np.isfinite(row)
            if faulty.any():
                count += int(faulty.any(axis=-1).sum())
                row[faulty] = 0
    return count

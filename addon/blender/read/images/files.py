# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in files, read through Blender's own OpenImageIO as Cycles reads them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..bundled import bundled
from ..nodes import Unsupported
from .numbers import Memory, Numbers

TYPES = {"uint8": "uint8", "uint16": "uint16", "half": "half", "float": "float", "double": "float"}
"""The types in which numbers are read, by those of files; others are read as bytes."""

NUMPY = {"half": "float16", "float": "float32"}
"""NumPy's names of types that have another one."""

Size = tuple[int, int, int]
"""Width and height of a picture, and bytes of a texel."""

BLOCK = 1 << 22
"""Numbers that are read at once, beside those of the whole picture."""


def path_of(image: Any, frame: int) -> str:
    """The absolute path of an image's file, or of one frame of a sequence: the last digits of its name are the
    frame's number.
    """
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if image.source != "SEQUENCE":
        return str(path)
    found = re.match(r"(.*?)(\d+)(\D*)$", path.stem)
    if found is None:
        return str(path)
    before, digits, after = found.groups()
    return str(path.with_name(f"{before}{max(frame, 0):0{len(digits)}d}{after}{path.suffix}"))


def tiles(image: Any, path: str | None = None) -> dict[int, str]:
    """The paths of an image's tiles by their UDIM numbers."""
    path = path_of(image, 0) if path is None else path
    return {tile.number: tile_path(path, tile.number) for tile in image.tiles}


def tile_path(path: str, number: int) -> str:
    """The path of a tile: the marks for its number, or for its place, are replaced."""
    row, column = divmod(number - 1001, 10)
    return path.replace("<UDIM>", f"{number:04d}").replace("<UVTILE>", f"u{column + 1}_v{row + 1}")


def read(path: str, *, opaque: bool = False, kinds: Collection[tuple[str, str]] = ()) -> Numbers | None:
    """The picture in a file as it is stored, of more than four channels the first ones; None if it is missing or cannot
    be read. opaque: without the alpha of colours. kinds: the formats and types that are read (none: all).
    """
    with _opened(path) as source:
        if source is None:
            return None
        spec = source.spec()
        if kinds and (source.format_name(), str(spec.format)) not in kinds:
            return None
        multiplied = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0
        memory = _pixels(source, spec, min(spec.nchannels, 3 if opaque else 4))
    return None if memory is None else Numbers(memory, multiplied=multiplied)


def size(path: str) -> Size | None:
    """The size of the picture in a file, as its header states it; None if that cannot be read."""
    with _opened(path) as source:
        if source is None:
            return None
        spec = source.spec()
        return spec.width, spec.height, min(spec.nchannels, 4) * np.dtype(_kind(spec)[1]).itemsize


@contextmanager
def _opened(path: str) -> Iterator[Any]:
    """A file that is open in OpenImageIO, or None."""
    source = None
    if Path(path).is_file():
        with suppress(Unsupported):
            oiio = bundled("OpenImageIO")
            # Read straight colours: in bytes, multiplied ones would lose digits before a conversion.
            wishes = oiio.ImageSpec()
            wishes.attribute("oiio:UnassociatedAlpha", 1)
            source = oiio.ImageInput.open(path, wishes)
            if source is None:
                oiio.geterror()
    try:
        yield source
    finally:
        if source is not None:
            source.close()


def _kind(spec: Any) -> tuple[str, str]:
    """The type in which numbers are read, and its name in NumPy."""
    kind = TYPES.get(str(spec.format), "uint8")
    return kind, NUMPY.get(kind, kind)


def _pixels(source: Any, spec: Any, channels: int) -> Memory | None:
    """The first channels of an open file, turned upside down; None if they cannot be read."""
    kind, dtype = _kind(spec)
    memory = Memory((spec.height, spec.width, channels), dtype)
    # Read few rows at once, of a file in tiles whole rows of these.
    tall = spec.tile_height or 1
    step = max(BLOCK // max(spec.width * channels, 1) // tall, 1) * tall
    for first in range(0, spec.height, step):
        last = min(first + step, spec.height)
        top, bottom, left = first + spec.y, last + spec.y, spec.x
        if spec.tile_height:
            rows = source.read_tiles(left, left + spec.width, top, bottom, 0, 1, 0, channels, kind)
        else:
            rows = source.read_scanlines(top, bottom, 0, 0, channels, kind)
        if rows is None:
            return None
        memory.pixels[spec.height - last : spec.height - first] = rows.reshape(-1, spec.width, channels)[::-1]
    return memory

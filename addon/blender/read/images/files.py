# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in files, read through Blender's own OpenImageIO as Cycles reads them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..bundled import bundled
from ..nodes import Unsupported
from .numbers import Numbers

TYPES = {"uint8": "uint8", "uint16": "uint16", "half": "half", "float": "float", "double": "float"}
"""The types in which numbers are read, by those of files; others are read as bytes."""


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


def read(path: str) -> Numbers | None:
    """The picture in a file; None if it is missing or cannot be read."""
    if not Path(path).is_file():
        return None
    try:
        oiio = bundled("OpenImageIO")
    except Unsupported:
        return None
    # Read straight colours: in bytes, multiplied ones would lose digits before a conversion.
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(path, wishes)
    if source is None:
        oiio.geterror()
        return None
    try:
        spec = source.spec()
        found = source.read_image(0, 0, 0, spec.nchannels, TYPES.get(str(spec.format), "uint8"))
        multiplied = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0
    finally:
        source.close()
    if found is None:
        return None
    pixels = found.reshape(spec.height, spec.width, spec.nchannels)
    return Numbers(np.ascontiguousarray(pixels[::-1]), multiplied=multiplied)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered pictures as arrays."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO


def exr(scene: Any, path: Path, *, layers: bool = False) -> dict[str, np.ndarray[Any, Any]]:
    """Render to a multilayer EXR; every channel as (h, w), rows from the bottom, by its name.

    layers: whether the names begin with that of the view layer. With several views they begin with that of the view.
    """
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = {}
    part = 0
    file = OpenImageIO.ImageInput.open(scene.render.filepath)
    while file.seek_subimage(part, 0):
        view = str(file.spec().get_string_attribute("view"))
        pixels = file.read_image(part, 0, 0, file.spec().nchannels, "float")
        for i, name in enumerate(file.spec().channelnames):
            shown = name if layers else name.split(".", 1)[-1]
            channels[f"{view}.{shown}" if view else shown] = np.flipud(pixels[..., i])
        part += 1
    file.close()
    return channels


def render(scene: Any, folder: Path) -> dict[str, np.ndarray[Any, Any]]:
    """The channels of the scene's picture, rendered into this folder."""
    return exr(scene, folder / "picture.exr")


def both(scene: Any, folder: Path) -> list[dict[str, np.ndarray[Any, Any]]]:
    """The channels of the pictures of this engine and of Cycles."""
    found = []
    for engine in ("HALFSPACE", "CYCLES"):
        scene.render.engine = engine
        found.append(exr(scene, folder / f"{engine}.exr"))
    return found


def colours(channels: dict[str, np.ndarray[Any, Any]], name: str = "Combined") -> Any:
    """The colours of a pass, (h, w, 3)."""
    return np.stack([channels[f"{name}.{c}"] for c in "RGB"], axis=-1).astype(float)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as arrays: rendered with any engine, displayed through the scene's view transform."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.base.arrays import F32
from ...core.base.native import first_line
from ...core.base.picture_files import JPEG_QUALITY, replacing


def render(scene: Any) -> F32:
    """Render the scene with its engine: (height, width, 4) float32, scene linear, rows from the bottom. The views of a
    stereo picture are side by side.

    The result goes through a file, because Blender exposes render results only in a window. Raises RuntimeError with
    the engine's message, and OSError if the file cannot be written.
    """
    image_settings = scene.render.image_settings
    with tempfile.TemporaryDirectory(prefix="halfspace-picture-") as folder:
        path = Path(folder) / "picture.exr"
        as_file(image_settings, "OPEN_EXR")
        image_settings.color_mode, image_settings.color_depth = "RGBA", "32"
        scene.render.filepath = str(path)
        paths = [path]
        if scene.render.use_multiview:
            image_settings.views_format = "INDIVIDUAL"
            paths = [path.with_stem(path.stem + view.file_suffix) for view in scene.render.views if view.use]
        bpy.ops.render.render(write_still=True, scene=scene.name)
        if not all(path.is_file() for path in paths):
            raise RuntimeError("nothing was rendered")
        return np.concatenate([load(path) for path in paths], axis=1)


def load(path: Path) -> F32:
    """The stored values of a picture file, (height, width, 4) float32, rows from the bottom. Raises OSError."""
    image = bpy.data.images.load(str(path))
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        if not width * height:  # Blender reports that only on standard error
            raise OSError(f"{path}: cannot be read: it is no picture, or incomplete, as on a full disk")
        values = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(values)
    finally:
        bpy.data.images.remove(image)
    return values.reshape(height, width, 4)


def save_displayed(path: Path, picture: F32, scene: Any) -> F32:
    """Write (height, width, 3 or 4) scene linear values as PNG through the scene's view transform.

    Returns the (height, width, 3) values in the file, 0 to 1. Raises OSError, and then leaves an older picture
    unchanged.
    """
    image = _image(picture, float_buffer=True)
    try:
        as_file(scene.render.image_settings, "PNG")
        scene.render.image_settings.color_mode = "RGB"
        with _saving(path) as fresh:
            image.save_render(str(fresh), scene=scene)
    finally:
        bpy.data.images.remove(image)
    return load(path)[..., :3]


def save(path: Path, picture: F32) -> None:
    """Write (height, width, 3) display values, 0 to 1, unchanged: as JPEG by the name's suffix, else as PNG.

    Raises OSError, and then leaves an older picture unchanged.
    """
    image = _image(picture, float_buffer=False)
    try:
        image.file_format = "JPEG" if path.suffix in (".jpg", ".jpeg") else "PNG"
        with _saving(path) as fresh:
            image.save(filepath=str(fresh), quality=JPEG_QUALITY)
    finally:
        bpy.data.images.remove(image)


@contextlib.contextmanager
def _saving(path: Path) -> Iterator[Path]:
    """Like `replacing`, and turns the RuntimeErrors of Blender's save functions into OSErrors."""
    with replacing(path) as fresh:
        try:
            yield fresh
        except RuntimeError as error:
            raise OSError(f"{path}: cannot be written: {first_line(error)}") from error


def halved(picture: F32) -> F32:
    """(2h, 2w, 3) values reduced to (h, w, 3) means of 2 × 2 pixels."""
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    return picture[: 2 * height, : 2 * width].reshape(height, 2, width, 2, -1).mean(axis=(1, 3), dtype=np.float32)


def _image(picture: F32, *, float_buffer: bool) -> Any:
    height, width = picture.shape[:2]
    image = bpy.data.images.new("picture", width, height, alpha=False, float_buffer=float_buffer)
    values = np.ones((height, width, 4), np.float32)
    values[..., :3] = picture[..., :3]
    image.pixels.foreach_set(values.reshape(-1))
    image.update()
    return image


def as_file(image_settings: Any, file_format: str) -> None:
    """Set a file format; since Blender 5.0 the media type has to be set first."""
    if hasattr(image_settings, "media_type"):
        image_settings.media_type = "MULTI_LAYER_IMAGE" if file_format == "OPEN_EXR_MULTILAYER" else "IMAGE"
    image_settings.file_format = file_format

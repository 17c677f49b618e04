# SPDX-License-Identifier: GPL-3.0-or-later
"""Removal of the noise of pictures, by the library of denoising that Blender ships."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ...core.base import denoise
from ..read.passes import CATCHER_PASS

if TYPE_CHECKING:
    from ...core.base.arrays import F32
    from ...core.session.cleaning import Denoiser
    from ...core.structures.settings import RenderSettings

FOLDERS = ("lib", "blender.shared")
"""Where Blender keeps its libraries, next to the folder of its scripts: the second on Windows."""


def finder() -> Callable[[], ctypes.CDLL]:
    """A function for any thread that returns the library. Raises denoise.DenoiseError."""
    home = Path(bpy.utils.resource_path("LOCAL")).parent
    return lambda: denoise.load(home / name for name in FOLDERS)


def quick() -> Denoiser:
    """Denoises pictures of the viewport, with the quality that Cycles has there, on any thread."""
    find = finder()

    def clean(color: F32, albedo: F32 | None, normal: F32 | None, *, threads: int, going: Callable[[], bool]) -> F32:
        return denoise.filtered(find(), color, albedo=albedo, normal=normal, quick=True, threads=threads, going=going)

    return clean


def apply(
    buffers: Mapping[str, F32], settings: RenderSettings, keep_going: Callable[[], bool], *, shadows: bool = False
) -> None:
    """Remove the noise of the flat pass Combined of a final render, in place. Raises denoise.DenoiseError.

    buffers: the passes by their native names, with those of `with_features`. shadows: whether there are catchers, whose
    noise is in the alpha of a transparent film or in their pass; otherwise alpha stays.
    """
    library = finder()()
    width, height = settings.size

    def clean(picture: F32, albedo: F32 | None, normal: F32 | None) -> F32:
        return denoise.denoise(
            library, picture, albedo=albedo, normal=normal, threads=settings.threads, keep_going=keep_going
        )

    combined = buffers["Combined"].reshape(height, width, 4)
    features = {} if settings.integrator == "ao" else {name: buffers[name] for name in denoise.FEATURES}
    shadow = buffers.get(CATCHER_PASS.name) if shadows else None
    denoise.remove(clean, combined, features, alpha=shadows and shadow is None and settings.film_transparent)
    if shadow is not None:
        picture = shadow.reshape(height, width, 3)
        picture[:] = clean(picture, None, None)

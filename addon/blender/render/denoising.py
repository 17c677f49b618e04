# SPDX-License-Identifier: GPL-3.0-or-later
"""Removal of the noise of final renders, by the library of denoising that Blender ships."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...core.base import denoise
from ..read.passes import CATCHER_PASS

if TYPE_CHECKING:
    from ...core.base.arrays import F32
    from ...core.structures.settings import RenderSettings

FEATURES = ("Denoising Albedo", "Normal")
"""Passes that guide the denoiser, by their native names."""

FOLDERS = ("lib", "blender.shared")
"""Where Blender keeps its libraries, beside the folder of its scripts: the second on Windows."""


def with_features(passes: tuple[str, ...], integrator: str) -> tuple[str, ...]:
    """The passes of a picture that is to be denoised. Ambient occlusion has no albedo, and so no features."""
    return passes if integrator == "ao" else (*passes, *(name for name in FEATURES if name not in passes))


def apply(
    buffers: Mapping[str, F32], settings: RenderSettings, keep_going: Callable[[], bool], *, shadows: bool = False
) -> None:
    """Remove the noise of the flat pass Combined, in place. Raises denoise.DenoiseError.

    buffers: the passes by their native names, with those of `with_features`. shadows: whether there are catchers, whose
    noise is in the alpha of a transparent film or in their pass; otherwise alpha stays.
    """
    home = Path(bpy.utils.resource_path("LOCAL")).parent
    library = denoise.load(home / name for name in FOLDERS)
    width, height = settings.size
    combined = buffers["Combined"].reshape(height, width, 4)
    features = {} if settings.integrator == "ao" else {name: buffers[name] for name in FEATURES}
    albedo, normal = (features[name].reshape(height, width, 3) if features else None for name in FEATURES)

    def clean(picture: F32, **guides: F32 | None) -> F32:
        return denoise.denoise(library, picture, **guides, threads=settings.threads, keep_going=keep_going)

    combined[..., :3] = clean(combined[..., :3], albedo=albedo, normal=normal)
    if not shadows:
        return
    shadow = buffers.get(CATCHER_PASS.name)
    if shadow is not None:
        picture = shadow.reshape(height, width, 3)
        picture[:] = clean(picture, albedo=None, normal=None)
    elif settings.film_transparent:
        alpha = np.repeat(combined[..., 3:], 3, axis=2)
        combined[..., 3] = np.clip(clean(alpha, albedo=None, normal=None).mean(axis=2), 0, 1)

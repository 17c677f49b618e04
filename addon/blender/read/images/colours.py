# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of colours into the working space, by the configuration of Blender's own OpenColorIO."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..bundled import bundled
from .numbers import Memory

if TYPE_CHECKING:
    from numpy.typing import NDArray

RAW, SRGB = "(raw)", "(decoded)"
"""Kinds of spaces: numbers are used unchanged, or are sRGB's in the working space, which are decoded after
interpolation. All others keep their names, sRGB too where the working space has other primaries.
"""

PROBES = np.float32([[0, 0, 0], [1, 1, 1], [0.04, 0.02, 0.5], [0.2, 0.7, 0.4], [0.9, 0.1, 0.3]])
"""Colours by which the two frequent conversions are told from others."""

NEAR = 1e-4


def kind(space: str) -> str:
    """RAW, SRGB, or the name of a space to be converted. Raises Unsupported without the module PyOpenColorIO."""
    if space in ("Non-Color", "scene_linear"):
        return RAW
    config = bundled("PyOpenColorIO").GetCurrentConfig()
    known = config.getColorSpace(space)
    if known is None or known.isData():
        return RAW
    found = _converted(PROBES.copy(), space)
    if np.allclose(found, PROBES, atol=NEAR):
        return RAW
    if np.allclose(found, decoded(PROBES), atol=NEAR):
        return SRGB
    return space


def decoded(colours: NDArray[Any]) -> NDArray[Any]:
    """sRGB's transfer function, from encoded to linear."""
    curve = (np.maximum(colours, 0.04045) + 0.055) / 1.055
    return np.where(colours <= 0.04045, np.maximum(colours, 0) / 12.92, curve**2.4)


def converted(pixels: NDArray[Any], space: str, *, divided: bool) -> Memory:
    """(h, w, 1, 3 or 4) numbers of any type in the working space: float16, as in Cycles, or float32 if they were that.
    divided: whether colours contain alpha, which is taken out for the conversion: it is not proportional to light.
    """
    wide = np.dtype(np.float32 if pixels.dtype == np.float32 else np.float16)
    memory = Memory(pixels.shape, wide)
    out = memory.pixels
    scale = np.float32(1 if pixels.dtype.kind == "f" else 1 / np.iinfo(pixels.dtype).max)
    # Rows in groups, to hold few numbers in single precision.
    step = max(1, (1 << 18) // max(1, pixels.shape[1]))
    for first in range(0, len(pixels), step):
        rows = pixels[first : first + step].astype(np.float32) * scale
        if pixels.shape[2] == 1:
            grey = _converted(np.repeat(rows, 3, axis=2).reshape(-1, 3), space)
            out[first : first + step] = _bounded(grey.mean(axis=1), wide).reshape(rows.shape)
            continue
        colours, alpha = rows[..., :3], rows[..., 3:]
        partial = (alpha != 0) & (alpha != 1) & divided
        if partial.any():
            np.divide(colours, alpha, out=colours, where=partial)
        found = _converted(np.ascontiguousarray(colours).reshape(-1, 3), space).reshape(colours.shape)
        if partial.any():
            np.multiply(found, alpha, out=found, where=partial)
        out[first : first + step, :, :3] = _bounded(found, wide)
        out[first : first + step, :, 3:] = alpha
    return memory


def _bounded(found: NDArray[Any], wide: np.dtype[Any]) -> NDArray[Any]:
    """Within the range of a type."""
    most = np.finfo(wide).max
    return np.clip(np.nan_to_num(found, copy=False), -most, most)


def _converted(colours: NDArray[Any], space: str) -> NDArray[Any]:
    """(n, 3) float32 colours, changed in place."""
    config = bundled("PyOpenColorIO").GetCurrentConfig()
    # By the role, OpenColorIO would keep its conversion when the file's working space changes.
    working = config.getRoleColorSpace("scene_linear")
    config.getProcessor(space, working).getDefaultCPUProcessor().applyRGB(colours)
    return colours

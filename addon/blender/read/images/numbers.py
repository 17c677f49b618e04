# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of one picture as they are stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Numbers:
    """pixels: (h, w, c) uint8, uint16, float16 or float32, rows from the bottom. linear: whether they are in the
    working space, whatever the image's colour space. multiplied: whether its format has colours multiplied by alpha.
    """

    pixels: NDArray[Any]
    linear: bool = False
    multiplied: bool = False


def associated(image: Any) -> bool:
    """Whether its colours are multiplied by alpha: neither for data, nor if alpha is ignored or channel-packed."""
    return image.alpha_mode in ("STRAIGHT", "PREMUL") and not image.colorspace_settings.is_data


def multiply(pixels: NDArray[Any]) -> None:
    """Multiply the colours of (h, w, 4) pixels by their alpha, in their own type, rounded down as in Cycles."""
    colours, alpha = pixels[..., :3], pixels[..., 3:]
    if pixels.dtype.kind == "f":
        colours *= alpha
        return
    most = np.iinfo(pixels.dtype).max
    # Row by row, because the products need wider numbers.
    for row, share in zip(colours, alpha, strict=True):
        if (share != most).any():
            row[:] = row.astype(np.uint32) * share // most

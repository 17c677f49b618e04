# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of one picture as they are stored."""

from __future__ import annotations

import io
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Memory:
    """Zeros that are written through `pixels`, and then shared with the native module without a copy."""

    def __init__(self, shape: tuple[int, ...], dtype: Any) -> None:
        # A BytesIO takes over bytes that nothing else refers to, and returns the same object in the end.
        self._memory = io.BytesIO(bytes(prod(shape) * np.dtype(dtype).itemsize))
        self.pixels: NDArray[Any] = np.ndarray(shape, dtype, buffer=self._memory.getbuffer())

    @classmethod
    def of(cls, pixels: NDArray[Any], dtype: Any = None) -> Memory:
        """A copy of these numbers, of the same type or another one."""
        made = cls(pixels.shape, pixels.dtype if dtype is None else dtype)
        made.pixels[...] = pixels
        return made

    def shared(self) -> NDArray[Any]:
        """The pixels as an array over a `bytes` object; nothing may be written any more."""
        return np.ndarray(self.pixels.shape, self.pixels.dtype, buffer=self._memory.getvalue())


@dataclass(frozen=True, eq=False)
class Numbers:
    """memory: (h, w, 1 to 4) uint8, uint16, float16 or float32, rows from the bottom. linear: whether they are in the
    working space, whatever the image's colour space. multiplied: whether its format has colours multiplied by alpha.
    """

    memory: Memory
    linear: bool = False
    multiplied: bool = False


def associated(image: Any) -> bool:
    """Whether its colours are multiplied by alpha: neither for data, nor if alpha is ignored or channel-packed."""
    return image.alpha_mode in ("STRAIGHT", "PREMUL") and not image.colorspace_settings.is_data


def colourful(memory: Memory, *, opaque: bool = False) -> Memory:
    """The same numbers, a grey as a colour. opaque: without the alpha of a grey."""
    pixels = memory.pixels
    if pixels.shape[2] > 2:
        return memory
    pixels = pixels[..., :1] if opaque else pixels
    wide = Memory((*pixels.shape[:2], pixels.shape[2] + 2), pixels.dtype)
    wide.pixels[..., :3] = pixels[..., :1]
    wide.pixels[..., 3:] = pixels[..., 1:]
    return wide


def halvings(width: int, height: int, most: int) -> int:
    """The power of two by which both sides are divided so that none exceeds `most`."""
    by = 1
    while max(width, height) > most * by:
        by *= 2
    return by


def smaller(memory: Memory, most: int) -> Memory:
    """The texels, as long as a side has more than `most` halved on both sides: means of squares from the bottom left,
    as in Cycles. Rows and columns without a whole square are dropped, unless they are the only ones.
    """
    pixels = memory.pixels
    height, width, channels = pixels.shape
    by = halvings(width, height, most)
    if by == 1:
        return memory
    made = Memory((max(height // by, 1), max(width // by, 1), channels), pixels.dtype)
    whole = slice(made.pixels.shape[1] * by)
    first = np.arange(made.pixels.shape[1]) * by
    for number, out in enumerate(made.pixels):
        rows = pixels[number * by : (number + 1) * by, whole]
        means = np.add.reduceat(rows.sum(axis=0, dtype=np.float64), first, axis=0) / (len(rows) * min(by, width))
        out[:] = means if pixels.dtype.kind == "f" else np.floor(means + 0.5)
    return made


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

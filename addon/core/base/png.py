# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG files in memory, for pages that contain their pictures."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from .arrays import F32
from .picture_files import PNG


def encoded(picture: F32) -> bytes:
    """A PNG of an (h, w, 3) linear RGB picture, rows from the bottom, as a display shows it (sRGB, 8 bits).

    Values above 1 are white; values that are not finite are black.
    """
    linear = np.nan_to_num(picture[::-1].astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0).clip(0.0, 1.0)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    height, width, _ = shown.shape
    # Each row begins with its filter: 1, differences from the pixel to the left, which compress well.
    bytes_ = np.round(255 * shown).astype(np.uint8)
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 0] = 1
    left = np.concatenate([np.zeros((height, 1, 3), np.uint8), bytes_[:, :-1]], axis=1)
    rows[:, 1:] = (bytes_ - left).reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return PNG + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

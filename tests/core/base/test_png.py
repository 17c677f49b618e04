# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in memory: what a decoder reads is what was encoded."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from addon.core.base import png


def test_a_decoder_reads_the_same_pixels() -> None:
    picture = np.zeros((3, 5, 3), np.float32)
    picture[0, 0] = 1.0, 0.5, 0.0
    picture[2, 4] = 7.0, np.nan, -1.0
    read = np.asarray(Image.open(io.BytesIO(png.encoded(picture))))
    assert read.shape == (3, 5, 3)
    # Rows of pictures begin at the bottom; sRGB of one half is 188.
    assert read[2, 0].tolist() == [255, 188, 0]
    assert read[0, 4].tolist() == [255, 0, 0]
    assert int(read.sum()) == 255 + 188 + 255

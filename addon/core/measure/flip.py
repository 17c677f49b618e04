# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP (Andersson et al. 2020): perceived difference between two pictures viewed in alternation.

0 is no visible difference, 1 the largest possible. Computed by OpenImageIO for a display with 67 pixels per degree;
values above the display's white are clipped first, as the display would clip them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base import picture_files

Image = NDArray[np.float32]

PIXELS_PER_DEGREE = 67.0


def problem() -> str | None:
    """The reason why FLIP cannot be computed here, or None."""
    try:
        known = hasattr(picture_files.module().ImageBufAlgo, "FLIP_diff")
    except ImportError as error:
        return str(error)
    return None if known else "this OpenImageIO is older than 3.2, the first with FLIP"


def mean(picture: Image, reference: Image) -> float | None:
    """Mean FLIP of two (height, width, 3) linear RGB pictures; None if it cannot be computed here."""
    if problem():
        return None
    oiio = picture_files.module()
    shown = [np.ascontiguousarray(np.nan_to_num(one).clip(0.0, 1.0), np.float32) for one in (reference, picture)]
    found = oiio.ImageBufAlgo.FLIP_diff(*map(oiio.ImageBuf, shown), hdr=0, ppd=PIXELS_PER_DEGREE)
    return float(found.spec().getattribute("FLIP:meanerror"))

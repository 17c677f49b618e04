# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP (Andersson et al. 2020): how much of a picture's error a viewer sees who switches between two pictures.

0: nothing, 1: as much as there can be. The authors' own package computes it, for a display at 67 pixels per degree.
Light beyond the display's white is cut off first, as such a display would.
"""

from __future__ import annotations

import importlib.util

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]


def problem() -> str | None:
    """Why FLIP cannot be computed here, or None when it can."""
    return None if importlib.util.find_spec("flip_evaluator") else "flip-evaluator is not installed in this Python"


def mean(picture: Image, reference: Image) -> float | None:
    """Mean FLIP of two pictures, (height, width, 3) linear RGB; None where the package is missing."""
    if problem():
        return None
    import flip_evaluator

    shown = [np.ascontiguousarray(np.nan_to_num(one).clip(0.0, 1.0), np.float32) for one in (reference, picture)]
    _, error, _ = flip_evaluator.evaluate(*shown, "LDR", inputsRGB=False, applyMagma=False)
    return float(error)

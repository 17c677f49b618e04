# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP (Andersson et al. 2020): perceived difference between two pictures viewed in alternation.

0 is no visible difference, 1 the largest possible. Computed by the authors' package for a display with 67 pixels per
degree; values above the display's white are clipped first, as the display would clip them.
"""

from __future__ import annotations

import importlib.util

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]


def problem() -> str | None:
    """The reason why FLIP cannot be computed here, or None."""
    return None if importlib.util.find_spec("flip_evaluator") else "flip-evaluator is not installed in this Python"


def mean(picture: Image, reference: Image) -> float | None:
    """Mean FLIP of two (height, width, 3) linear RGB pictures; None if the package is not installed."""
    if problem():
        return None
    import flip_evaluator

    shown = [np.ascontiguousarray(np.nan_to_num(one).clip(0.0, 1.0), np.float32) for one in (reference, picture)]
    _, error, _ = flip_evaluator.evaluate(*shown, "LDR", inputsRGB=False, applyMagma=False)
    return float(error)

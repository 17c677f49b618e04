# SPDX-License-Identifier: GPL-3.0-or-later
"""A rotation after which no coordinate axis maps to an axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def tilt(about_x: float, about_y: float) -> NDArray[np.float64]:
    """(3, 3) rotation matrix: first by `about_x` about the x axis, then by `about_y` about the y axis,
    both in radians.
    """
    sin, cos = np.sin([about_x, about_y]), np.cos([about_x, about_y])
    first = np.array([[1, 0, 0], [0, cos[0], -sin[0]], [0, sin[0], cos[0]]])
    second = np.array([[cos[1], 0, sin[1]], [0, 1, 0], [-sin[1], 0, cos[1]]])
    both: NDArray[np.float64] = second @ first
    return both

# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of callers, checked before a conversion that would change them silently."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _compiled


def indices(name: str, values: Any) -> npt.NDArray[np.int64]:
    """Rows of three indices: (n, 3) int64. Raises halfspace_native.ShapeError for others and for fractions."""
    array = np.asarray(values)
    if not array.size:
        return np.zeros((0, 3), np.int64)
    if array.ndim == 1 and array.size % 3 == 0:
        array = array.reshape(-1, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise _compiled.module().ShapeError(f"{name}: expected shape (n, 3), got {array.shape}")
    with np.errstate(invalid="ignore"):
        whole: npt.NDArray[np.int64] = np.ascontiguousarray(array, np.int64)
    # The conversion cuts fractions off, and large numbers wrap around.
    changed = np.argwhere(whole != array)
    if array.dtype.kind not in "biuf" or len(changed):
        row = int(changed[0][0]) if len(changed) else 0
        raise _compiled.module().ShapeError(f"{name}[{row}]: expected whole numbers, got {array[row].tolist()}")
    return whole

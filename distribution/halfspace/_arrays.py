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


def numbers(name: str, values: Any) -> npt.NDArray[Any]:
    """An array of float32 or float64 from an array, a list, a number, or a tensor on the CPU (DLPack).

    float16 becomes float32, and every other kind of number float64. Raises halfspace_native.ShapeError.
    """
    array = _array(name, values)
    if array.dtype.kind not in "iuf":
        raise _compiled.module().ShapeError(f"{name}: expected numbers, got {array.dtype}")
    if array.dtype in (np.float32, np.float64):
        return np.asarray(array, array.dtype.newbyteorder("="), order="C")
    return np.asarray(array, np.float32 if array.dtype == np.float16 else np.float64, order="C")


def points(name: str, values: Any) -> npt.NDArray[Any]:
    """Rows of three numbers, (n, 3); one may be (3,). Other shapes are left to the compiled module to refuse."""
    array = numbers(name, values)
    if array.shape == (0,):
        return array.reshape(0, 3)
    return array[None] if array.shape == (3,) else array


def rays(origins: Any, directions: Any) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Origins and directions, (n, 3) each: a single one serves all rays of the other."""
    starts, ways = points("origins", origins), points("directions", directions)
    if starts.shape == (1, 3) and ways.ndim == 2:
        starts = np.ascontiguousarray(np.broadcast_to(starts, (len(ways), 3)))
    elif ways.shape == (1, 3) and starts.ndim == 2:
        ways = np.ascontiguousarray(np.broadcast_to(ways, (len(starts), 3)))
    return starts, ways


def single(name: str, values: Any) -> Any:
    """A number or one per ray; None stays."""
    if values is None:
        return None
    array = numbers(name, values)
    return array if array.ndim else float(array)


def integers(name: str, values: Any, *, wide: bool = False) -> Any:
    """Whole numbers: uint32, with `wide` as they are or int64; None and a number stay. Raises
    halfspace_native.ShapeError.
    """
    if values is None or (isinstance(values, int) and not wide):
        return values
    array = _array(name, values)
    if array.size and array.dtype.kind not in "iu":
        raise _compiled.module().ShapeError(f"{name}: expected whole numbers, got {array.dtype}")
    if wide:
        array = array.reshape(0, 3) if array.shape == (0,) else array
        kept = array.dtype in (np.int32, np.uint32, np.int64)
        return np.ascontiguousarray(array, array.dtype.newbyteorder("=") if kept else np.int64)
    if array.size and not 0 <= int(array.min()) <= int(array.max()) <= 0xFFFFFFFF:
        raise _compiled.module().ShapeError(f"{name}: expected whole numbers of 32 bits")
    return np.ascontiguousarray(array, np.uint32)


def _array(name: str, values: Any) -> npt.NDArray[Any]:
    """The values as an array of NumPy, without a copy where they are one. Raises halfspace_native.ShapeError."""
    try:
        if hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray | np.generic):
            return np.from_dlpack(values)
        return np.asarray(values)
    except (ValueError, TypeError, BufferError, RuntimeError) as error:
        raise _compiled.module().ShapeError(f"{name}: cannot be read as an array: {error}") from error

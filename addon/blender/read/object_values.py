# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of objects and view layers that materials read: the node Object Info, and custom or own properties."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Key = tuple[str, str]
"""The kind of a value, INFO, OBJECT, INSTANCER, PARTICLE, PLACE or GRID, and its name."""

Value = tuple[float, float, float, float]

INFO, OBJECT, INSTANCER = "INFO", "OBJECT", "INSTANCER"

PARTICLE, PLACE = "PARTICLE", "PLACE"
"""Values of the particle at whose place an instance is, and of that place on the instancer."""

GRID, DENSITY_SCALE = "GRID", ""
"""The number of a grid by its name, counted from 1, and the factor on the coefficients of volumes."""

MASK = 0xFFFFFFFF

THIN = 1e-6
"""Thickness of a collapsed axis relative to the width of the sheet."""


SINGULAR = 1e-12
"""Determinant, of columns of unit length, up to which a transform counts as not invertible."""


@dataclass(frozen=True)
class Instance:
    """An evaluated object at one place. parent: its instancer, if any. number: the instance's random number.
    grids: values of the kind GRID. given: those of `instancing.Instancing`.
    """

    item: Any
    parent: Any
    location: tuple[float, ...]
    number: int = 0
    grids: Mapping[str, float] = field(default_factory=lambda: {DENSITY_SCALE: 1.0})
    given: Mapping[Key, Value] = field(default_factory=dict)

    def values(self, keys: Sequence[Key]) -> tuple[Value, ...]:
        """The values of these keys; 0 where there is none."""
        return tuple(self._value(*key) or (0.0, 0.0, 0.0, 0.0) for key in keys)

    def _value(self, kind: str, name: str) -> Value | None:
        item = self.item
        if (kind, name) in self.given:
            return self.given[kind, name]
        if kind in (PARTICLE, PLACE):
            # Objects without a particle have the number 0, which has a random number, too.
            return as_value(hashed(0) / MASK) if (kind, name) == (PARTICLE, "Random") else None
        if kind == GRID:
            return as_value(self.grids.get(name, 0.0))
        if kind == INFO:
            match name:
                case "Location":
                    return as_value(self.location)
                case "Color":
                    # Instances have the colour of their instancer, unlike the index.
                    return as_value((item if self.parent is None else self.parent).color)
                case "Object Index":
                    return as_value(item.pass_index)
            return as_value(self._random())
        parents = [self.parent, self.parent.data] if kind == INSTANCER and self.parent is not None else []
        return found([*parents, item, item.data], name)

    def _random(self) -> float:
        """The random number that Cycles gives an object: by its name, or by the number of an instance."""
        number = self.number if self.parent is not None else hashed(_of_name(self.item.name))
        return number / MASK


def found(owners: Iterable[Any], name: str) -> Value | None:
    """The first custom property of this name, or else own property at this path."""
    for owner in owners:
        if owner is None:
            continue
        value = as_value(owner.get(name))
        if value is None:
            try:
                value = as_value(owner.path_resolve(name))
            except ValueError:
                continue
        if value is not None:
            return value
    return None


def as_value(value: Any) -> Value | None:
    """A number, vector or colour as four numbers; None for anything else, or if it is not finite."""
    if isinstance(value, (bool, int, float)):
        numbers = [float(value)] * 3
    else:
        try:
            numbers = [float(x) for x in value]
        except (TypeError, ValueError):
            return None
    # Numbers beyond f32 are infinite in the native module.
    if len(numbers) not in (3, 4) or not np.abs(numbers).max() <= np.finfo(np.float32).max:
        return None
    r, g, b, a = (*numbers, 1.0)[:4]
    return (r, g, b, a)


def _of_name(name: str) -> int:
    number = 0
    for byte in name.encode():
        number = (number * 37 + (byte if byte < 128 else byte - 256)) & MASK
    return number


def hashed(x: Any, y: int = 0) -> Any:
    """Jenkins' lookup3 of two words (2006): its final mix. `x`: a word, or an int64 array of them."""
    a: Any
    a = b = c = 0xDEADBEEF + (2 << 2) + 13
    b, a = (b + y) & MASK, (a + x) & MASK

    def turned(word: Any, by: int) -> Any:
        return (word << by | word >> 32 - by) & MASK

    c = ((c ^ b) - turned(b, 14)) & MASK
    a = ((a ^ c) - turned(c, 11)) & MASK
    b = ((b ^ a) - turned(a, 25)) & MASK
    c = ((c ^ b) - turned(b, 16)) & MASK
    a = ((a ^ c) - turned(c, 4)) & MASK
    b = ((b ^ a) - turned(a, 14)) & MASK
    return ((c ^ b) - turned(b, 24)) & MASK


def as_sheet(matrix: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
    """An invertible transform: one that collapses one axis becomes a thin sheet; None if it collapses two."""
    if is_regular(matrix):
        return matrix
    turned, lengths, axes = np.linalg.svd(matrix[:3, :3])
    if lengths[1] <= THIN * lengths[0]:
        return None
    lengths[2] = THIN * lengths[1]
    if np.linalg.det(turned) * np.linalg.det(axes) < 0:
        turned[:, 2] *= -1  # keep the orientation of its faces
    sheet = matrix.copy()
    sheet[:3, :3] = turned * lengths @ axes
    return sheet


def are_regular(matrices: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Whether each of (k, 4, 4) transforms is finite and `is_regular`, (k,)."""
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    good = np.isfinite(matrices).all(axis=(1, 2)) & lengths.all(axis=1)
    good[good] = np.abs(np.linalg.det(linear[good] / lengths[good, None])) > SINGULAR
    return good


def is_regular(matrix: np.ndarray[Any, Any]) -> bool:
    """Whether a finite transform is invertible, judged by its determinant relative to the lengths of its columns."""
    # Written out: NumPy takes ten times as long for one small matrix (measured).
    (a, b, c), (d, e, f), (g, h, i) = matrix[:3, :3].tolist()
    lengths = math.hypot(a, d, g) * math.hypot(b, e, h) * math.hypot(c, f, i)
    volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return bool(abs(volume) > SINGULAR * lengths)

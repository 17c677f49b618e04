# SPDX-License-Identifier: GPL-3.0-or-later
"""Deep equality of scenes and their parts, because `==` fails on dataclasses that hold arrays."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

PLAIN = (float, int, str)
"""Types without parts, of which scenes hold most: they are compared first."""


def same(a: Any, b: Any) -> bool:
    """Whether two values have the same type and content; -0.0 equals 0.0, and NaN equals NaN.

    Fields with `compare=False` in a dataclass are skipped.
    """
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, PLAIN):
        return bool(a == b)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if is_dataclass(a):
        return all(same(getattr(a, name), getattr(b, name)) for name in _compared(a))
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    return bool(a == b)


_COMPARED: dict[Any, tuple[str, ...]] = {}
"""The names of the fields that are compared, by dataclass: to list them for each object takes most of the time."""


def _compared(item: Any) -> tuple[str, ...]:
    """The names of a dataclass's fields that are compared."""
    names = _COMPARED.get(type(item))
    if names is None:
        names = _COMPARED[type(item)] = tuple(field.name for field in fields(item) if field.compare)
    return names

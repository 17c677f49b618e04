# SPDX-License-Identifier: GPL-3.0-or-later
"""The module `halfspace.bvhtree` of the Python package, by its file, and a judge of its answers in fractions."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from scripts.dev import foreign_tests

FILE = foreign_tests.CLASSES / "bvhtree.py"

Vector = tuple[Fraction, ...]


def load() -> Any:
    """The module, executed anew."""
    foreign_tests.package()
    spec = importlib.util.spec_from_file_location("halfspace.bvhtree", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def squared_distance(point: Any, corners: Any) -> Fraction:
    """The exact squared distance of a point from a triangle, which may have no area."""
    p, *rest = [tuple(Fraction(float(x)) for x in one) for one in (point, *corners)]
    return min(_dot(away, away) for away in _away(p, rest))


def _away(p: Vector, corners: list[Vector]) -> Iterator[Vector]:
    """The vectors to the corners, to the feet on the edges and to the foot on the plane, as far as they lie inside."""
    yield from (_minus(corner, p) for corner in corners)
    for a, b in itertools.combinations(corners, 2):
        side = _minus(b, a)
        length = _dot(side, side)
        along = _dot(_minus(p, a), side)
        if 0 < along < length:
            yield _minus(tuple(x + along / length * d for x, d in zip(a, side, strict=True)), p)
    a, u, v = corners[0], _minus(corners[1], corners[0]), _minus(corners[2], corners[0])
    normal = _cross(u, v)
    square = _dot(normal, normal)
    if square:
        height = _dot(_minus(a, p), normal)
        foot = tuple(x + height / square * n for x, n in zip(p, normal, strict=True))
        turns = [_dot(normal, _cross(_minus(to, start), _minus(foot, start))) for start, to in _edges(corners)]
        if min(turns) >= 0:
            yield _minus(foot, p)


def _edges(corners: list[Vector]) -> Iterator[tuple[Vector, Vector]]:
    yield from itertools.pairwise([*corners, corners[0]])


def _minus(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _dot(a: Vector, b: Vector) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])

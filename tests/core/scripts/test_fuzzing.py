# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of every kind end in an answer or a documented error; exact answers are those of Python's own fractions."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from typing import Any

import halfspace_native
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

DOCUMENTED = (halfspace_native.ShapeError, halfspace_native.NonFiniteError, halfspace_native.SpecError)
STRUCTURES = halfspace_native.structures()
QUIET = settings(max_examples=150, suppress_health_check=list(HealthCheck))

shapes = st.one_of(st.tuples(st.integers(0, 9), st.just(3)), hnp.array_shapes(min_dims=0, max_dims=3, max_side=4))
dtypes = st.sampled_from(["f4", "f8", "f2", "i4", "u4", "i8", "u1", "?", ">f4", "c8", "S3", "O"])
anything = st.one_of(
    dtypes.filter(lambda d: d != "O").flatmap(lambda dtype: hnp.arrays(dtype, shapes)),
    st.none(),
    st.lists(st.integers(-2, 9), max_size=3),
    st.text(max_size=3),
)
"""Values that a caller might pass for an array."""

few = st.one_of(st.integers(-8, 8).map(float), st.integers(-16, 16).map(lambda x: x / 8))
wild = st.floats(width=32, allow_nan=False, allow_infinity=False)
number = st.one_of(few, few, st.floats(-1, 1, width=32), wild)


@QUIET
@given(vertices=anything, triangles=anything, spec=st.one_of(st.just("kd"), st.text(max_size=12)))
def test_build_answers_or_says_why_not(vertices: Any, triangles: Any, spec: str) -> None:
    try:
        structure = halfspace_native.build(vertices, triangles, spec)
    except DOCUMENTED:
        pass
    else:
        assert structure.validate() == []


@QUIET
@given(
    origins=anything, directions=anything, t_min=anything, t_max=anything, order=st.sampled_from(["none", "tile8", "x"])
)
def test_rays_answer_or_say_why_not(origins: Any, directions: Any, t_min: Any, t_max: Any, order: str) -> None:
    corners = np.eye(3, dtype=np.float32)
    structure = halfspace_native.build(corners, np.array([[0, 1, 2]], np.int32))
    for ask in (structure.closest, structure.occluded):
        with suppress(*DOCUMENTED):
            ask(origins, directions, t_min, t_max, order=order)
    with suppress(*DOCUMENTED):
        halfspace_native.exact_closest(corners, np.array([[0, 1, 2]]), origins, directions, t_min, t_max)


def fractions(values: Any) -> list[Fraction]:
    return [Fraction(float(x)) for x in values]


def determinant(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def distance(corners: Any, origin: Any, direction: Any) -> Fraction | None:
    """The third opinion: where the line meets the closed triangle, in rationals, None where it does not."""
    o, d = fractions(origin), fractions(direction)
    a, b, c = ([x - y for x, y in zip(fractions(corner), o, strict=True)] for corner in corners)
    weights = [determinant(d, b, c), determinant(d, c, a), determinant(d, a, b)]
    total = sum(weights)
    if total == 0 or any(w * total < 0 for w in weights):
        return None
    return determinant(a, b, c) / total


def neighbours(t: np.float32) -> tuple[Fraction, Fraction]:
    """The numbers that round to t lie between these, ends included at most."""
    below, above = np.nextafter(t, np.float32(-np.inf)), np.nextafter(t, np.float32(np.inf))
    exact = Fraction(float(t))
    return (exact + Fraction(float(below))) / 2, (exact + Fraction(float(above))) / 2


@QUIET
@given(
    corners=hnp.arrays(np.float32, st.tuples(st.integers(1, 4), st.just(3), st.just(3)), elements=number),
    rays=hnp.arrays(np.float32, st.tuples(st.integers(1, 8), st.just(2), st.just(3)), elements=number),
    aim=st.booleans(),
)
def test_exact_means_what_fractions_say(corners: Any, rays: Any, aim: bool) -> None:
    origins, directions = rays[:, 0].copy(), rays[:, 1].copy()
    if aim:
        # At corners and edge midpoints.
        with np.errstate(over="ignore", invalid="ignore"):
            targets = [
                corners[0][i % 3] * np.float32(0.5) + corners[0][i % 2] * np.float32(0.5) for i in range(len(rays))
            ]
            directions = np.array(targets, np.float32) - origins
        if not np.isfinite(directions).all():
            return
    vertices = np.ascontiguousarray(corners.reshape(-1, 3))
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    answers = [halfspace_native.exact_closest(vertices, triangles, origins, directions)]
    answers += [
        halfspace_native.build(vertices, triangles, row["id"]).closest(origins, directions) for row in STRUCTURES
    ]
    for i in range(len(rays)):
        exact = [distance(triangle, origins[i], directions[i]) for triangle in corners]
        # A tiny negative distance rounds to zero, and zero counts.
        limit = Fraction(-1, 2**150)
        hits = {k: t for k, t in enumerate(exact) if t is not None and limit <= t < Fraction(2**128 - 2**103)}
        for answer in answers:
            t, triangle = answer.t[i], int(answer.triangle[i])
            if triangle < 0:
                assert not hits
                continue
            assert triangle in hits
            low, high = neighbours(t) if t < np.finfo(np.float32).max else (Fraction(float(t)), Fraction(2**128))
            assert low <= hits[triangle] <= high
            assert all(other >= low for other in hits.values())
            # Of several at the same rounded distance the smallest number.
            assert all(other >= high for k, other in hits.items() if k < triangle)

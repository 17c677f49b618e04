# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing answers: every kind of error is seen, and only where it is."""

from __future__ import annotations

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import accuracy
from addon.core.measure.accuracy import Answers, Errors


def answers(t: list[float], triangle: list[int], u: float = 0.25, v: float = 0.25) -> Answers:
    weights = (np.full(len(t), weight, np.float32) for weight in (u, v))
    return Answers(np.array(t, np.float32), np.array(triangle, np.int32), *weights)


REFERENCE = answers([1.0, 2.0, np.inf, 4.0], [5, 6, -1, 7])


def compare(found: Answers | None, occluded: list[bool] | None = None, *, bitwise: bool = True) -> Errors:
    any_hit = None if occluded is None else np.array(occluded)
    return accuracy.compare(REFERENCE, found, any_hit, halfspace_native.ulp_distance, bitwise=bitwise)


def test_equal_answers_have_no_errors() -> None:
    errors = compare(REFERENCE, [True, True, False, True])
    assert errors.agrees(bitwise=True)
    assert errors.rays == 4
    assert list(errors.ulps) == [0, 0, 0]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (answers([1, np.inf, np.inf, 4], [5, -1, -1, 7]), {"false_miss": 1}),
        (answers([1, 2, 3, 4], [5, 6, 0, 7]), {"false_hit": 1}),
        (answers([1, 2, np.inf, 4], [5, 0, -1, 7]), {"wrong_triangle": 1}),
        (answers([1, 2, np.inf, 4], [5, 6, -1, 7], u=0.26), {"wrong_values": 3}),
    ],
)
def test_each_error_is_counted_once(found: Answers, expected: dict[str, int]) -> None:
    errors = compare(found)
    row = errors.as_row("brute")
    counts = ("false_miss", "false_hit", "wrong_triangle", "wrong_values", "wrong_any_hit")
    assert {name: row[name] for name in counts if row[name]} == expected
    assert not errors.agrees(bitwise=True)


def test_a_last_bit_counts_only_bitwise() -> None:
    found = answers([1.0, float(np.nextafter(np.float32(2), np.float32(3))), np.inf, 4.0], [5, 6, -1, 7])
    errors = compare(found)
    assert errors.as_row("brute")["t_ulp_max"] == 1
    assert not errors.agrees(bitwise=True)
    assert errors.agrees(bitwise=False)


def test_a_tie_is_an_error_only_bitwise() -> None:
    found = answers([1.0, 2.0, np.inf, 4.0], [5, 0, -1, 7])
    assert compare(found).wrong_triangle == 1
    assert compare(found, bitwise=False).wrong_triangle == 0
    far = answers([1.0, 2.1, np.inf, 4.0], [5, 0, -1, 7])
    assert compare(far, bitwise=False).wrong_triangle == 1


def test_any_hits_are_compared_too_and_a_ray_wrong_in_both_questions_counts_once() -> None:
    errors = compare(None, [True, False, True, True])
    assert (errors.false_miss, errors.false_hit, errors.wrong_any_hit) == (1, 1, 2)
    assert compare(answers([1, np.inf, np.inf, 4], [5, -1, -1, 7]), [True, False, False, True]).false_miss == 1


def test_a_ray_that_differs_in_anything_counts_once() -> None:
    later = np.nextafter(np.float32(1), np.float32(2))
    assert compare(answers([later, 2, np.inf, 4], [5, 6, -1, 7])).wrong == 1
    # One float off, another triangle, a hit that is none, a hit lost; and two any hits of the same rays.
    every = compare(answers([later, 2, 3, np.inf], [5, 0, 1, -1]), [False, True, True, True])
    assert every.wrong == 4
    assert every.wrong < every.false_miss + every.false_hit + every.wrong_triangle + every.wrong_any_hit
    assert compare(answers([later, 2, np.inf, 4], [5, 6, -1, 7], u=0.26), bitwise=False).wrong == 0
    assert accuracy.total([every, every]).as_row("brute")["wrong"] == 8


def test_a_hit_on_an_edge_is_on_the_boundary() -> None:
    assert list(answers([1.0, np.inf], [0, -1], u=0.0).boundary()) == [True, False]
    assert list(answers([1.0], [0], u=0.5, v=0.5).boundary()) == [True]
    assert not REFERENCE.boundary().any()
    told = Answers(REFERENCE.t, REFERENCE.triangle, REFERENCE.u, REFERENCE.v, np.array([True, False, False, False]))
    assert told.boundary().sum() == 1


def test_totals_add_up_and_keep_the_largest() -> None:
    parts = [Errors(rays=10, false_miss=1, ulps=np.array([0, 3])), Errors(rays=5, false_hit=2, ulps=np.array([7]))]
    row = accuracy.total(parts).as_row("exact")
    assert (row["rays"], row["false_miss"], row["false_hit"], row["t_ulp_max"]) == (15, 1, 2, 7)
    assert accuracy.total([]).as_row("brute")["t_ulp_max"] == 0


def test_the_999th_permille_is_a_distance_that_occurs() -> None:
    row = Errors(rays=2000, ulps=np.array([0] * 1990 + [8] * 10)).as_row("brute")
    assert row["t_ulp_p999"] == 8
    assert Errors(rays=2000, ulps=np.array([0] * 1999 + [8])).as_row("brute")["t_ulp_p999"] == 0

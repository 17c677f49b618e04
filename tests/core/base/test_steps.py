# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps that are taken one at a time, or all at once."""

from __future__ import annotations

import math

import pytest

from addon.core.base.steps import Steps, Stepwise, completed


def counting(done: list[int], count: int) -> Steps[str]:
    """Note each of `count` steps; the last one fails if there are more than two."""
    for number in range(count):
        done.append(number)
        if number == 2:
            raise ValueError("three are too many")
        yield
    return "all"


@pytest.mark.parametrize(("seconds", "calls"), [(0.0, 3), (math.inf, 1)])
def test_a_slice_is_at_least_one_step(seconds: float, calls: int) -> None:
    done: list[int] = []
    work = Stepwise(counting(done, 2))
    assert [work.advance(seconds) for _ in range(calls)] == [False] * (calls - 1) + [True]
    assert (done, work.result, work.ended, work.advance(0.0)) == ([0, 1], "all", True, True)


def test_a_failure_reaches_the_caller() -> None:
    with pytest.raises(ValueError, match="too many"):
        completed(counting([], 3))
    work = Stepwise(counting([], 3))
    with pytest.raises(ValueError, match="too many"):
        work.advance(math.inf)


def test_closed_work_drops_what_it_holds() -> None:
    released: list[str] = []

    def holding() -> Steps[None]:
        try:
            yield
        finally:
            released.append("held")

    work = Stepwise(holding())
    work.advance(0.0)
    work.close()
    assert released == ["held"]

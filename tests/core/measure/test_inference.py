# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals of medians and Student's distribution."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.measure import inference, rows


def test_student_s_distribution_is_that_of_the_tables() -> None:
    limits = {1: 12.706, 2: 4.303, 6: 2.447, 30: 2.042, 1000: 1.962}
    for freedom, limit in limits.items():
        assert inference.student_quantile(0.95, freedom) == pytest.approx(limit, abs=5e-4)
        assert float(inference.two_sided(limit, freedom)) == pytest.approx(0.05, abs=1e-4)
    assert inference.two_sided(np.array([0.0, 1.0, -1.0]), np.full(3, 1.0)) == pytest.approx([1.0, 0.5, 0.5])


@pytest.mark.parametrize("count", [6, 7, 10, 20])
def test_intervals_hold_the_median_in_at_least_95_percent(count: int) -> None:
    random = np.random.default_rng(count)
    found = [inference.interval(random.lognormal(0.0, 0.3, count)) for _ in range(1000)]
    assert np.mean([low <= 1.0 <= high for low, high in filter(None, found)]) >= 0.94


def test_few_rounds_have_no_interval() -> None:
    assert inference.interval([1.0] * 5) is None
    assert rows.spread([3.0, 1.0, 2.0]) == {"min": 1.0, "med": 2.0, "max": 3.0}
    found = rows.spread(np.linspace(1.0, 2.0, 40))
    assert found["min"] < found["low"] < found["med"] < found["high"] < found["max"]
    assert inference.half_width(1.9, 2.1) == pytest.approx(0.05)

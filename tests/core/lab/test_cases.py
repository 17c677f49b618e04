# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations of kd-tree traversals in each case of ray and plane."""

from __future__ import annotations

from addon.lab.claims import cases


def test_operations_are_weighted_by_the_cases() -> None:
    counters = dict.fromkeys(cases.CASES, 0.0) | {"case_n4": 1.0, "case_p3": 2.0, "case_n1": 1.0}
    assert cases.histogram(counters)["case_p3"] == 0.5
    found = cases.means(counters)
    assert found["ta-b"] == (2.0, 0.75, 0.5, 0.25)
    assert found["sung"] == (0.25 * 4 + 0.5 * 2 + 0.25 * 3, 1.0, 0.0, 1.0)
    assert found["arvo"] == (found["sung"].comparisons, 1.0, 1.0, 0.0)
    assert found["ta-b"].arithmetic == 1.5
    assert cases.histogram(dict.fromkeys(cases.CASES, 0.0)) == {}
    assert cases.means(dict.fromkeys(cases.CASES, 0.0))["ta-b"].comparisons == 0


def test_the_histogram_has_a_bar_for_each_case_of_each_scene() -> None:
    shares = dict.fromkeys(cases.CASES, 0.0) | {"case_n4": 0.25, "case_z3": 0.75}
    chart = cases.chart("best", {"one": shares, "two": {}})
    assert chart.bars
    assert [height for _, height in chart.lines["one"]][3::9] == [25.0, 75.0]
    assert {height for _, height in chart.lines["two"]} == {0.0}

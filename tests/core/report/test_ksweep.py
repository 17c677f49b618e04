# SPDX-License-Identifier: GPL-3.0-or-later
"""Medians of sweeps are over seeds, and over nothing else."""

from __future__ import annotations

from typing import Any

import pytest
from report_rows import everything

from addon.core.measure import thesis
from addon.core.report import ksweep, plots


def swept(*configurations: tuple[str, float]) -> list[dict[str, Any]]:
    """A kd-tree, and each of these configurations (with how slow it is) with two k and two seeds."""
    rows = [everything("kd-sah", 1.0)]
    for spec, slowness in configurations:
        for k in (3, 4):
            rows += [everything(f"{spec}k={k},seed={seed}", slowness, k) for seed in (1, 2)]
    return rows


def test_configurations_of_one_structure_are_not_taken_for_seeds() -> None:
    rows = swept(("bsp-wn:alpha=0.1,", 2.0), ("bsp-wn:alpha=1,", 4.0), ("bsp-cn:alpha=1,", 3.0))
    _, lines = ksweep.lines(rows)
    assert {line.label: line.median for line in lines} == {
        "bsp-wn:alpha=0.1": pytest.approx((200.0, 200.0)),
        "bsp-wn:alpha=1": pytest.approx((400.0, 400.0)),
        "bsp-cn": pytest.approx((300.0, 300.0)),
    }
    *by_k, comparison = thesis.tables({"room": rows}, None)
    assert [table.title for table in by_k] == [
        "Table 5.4: time of bsp-wn:alpha=0.1 by K",
        "Table 5.4: time of bsp-wn:alpha=1 by K",
        "Table 5.7: time of bsp-cn by K",
    ]
    times = {name: cells[0][0][0] for name, cells in comparison.lines}
    assert times == pytest.approx({"kd-sah": 100, "bsp-wn:alpha=0.1": 200, "bsp-wn:alpha=1": 400, "bsp-cn": 300})


def test_configurations_are_called_by_what_they_have_otherwise() -> None:
    rows = swept(("bsp-wn:alpha=0.1,costs=thesis,", 2.0), ("bsp-wn:costs=thesis,", 3.0), ("bsp-cn:costs=thesis,", 4.0))
    assert [line.label for line in ksweep.lines(rows)[1]] == ["bsp-wn:alpha=0.1", "bsp-wn", "bsp-cn"]


@pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))
def test_many_lines_leave_room_for_the_plot() -> None:
    def height(count: int) -> float:
        rows = swept(*((f"bsp-wn:alpha={number},", 2.0) for number in range(count)))
        (picture,) = (one for one in plots.scene_figures(rows) if one.title == "How many directions")
        return float(picture.svg.partition('height="')[2].partition("pt")[0])

    assert height(40) > height(2) + 72

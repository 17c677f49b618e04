# SPDX-License-Identifier: GPL-3.0-or-later
"""Events that processor and system count while rays are traced."""

from __future__ import annotations

import re
import sys
import threading
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import benchmark, processor
from addon.core.report import page
from addon.core.scene import grid

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts events")

SOFTWARE = ("page_faults", "task_clock")
"""Events that the system counts on any machine."""

REFUSALS = (
    r"(the system does not permit to count|the processor, or the virtual machine, has no counter of) cache misses"
)


def touch() -> None:
    np.ones(1 << 23).sum()


def in_a_thread() -> None:
    worker = threading.Thread(target=touch)
    worker.start()
    worker.join()


@linux
@pytest.mark.parametrize("work", [touch, in_a_thread])
def test_events_of_all_threads_are_counted(work: Any) -> None:
    most, least = (halfspace_native.count_events(some, SOFTWARE) for some in (work, lambda: None))
    assert list(most) == list(SOFTWARE)
    # 64 MB in pages of 4 kB or, where the system makes them large, of 2 MB.
    assert most["page_faults"] > least["page_faults"] + 10
    assert most["task_clock"] > 1e6 > least["task_clock"]


@linux
def test_errors_are_passed_on() -> None:
    with pytest.raises(ZeroDivisionError):
        halfspace_native.count_events(lambda: 1 / 0, ["task_clock"])
    with pytest.raises(ValueError, match=r"^names: expected some of cache_misses, .* got \"joules\"$"):
        halfspace_native.count_events(touch, ["joules"])


def test_cache_misses_are_counted_or_a_sentence_says_why_not() -> None:
    rows = measured()
    refusal = processor.refusal(halfspace_native)
    if refusal is None:
        assert all(rows[0]["rays"]["primary"]["events"][name] > 0 for name in processor.NAMES)
        return
    assert re.match(REFUSALS, refusal) or sys.platform != "linux"
    assert "events" not in rows[0]["rays"]["primary"]
    titles = [column.title for column in page._columns(rows, ["primary"])]
    # A report of rows that have them, from another machine, has a column.
    rows[0]["rays"]["primary"]["events"] = {"cache_misses": 1.5}
    assert [column.title for column in page._columns(rows, ["primary"]) if column.title not in titles] == ["misses"]


@linux
def test_a_row_has_the_events_of_a_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processor, "NAMES", SOFTWARE)
    (row,) = measured()
    for name in ("primary", "shadow"):
        one = row["rays"][name]
        # The clock of a pass is that of its time, about.
        nanoseconds = 1e3 / one["mrays_s"]["med"]
        assert 0.2 * nanoseconds < one["events"]["task_clock"] < 50 * nanoseconds


def measured() -> list[Any]:
    options = benchmark.Options(size=(64, 64), sets=("primary", "shadow"), repeats=1, check_rays=64)
    return list(benchmark.measure(halfspace_native, grid.workload(2, 64), ["kd"], options, lambda _: None))

# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report says of wrong answers far from the origin."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest
from report_rows import everything

from addon.core.report import plots, report


@pytest.mark.skipif(plots.problem() is not None, reason=str(plots.problem()))
def test_a_walk_without_bounds_is_not_drawn_among_those_with_them() -> None:
    rows = [everything("kd", 1.0), everything("octree-net", 1.0), everything("kd:robust=none", 1.0)]
    for entry in rows[2]["offsets"]:
        entry.update(wrong=50, wrong_unguarded=None)

    def drawn(*some: dict[str, Any]) -> list[str]:
        (picture,) = (one for one in plots.scene_figures(some) if one.title.startswith("Wrong answers far"))
        return [text.strip() for text in ET.fromstring(picture.svg).itertext()]

    assert "with bounds: all 2" in drawn(*rows)
    assert "kd:robust=none" in drawn(*rows)
    assert not [text for text in drawn(rows[2]) if "with bounds" in text]


def test_wrong_answers_on_the_moved_grids_are_told() -> None:
    rows = [everything("kd", 1.0), everything("kd-sah", 1.0)]
    assert not [text for text in report.findings(rows) if "moved away" in text]
    rows[1]["offsets"][2]["wrong"] = 3
    assert [text for text in report.findings(rows) if "moved away" in text and "kd-sah 3 of 100." in text]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Photometric files as tables."""

from __future__ import annotations

import math

import pytest

from addon.core.scene.photometry import CANDELA_TO_WATT, PhotometricError, parse


def text(vertical: tuple[float, ...], horizontal: tuple[float, ...], *, kind: int = 1, factor: float = 1.0) -> str:
    """A file whose values are 1, 2, 3, ..., multiplied by `factor`."""
    count = len(vertical) * len(horizontal)
    head = f"1 -1 {factor} {len(vertical)} {len(horizontal)} {kind} 2 0 0 0 1 1 60"
    rows = [vertical, horizontal, tuple(range(1, count + 1))]
    body = "\n".join(" ".join(map(str, row)) for row in rows)
    return f"IESNA91\n[MANUFAC] nobody\nTILT=NONE\n{head}\n{body}\n"


def degrees(angles: tuple[float, ...]) -> list[int]:
    return [round(math.degrees(angle)) for angle in angles]


def candelas(values: tuple[float, ...]) -> list[int]:
    return [round(value / CANDELA_TO_WATT) for value in values]


def test_a_quarter_is_mirrored_to_the_whole_turn() -> None:
    table = parse(text((0, 90), (0, 45, 90)))
    assert degrees(table.horizontal) == [0, 45, 90, 135, 180, 225, 270, 315, 360]
    assert degrees(table.vertical) == [0, 90]
    rows = [[1, 2], [3, 4], [5, 6], [3, 4], [1, 2], [3, 4], [5, 6], [3, 4], [1, 2]]
    assert candelas(table.values) == [value for row in rows for value in row]


def test_one_plane_and_a_missing_last_angle_are_completed() -> None:
    assert degrees(parse(text((0, 90), (0,))).horizontal) == [0, 360]
    table = parse(text((0, 90), (0, 120, 240)))
    assert degrees(table.horizontal) == [0, 120, 240, 360]
    assert candelas(table.values)[-2:] == [1, 2]


def test_the_types_with_other_axes_are_turned() -> None:
    across = parse(text((0, 45, 90), (0, 90), kind=2))
    assert (degrees(across.horizontal), degrees(across.vertical)) == ([0, 45, 90, 135, 180], [0, 90, 180])
    assert candelas(across.values) == [6, 3, 6, 5, 2, 5, 4, 1, 4, 5, 2, 5, 6, 3, 6]
    cars = parse(text((-90, 0, 90), (0, 45, 90), kind=3))
    assert (degrees(cars.horizontal), degrees(cars.vertical)) == ([90, 135, 180, 225, 270], [0, 90, 180])
    assert candelas(cars.values) == [7, 8, 9, 4, 5, 6, 1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_commas_tilts_and_factors_are_read() -> None:
    tilted = text((0, 90), (0, 360), factor=2.0).replace("TILT=NONE\n", "TILT=INCLUDE\n1\n2\n0 90\n1.0, 0.9\n")
    assert candelas(parse(tilted.replace(" 60\n", ",60\n")).values) == [2, 4, 6, 8]


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ("", "TILT"),
        ("TILT=NONE", "ends early"),
        (text((0, 90), (0, 90), kind=4), "type 4"),
        (text((90, 0), (0, 90)), "vertical"),
        (text((0,), (0, 90)), "vertical"),
        (text((0, 90), (0, 360), factor=math.nan), "not finite"),
        ("TILT=NONE\n1 1 1 60000 60000 1", "ends early"),
        ("TILT=NONE\n1 1 1 60000 60000 1 2 0 0 0 1 1 60", "more than"),
        ("TILT=NONE\n1 1 1 1e300 2 1 2 0 0 0 1 1 60", "angles"),
    ],
)
def test_rejects_wrong_files_with_a_reason(wrong: str, reason: str) -> None:
    with pytest.raises(PhotometricError, match=reason):
        parse(wrong)

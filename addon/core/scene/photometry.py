# SPDX-License-Identifier: GPL-3.0-or-later
"""Photometric files of lights: IES LM-63 text as a table over the sphere of directions.

Angles follow the standard's type C: vertical ones from 0 (straight down) to 180 degrees, horizontal ones from 0 to 360.
Types A and B are turned into it as Cycles does, so that a light looks the same in both engines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

CANDELA_TO_WATT = 4 * math.pi / 177.83
"""Watts of an isotropic light per candela, at the efficacy of the illuminant D65, 177.83 lm/W: Cycles' choice."""

MOST = 1 << 16
"""Largest number of vertical or horizontal angles, and MOST_VALUES that of values."""

MOST_VALUES = 1 << 22

CLOSE = 1e-4
"""Degrees by which equal angles may differ."""

Rows = list[tuple[float, list[float]]]
"""Horizontal angles, each with the values of all vertical angles."""


class PhotometricError(ValueError):
    """A text is not a photometric file. The message gives the reason."""


@dataclass(frozen=True)
class Photometry:
    """Intensities as watts of an isotropic light.

    horizontal, vertical: ascending angles, radians. values: those of all vertical angles, for each horizontal one.
    """

    horizontal: tuple[float, ...]
    vertical: tuple[float, ...]
    values: tuple[float, ...]


def parse(text: str) -> Photometry:
    """The table of a photometric file. Commas count as blanks. Raises PhotometricError."""
    numbers = _numbers(text)
    for _ in range(2):  # lamps, lumens of each
        next(numbers)
    factor = next(numbers)
    counts = [_count(next(numbers)) for _ in range(2)]
    kind = next(numbers)
    for _ in range(4):  # unit, width, length, height
        next(numbers)
    factor *= next(numbers) * next(numbers) * CANDELA_TO_WATT  # ballast, its photometric factor
    next(numbers)  # watts
    if counts[0] * counts[1] > MOST_VALUES:
        raise PhotometricError(f"more than {MOST_VALUES} values")
    vertical, horizontal = ([next(numbers) for _ in range(count)] for count in counts)
    rows = [(angle, [factor * next(numbers) for _ in vertical]) for angle in horizontal]
    # Turn the types of the standard into type C.
    match kind:
        case 1:
            rows = _whole_turn(rows)
        case 2:
            vertical, rows = _turned(vertical, rows)
        case 3:
            vertical, rows = [angle + 90 for angle in vertical], _opposite(rows)
        case _:
            raise PhotometricError(f"photometric type {kind:g}")
    return _checked(vertical, rows)


def _numbers(text: str) -> Iterator[float]:
    """The numbers after the line of the tilt. Raises PhotometricError at the end, and at anything else."""
    lines = text.replace(",", " ").splitlines()
    start = next((k for k, line in enumerate(lines) if line.lstrip().upper().startswith("TILT=")), None)
    if start is None:
        raise PhotometricError("no line TILT=")
    words = iter(" ".join(lines[start + 1 :]).split())

    def number() -> float:
        word = next(words, None)
        if word is None:
            raise PhotometricError("it ends early")
        try:
            value = float(word)
        except ValueError:
            raise PhotometricError(f"{word[:20]!r} is not a number") from None
        if not math.isfinite(value):
            raise PhotometricError("a number is not finite")
        return value

    # The factors of tilted lamps: geometry, count, and two lists.
    if lines[start].upper().split("=", 1)[1].strip().startswith("INCLUDE"):
        number()
        for _ in range(2 * _count(number())):
            number()
    while True:
        yield number()


def _count(number: float) -> int:
    if not 1 <= number <= MOST:
        raise PhotometricError(f"{number:g} angles")
    return int(number)


def _mirrored(rows: Rows, middle: float) -> Rows:
    """Rows and their mirror images about a horizontal angle, where they end."""
    return rows + [(2 * middle - angle, values) for angle, values in rows[-2::-1]]


def _whole_turn(rows: Rows) -> Rows:
    """Rows of type C that cover a whole turn."""
    if abs(rows[0][0] - 90) < CLOSE:
        rows = [(angle - 90, values) for angle, values in rows]
    if len(rows) == 1:
        return [(0.0, rows[0][1]), (360.0, rows[0][1])]
    # A quarter and a half are mirrored.
    for part in (90.0, 180.0):
        if abs(rows[-1][0] - part) < CLOSE:
            rows = _mirrored(rows, part)
    # Some files leave out the last angle, which equals the first.
    gap = 360 - rows[-1][0]
    steps = (rows[-1][0] - rows[-2][0], rows[1][0] - rows[0][0])
    if abs(rows[0][0]) < CLOSE < abs(gap) and any(abs(step - gap) < CLOSE for step in steps):
        rows = [*rows, (360.0, rows[0][1])]
    return rows


def _centred(angles: list[float], columns: list[list[float]]) -> tuple[list[float], list[list[float]]]:
    """Angles from -90 to 90 degrees as 0 to 180; those that begin at 0 are mirrored first."""
    if abs(angles[0]) < CLOSE:
        columns = columns[:0:-1] + columns
        angles = [-angle for angle in angles[:0:-1]] + angles
    return [angle + 90 for angle in angles], columns


def _turned(vertical: list[float], rows: Rows) -> tuple[list[float], Rows]:
    """Vertical angles and rows of type B, whose axis is horizontal: both angles change places."""
    columns = [list(column) for column in zip(*(values for _, values in rows), strict=True)]
    first, columns = _centred(vertical, columns)
    transposed = [list(row) for row in zip(*columns, strict=True)]
    second, transposed = _centred([angle for angle, _ in rows], transposed)
    columns = [list(column) for column in zip(*transposed, strict=True)]
    return second, list(zip(first, columns, strict=True))


def _opposite(rows: Rows) -> Rows:
    """Rows of type A, whose horizontal angles go from 90 down to -90 degrees: as 90 to 270."""
    turned = [(180 - angle, values) for angle, values in reversed(rows)]
    if abs(rows[0][0]) < CLOSE:
        turned += [(180 + angle, values) for angle, values in rows[1:]]
    return turned


def _checked(vertical: Sequence[float], rows: Rows) -> Photometry:
    """The table, if its angles ascend. Raises PhotometricError."""
    horizontal = [angle for angle, _ in rows]
    for name, angles in (("vertical", vertical), ("horizontal", horizontal)):
        if len(angles) < 2 or any(b <= a for a, b in pairwise(angles)):
            raise PhotometricError(f"the {name} angles do not ascend")
    return Photometry(
        tuple(map(math.radians, horizontal)),
        tuple(map(math.radians, vertical)),
        tuple(value for _, values in rows for value in values),
    )

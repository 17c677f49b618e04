# SPDX-License-Identifier: GPL-3.0-or-later
"""Remarks on what a picture omits or approximates, collected while a scene is read and reported once."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

NAMES_SHOWN = 8
"""Largest number of names that a line lists; the others are counted."""

NAMES_IN_A_SENTENCE = 3
"""Largest number of configurations that a sentence names."""


class Notes:
    """Remarks, each with the names of the objects, materials or lights it applies to, in order of appearance."""

    def __init__(self) -> None:
        self._subjects: dict[str, dict[str, int]] = {}

    def add(self, remark: str, name: str, count: int = 1) -> None:
        """Record that `remark` applies to `name`, `count` times."""
        subjects = self._subjects.setdefault(remark, {})
        subjects[name] = subjects.get(name, 0) + count

    def join(self, other: Notes) -> None:
        """Merge other remarks; a name in both keeps the larger count."""
        for remark, subjects in other._subjects.items():
            mine = self._subjects.setdefault(remark, {})
            for name, count in subjects.items():
                mine[name] = max(mine.get(name, 0), count)

    def lines(self) -> list[str]:
        """One line per remark: the remark, then the names, with a count where it applies more than once."""
        return [
            f"{remark}: {some([name if count == 1 else f'{name} ({count})' for name, count in subjects.items()])}"
            for remark, subjects in self._subjects.items()
        ]

    def __bool__(self) -> bool:
        return bool(self._subjects)


def some(names: Sequence[str], most: int = NAMES_SHOWN) -> str:
    """The first `most` names, joined, and the number of the others."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def few(names: Sequence[str]) -> str:
    """As many names as a sentence holds, joined, and the number of the others."""
    return some(names, NAMES_IN_A_SENTENCE)


def meant(word: str, known: Iterable[str]) -> str:
    """The end of a sentence that asks for the known name closest to an unknown one; "" if none is close."""
    close = difflib.get_close_matches(word, known, 1)
    return f"; did you mean {close[0]}?" if close else ""

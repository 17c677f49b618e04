# SPDX-License-Identifier: GPL-3.0-or-later
"""What a picture leaves out or approximates, collected while a scene is read and told to the user once."""

from __future__ import annotations

from collections.abc import Sequence

NAMES_SHOWN = 8
"""A line names at most this many objects, materials or configurations, and counts the rest."""


class Notes:
    """Remarks grouped by what happened, each with the names that it happened to, in order of appearance."""

    def __init__(self) -> None:
        self._subjects: dict[str, dict[str, int]] = {}

    def add(self, remark: str, name: str, count: int = 1) -> None:
        """Record that `remark` is true of the object, material or light `name`, `count` times."""
        subjects = self._subjects.setdefault(remark, {})
        subjects[name] = subjects.get(name, 0) + count

    def join(self, other: Notes) -> None:
        """Take over what is said elsewhere of the same things, each as often as where it is said most."""
        for remark, subjects in other._subjects.items():
            mine = self._subjects.setdefault(remark, {})
            for name, count in subjects.items():
                mine[name] = max(mine.get(name, 0), count)

    def lines(self) -> list[str]:
        """One line per remark: the remark, then the names, with counts where something happened several times."""
        return [
            f"{remark}: {some([name if count == 1 else f'{name} ({count})' for name, count in subjects.items()])}"
            for remark, subjects in self._subjects.items()
        ]

    def __bool__(self) -> bool:
        return bool(self._subjects)


def some(names: Sequence[str]) -> str:
    """The first of many names, and how many others there are."""
    rest = len(names) - NAMES_SHOWN
    return ", ".join(names[:NAMES_SHOWN]) + (f" and {rest} more" if rest > 0 else "")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and names by which passes distinguish objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Identities:
    """Collects them during one pass over the depsgraph's instances, each by the object's full name.

    indices: pass indices other than 0. groups: numbers of light groups, from 1. mattes: names of the object and of its
    topmost parent.
    """

    def __init__(self, group_numbers: Mapping[str, int]) -> None:
        """group_numbers: of the light groups that the picture needs."""
        self.indices: dict[str, float] = {}
        self.groups: dict[str, int] = {}
        self.mattes: dict[str, tuple[str, str]] = {}
        self._group_numbers = group_numbers

    def add(self, item: Any) -> None:
        """Add an object, unless it is known."""
        name = item.name_full  # linked files may contain objects of equal names
        if name in self.mattes:
            return
        if group := self._group_numbers.get(item.lightgroup, 0):
            self.groups[name] = group
        if item.pass_index:
            self.indices[name] = float(item.pass_index)
        top = item
        while top.parent is not None:
            top = top.parent
        self.mattes[name] = item.name, top.name

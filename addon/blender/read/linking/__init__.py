# SPDX-License-Identifier: GPL-3.0-or-later
"""Light linking: the collections of objects that a light shines on, and that cast its shadows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ....core.base.notes import Notes

MOST_SETS = 32
"""Number of different collections that the native module tells apart, plus one for lights without a collection."""

ALL = 0xFFFFFFFF
"""The bits of all sets."""

Pair = tuple[int, int]
"""A light has a set of receivers and a set of blockers."""

Sets = tuple[int, int, int, int]
"""An object has a bit for each set of receivers, and of blockers, that contains it, and as a light the sets of its own
glow.
"""

PLAIN: Sets = (ALL, ALL, 0, 0)
"""The sets of objects where nothing is linked."""


@dataclass(eq=False)
class _Members:
    """The objects that a collection includes or excludes, by their place in memory."""

    included: set[int] = field(default_factory=set)
    excluded: set[int] = field(default_factory=set)

    def have(self, objects: set[int]) -> bool:
        """Whether one of these objects is in the set: all are, if the collection only excludes."""
        return bool(not self.included or objects & self.included) and not objects & self.excluded


class Linking:
    """The collections of all lights of a depsgraph."""

    def __init__(self, depsgraph: Any, notes: Notes) -> None:
        self._notes = notes
        self._numbers: tuple[dict[int, int], dict[int, int]] = ({}, {})
        self._members: tuple[list[_Members], list[_Members]] = ([], [])
        # Number the collections of lamps first, then those of objects that may glow.
        for item in sorted(depsgraph.objects, key=lambda item: item.type != "LIGHT"):
            for kind, collection in enumerate(_collections(item)):
                self._add(kind, collection, item.name_full)

    def of_light(self, item: Any) -> Pair:
        """The sets of a light, or of a glowing object."""
        receivers, blockers = (
            0 if collection is None else numbers.get(_place(collection), 0)
            for numbers, collection in zip(self._numbers, _collections(item), strict=True)
        )
        return receivers, blockers

    def of_object(self, item: Any, parent: Any) -> Sets:
        """The sets that an object is in, or its instancer, and those of its own glow."""
        objects = {_place(one) for one in (item, parent) if one is not None}
        receives, blocks = (
            1 | sum(1 << number for number, members in enumerate(found, 1) if members.have(objects)) if found else ALL
            for found in self._members
        )
        return receives, blocks, *self.of_light(item)

    def _add(self, kind: int, collection: Any, name: str) -> None:
        """Give a collection its number, unless it is known."""
        numbers, members = self._numbers[kind], self._members[kind]
        if collection is None or _place(collection) in numbers:
            return
        if len(members) + 1 >= MOST_SETS:
            self._notes.add(f"More than {MOST_SETS - 1} collections for light linking, the light is not linked", name)
            return
        members.append(_read(collection))
        numbers[_place(collection)] = len(members)


def _collections(item: Any) -> tuple[Any, Any]:
    """The collections of receivers and of blockers, each may be None."""
    linking = item.light_linking
    return linking.receiver_collection, linking.blocker_collection


def _place(data: Any) -> int:
    return int(data.original.as_pointer())


def _read(collection: Any) -> _Members:
    """The members of a collection; the state of a nested one is that of all its objects."""
    members, seen = _Members(), {_place(collection)}
    for item, entry in zip(collection.objects, collection.collection_objects, strict=False):
        _set_of(members, entry).add(_place(item))
    for child, entry in zip(collection.children, collection.collection_children, strict=False):
        left, state = [child], _set_of(members, entry)
        while left:
            one = left.pop()
            if _place(one) not in seen:
                seen.add(_place(one))
                state.update(map(_place, one.objects))
                left += list(one.children)
    return members


def _set_of(members: _Members, entry: Any) -> set[int]:
    return members.excluded if entry.light_linking.link_state == "EXCLUDE" else members.included

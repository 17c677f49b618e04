# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a 3D view has read, as long as they keep their shape: after an edit it reads what has changed."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ...core.base.steps import Steps
from .object_values import Instance

T = TypeVar("T")


@dataclass(frozen=True)
class _Entry:
    """A value that was read, and the objects that it was read for, with all their numbers, see `_owner`."""

    value: Any
    owners: set[Hashable] = field(default_factory=set)
    uids: set[int] = field(default_factory=set)


class Remembered:
    """Values by keys of evaluated data.

    Blender lists the changed objects and data blocks of each evaluation. An address of evaluated data names the same
    data for as long as an object that had it is unchanged; therefore an entry is only valid for such objects.
    """

    def __init__(self) -> None:
        self._entries: dict[Hashable, _Entry] = {}
        self._last: dict[Hashable, _Entry] = {}
        self._changed: set[int] = set()
        self._wanted: Hashable = None
        self._open = False
        """Whether a reading has begun and not ended."""

    def begin(self, depsgraph: Any) -> None:
        """Begin to read the scene after an evaluation."""
        # Forget what the last reading did not ask for. One that was broken off leaves what it did not reach as it was.
        self._last = self._reached() if self._open else self._entries
        self._entries, self._open = {}, True
        self._changed = {one.id.original.session_uid for one in depsgraph.updates if one.is_updated_geometry}

    def want(self, wanted: Hashable) -> None:
        """Forget all if something else was read of each object."""
        if self._wanted != wanted:
            self._last = {}
        self._wanted = wanted

    def end(self) -> None:
        """End a reading that reached everything."""
        self._last, self._open = {}, False

    def of(self, key: Hashable, instance: Instance, read: Callable[[], Steps[T]]) -> Steps[T]:
        """The value read for this key, if the instance's object and its instancer had it and are unchanged; otherwise
        what `read` returns.
        """
        owner, uids = _owner(instance)
        entry = self._entries.get(key)
        if entry is None:
            entry = self._last.get(key)
            if entry is None or owner not in entry.owners or not self._changed.isdisjoint(uids):
                entry = _Entry((yield from read()))
            entry = self._entries[key] = _Entry(entry.value)
        entry.owners.add(owner)
        entry.uids.update(uids)
        return entry.value  # type: ignore[no-any-return]

    def _reached(self) -> dict[Hashable, _Entry]:
        """What a reading that was broken off has read or found unchanged, and what it did not reach and no change
        concerns.
        """
        kept = {key: entry for key, entry in self._last.items() if self._changed.isdisjoint(entry.uids)}
        for key, entry in self._entries.items():
            before = kept.get(key)
            if before is not None and before.value is entry.value:
                entry.owners.update(before.owners)
                entry.uids.update(before.uids)
        return {**kept, **self._entries}


def _owner(instance: Instance) -> tuple[Hashable, list[int]]:
    """The object and its instancer, and the numbers of these and of their data."""
    both = [one.original for one in (instance.item, instance.parent) if one is not None]
    uids = [one.session_uid for one in both]
    data = [one.data.session_uid for one in both if one.data is not None]
    return tuple(uids), uids + data

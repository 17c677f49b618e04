# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a 3D view has read, as long as they keep their shape: after an edit it reads what has changed."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

from .object_values import Instance

T = TypeVar("T")


@dataclass(frozen=True)
class _Entry:
    """A value that was read, and the objects that it was read for, see `_owner`."""

    value: Any
    owners: set[Hashable]


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

    def begin(self, depsgraph: Any, wanted: Hashable) -> None:
        """Begin to read the scene after an evaluation. wanted: what is read of each object."""
        self._changed = {one.id.original.session_uid for one in depsgraph.updates if one.is_updated_geometry}
        # Forget what the last reading did not ask for, and all if something else is wanted.
        self._last = self._entries if self._wanted == wanted else {}
        self._entries, self._wanted = {}, wanted

    def of(self, key: Hashable, instance: Instance, read: Callable[[], T]) -> T:
        """The value read for this key, if the instance's object and its instancer had it and are unchanged; otherwise
        what `read` returns.
        """
        owner, uids = _owner(instance)
        entry = self._entries.get(key)
        if entry is None:
            entry = self._last.get(key)
            if entry is None or owner not in entry.owners or not self._changed.isdisjoint(uids):
                entry = _Entry(read(), set())
            entry = self._entries[key] = _Entry(entry.value, set())
        entry.owners.add(owner)
        return entry.value  # type: ignore[no-any-return]


def _owner(instance: Instance) -> tuple[Hashable, list[int]]:
    """The object and its instancer, and the numbers of these and of their data."""
    both = [one.original for one in (instance.item, instance.parent) if one is not None]
    uids = [one.session_uid for one in both]
    data = [one.data.session_uid for one in both if one.data is not None]
    return tuple(uids), uids + data

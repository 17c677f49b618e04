# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that settings fire when they change. Modules that build or draw listen, so settings import none of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Signal:
    """An ordered list of functions that are called with the `bpy.types.Scene` whose setting changed."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Any], None]] = []

    def connect(self, listener: Callable[[Any], None]) -> None:
        """Call `listener` at each change from now on."""
        self._listeners.append(listener)

    def disconnect(self, listener: Callable[[Any], None]) -> None:
        """Stop calling `listener`. Raises ValueError if it is not connected."""
        self._listeners.remove(listener)

    def fire(self, scene: Any) -> None:
        """Call all listeners, in the order in which they were connected. Raises what one raised, after all ran."""
        faults = []
        for listener in tuple(self._listeners):
            try:
                listener(scene)
            except Exception as error:
                faults.append(error)
        if faults:
            raise faults[0]


structure_changed = Signal()
"""The structure, one of its parameters, or whether it is built without being requested."""

visibility_changed = Signal()
"""Whether the structure is drawn in 3D views."""

look_changed = Signal()
"""How the structure is drawn: parts, depths, style, colours."""

tree_changed = Signal()
"""The structure that was built last, on the main thread."""

node_changed = Signal()
"""The selected node, or whether the objects of its triangles are shown alone."""

range_changed = Signal()
"""The range of a cost map whose pixels keep their colour."""

file_loaded = Signal()
"""The open file, with its active scene; states of scenes of the former file are gone by then."""

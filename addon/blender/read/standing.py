# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that stand still, or keep their shape, while the shutter is open, by their own switches of motion blur."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ...core.base.arrays import F64
from ...core.base.steps import Steps
from ...core.scene.scene import Image

T = TypeVar("T")


class Standing:
    """Places and shapes as they were read first: at the frame. One for all times of a picture."""

    def __init__(self) -> None:
        self._places: dict[Any, F64] = {}
        self._shapes: dict[Any, Any] = {}
        self.images: dict[Any, Image] = {}
        """The images of all times, see `Gallery`."""

    def place(self, item: Any, parent: Any, number: Any, matrix: F64) -> F64:
        """The transform of an instance, (4, 4): that of the frame if it has no motion blur. number: the instance's."""
        if moves(item, parent):
            return matrix
        key = item.name_full, parent and parent.name_full, tuple(number)
        return self._places.setdefault(key, matrix)

    def shape(self, item: Any, parent: Any, data: Any, read: Callable[[], Steps[T]]) -> Steps[T]:
        """The result of `read`; its result at the frame if the object has no deformation motion."""
        if moves(item, parent) and moves(item, parent, "use_deform_motion"):
            return (yield from read())
        key = item.name_full, data.name_full
        if key not in self._shapes:
            self._shapes[key] = yield from read()
        return self._shapes[key]  # type: ignore[no-any-return]


def moves(item: Any, parent: Any = None, switch: str = "use_motion_blur") -> bool:
    """Whether an object and its instancer, with the parents of that, have motion blur. Cycles stores the switches."""
    owners = [item]
    while parent is not None:
        owners.append(parent)
        parent = parent.parent
    return all(getattr(getattr(one, "cycles", None), switch, True) for one in owners)

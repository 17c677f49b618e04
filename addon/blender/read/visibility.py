# SPDX-License-Identifier: GPL-3.0-or-later
"""How rays and linked lights see objects: by the settings of objects, their instancers and their collections."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...core.scene.scene import Hidden
from .linking import Linking, Sets
from .materials import Mask
from .object_values import Instance

RAYS = {
    "camera": "visible_camera",
    "shadow": "visible_shadow",
    "diffuse": "visible_diffuse",
    "glossy": "visible_glossy",
    "transmission": "visible_transmission",
    "volume": "visible_volume_scatter",
    "raycast": "visible_raycast",
}
"""The kinds of rays that an object can be hidden from, with Blender's settings; before 5.1 without the last."""


def hidden_from(item: Any, parent: Any) -> Hidden:
    """The rays that ignore an object; those that its instancer ignores are included."""
    both = [item] if parent is None else [item, parent]
    return tuple(ray for ray, setting in RAYS.items() if not all(getattr(one, setting, True) for one in both))


class Visibility:
    """The visibility of the instances of a view layer."""

    def __init__(self, view_layer: Any, linking: Linking) -> None:
        self._layer, self._linking = view_layer, linking
        self._marked = any(one.holdout or one.indirect_only for one in _collections(view_layer.layer_collection))
        self._known: dict[int, tuple[bool, bool]] = {}

    def of(self, instance: Instance) -> tuple[Hidden, Sets, Mask]:
        """The rays that ignore an instance, its sets of linked lights, and how rays see it.

        It is a holdout as its instancer or its collections are, and a shadow catcher as itself or its instancer is.
        """
        item, parent = instance.item, instance.parent
        owner = item if parent is None else parent
        hole, indirect_only = self._marks(owner)
        hidden = hidden_from(item, parent)
        if indirect_only and "camera" not in hidden:
            hidden = ("camera", *hidden)
        offset = round(item.shadow_terminator_geometry_offset, 6)  # the default is 0.1 in f32
        mask = bool(owner.is_holdout or hole), item.is_shadow_catcher or owner.is_shadow_catcher, offset
        return hidden, self._linking.of_object(item, parent), mask

    def _marks(self, item: Any) -> tuple[bool, bool]:
        """Whether the collections of an evaluated object, not an instance, make it a holdout, or hide it from the
        camera.
        """
        if not self._marked:
            return False, False
        key = item.original.as_pointer()
        if key not in self._known:
            held = item.holdout_get(view_layer=self._layer)
            self._known[key] = held, not held and item.indirect_only_get(view_layer=self._layer)
        return self._known[key]


def _collections(layer_collection: Any) -> Iterator[Any]:
    """A collection and all nested ones in order, without excluded ones."""
    # No recursion: collections may be nested more deeply than Python's call stack allows.
    left = [layer_collection]
    while left:
        one = left.pop()
        if not one.exclude:
            yield one
        left += reversed(list(one.children))

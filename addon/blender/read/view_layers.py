# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view layer says of the scene, beside which collections it shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .passes import PASSES

SETTINGS = {"use_pass_combined", "use_pass_cryptomatte_accurate"}
"""Switches that ask for no pass of their own, or for one that is always there."""

OTHERS = {"pass_debug_sample_count", "pass_render_time", "denoising_store_passes"}
"""Switches of passes of Cycles that are not called as all others are."""


def world(depsgraph: Any) -> Any:
    """The evaluated world that this layer sees, which may be one of its own; None where there is none."""
    # With a default, since not every Blender from 4.5.0 on was at hand to see whether layers have one.
    return getattr(depsgraph.view_layer_eval, "world_override", None) or depsgraph.scene_eval.world


class Marks:
    """What the layer's collections say of objects: left out as holes, or seen only by light."""

    def __init__(self, view_layer: Any) -> None:
        self._layer = view_layer
        self._any = any(one.holdout or one.indirect_only for one in _collections(view_layer.layer_collection))
        self._known: dict[int, tuple[bool, bool]] = {}

    def of(self, item: Any) -> tuple[bool, bool]:
        """Whether an evaluated object, not an instance, is a holdout, and whether the camera does not see it."""
        if not self._any:
            return False, False
        key = item.original.as_pointer()
        if key not in self._known:
            asked = {"view_layer": self._layer}
            held = item.holdout_get(**asked)
            self._known[key] = held, not held and item.indirect_only_get(**asked)
        return self._known[key]


def unknown_passes(view_layer: Any) -> list[str]:
    """The passes that a view layer asks for and that are not rendered, as Blender calls them."""
    known = SETTINGS | {render_pass.switch for render_pass in PASSES if not render_pass.own}
    names = [
        item.name
        for group in (view_layer, getattr(view_layer, "cycles", None))
        if group is not None
        for item in group.bl_rna.properties
        if (item.identifier.startswith("use_pass_") or item.identifier in OTHERS)
        and item.type == "BOOLEAN"
        and item.identifier not in known
        and getattr(group, item.identifier)
    ]
    names += [f"AOV {one.name}" for one in view_layer.aovs]
    return names + [f"Light Group {one.name}" for one in view_layer.lightgroups]


def _collections(layer_collection: Any) -> Iterator[Any]:
    """A collection and all within it in their order, without those that are left out."""
    # No recursion: collections may lie within each other more deeply than Python calls may.
    left = [layer_collection]
    while left:
        one = left.pop()
        if not one.exclude:
            yield one
        left += reversed(list(one.children))

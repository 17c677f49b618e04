# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a view layer other than its visible collections."""

from __future__ import annotations

from typing import Any

from .passes import CATCHER_PASS, MATTES, PASSES, VOLUME_PASSES
from .value_nodes import outputs

SETTINGS = {"use_pass_combined", "use_pass_cryptomatte_accurate"}
"""Switches without a pass of their own, or of the pass that is always present."""

OTHERS = {
    "pass_debug_sample_count",
    "pass_render_time",
    "denoising_store_passes",
    "denoising_store_motion_passes",
}
"""Switches of Cycles's passes whose names lack the usual prefix."""


def world(depsgraph: Any) -> Any:
    """The evaluated world of this layer, which may override the scene's; None without one."""
    # With a default, because versions of Blender after 4.5.0 may lack the property.
    return getattr(depsgraph.view_layer_eval, "world_override", None) or depsgraph.scene_eval.world


def unknown_passes(view_layer: Any) -> list[str]:
    """The enabled passes of a view layer that are not rendered, by their names in Blender."""
    known = SETTINGS | set(MATTES.values()) | {render_pass.switch for render_pass in PASSES if not render_pass.own}
    # The switches of Cycles' add-on have the names of ours, which take their place.
    known |= {one.switch for one in (*VOLUME_PASSES, CATCHER_PASS) if one.wanted(view_layer)}
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
    written = outputs.wanted(view_layer)
    names += [f"AOV {one.name}" for one in view_layer.aovs if one.name not in written]
    grouped = outputs.groups(view_layer)
    return names + [f"Light Group {one.name}" for one in view_layer.lightgroups if one.name not in grouped]

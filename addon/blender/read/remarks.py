# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes on settings of Blender and of Cycles that change a picture of theirs and none of ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from ...core.base.steps import Steps
from .view_layers import unknown_passes

if TYPE_CHECKING:
    from ...core.base.notes import Notes

Check = Callable[[Any, Any], bool]
"""Whether a setting of a data block has an effect in a scene."""


@dataclass(frozen=True)
class Setting:
    """A setting that is not supported. path: from its data block. plain: the value at which nothing is missing.
    needs: whether another value has an effect there.
    """

    path: str
    plain: Any
    text: str
    needs: Check | None = None

    def is_missed(self, scene: Any, block: Any) -> bool:
        """Whether a picture of the scene lacks what the setting does."""
        value = found(block, self.path)
        missed = value is not None and value != self.plain
        return missed and (self.needs is None or self.needs(scene, block))


def found(block: Any, path: str) -> Any:
    """The value at a path of attributes; None if this Blender lacks it, or Cycles is disabled."""
    for name in path.split("."):
        block = getattr(block, name, None)
    return block


def _simplified(scene: Any, _block: Any) -> bool:
    return bool(scene.render.use_simplify)


CAUSTICS = "Shadow caustics are not supported"
TEXTURES = "The resolution of textures is not supported, only the limit of their size"

SETTINGS: dict[type, tuple[Setting, ...]] = {
    bpy.types.Scene: (
        Setting("cycles.use_fast_gi", False, "Fast GI is not supported, all bounces are rendered"),
        Setting("cycles.texture_resolution_render", 1.0, TEXTURES, _simplified),
    ),
    bpy.types.World: (Setting("cycles.is_caustics_light", False, CAUSTICS),),
    bpy.types.Light: (Setting("cycles.is_caustics_light", False, CAUSTICS),),
    bpy.types.Material: (
        Setting("cycles.use_bump_map_correction", True, "Bump maps are always corrected, also in material"),
        Setting("cycles.volume_interpolation", "LINEAR", "Volumes are interpolated linearly, also those of material"),
    ),
    bpy.types.Object: (
        Setting("shadow_terminator_shading_offset", 0.0, "The shading offset of shadow terminators is not supported"),
        Setting("cycles.is_caustics_caster", False, CAUSTICS),
        Setting("cycles.is_caustics_receiver", False, CAUSTICS),
    ),
}
"""The settings by the type of the data block that they are of, or belong to."""


def remark(scene: Any, view_layer: Any, triangles: int, notes: Notes) -> None:
    """Note what is missing in a picture of this view layer."""
    render = scene.render
    if not triangles:
        notes.add("The scene has no surface, only the background is rendered", scene.name)
    if render.use_freestyle:
        notes.add("Freestyle lines are not supported", scene.name)
    for name in unknown_passes(view_layer):
        notes.add(f"The pass {name} is not supported yet, and not rendered", view_layer.name)


def unread(depsgraph: Any, notes: Notes) -> Steps[None]:
    """Note the settings of the data blocks in use that are not supported, block by block."""
    scene = depsgraph.scene_eval
    for block in depsgraph.ids:
        kind = next((kind for kind in SETTINGS if isinstance(block, kind)), None)
        for setting in SETTINGS.get(kind, ()):
            if setting.is_missed(scene, block):
                notes.add(setting.text, block.name_full)
        yield

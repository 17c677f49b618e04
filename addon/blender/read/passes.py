# SPDX-License-Identifier: GPL-3.0-or-later
"""The render passes of the engine, and their registration in Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    from ...core.structures.settings import RenderSettings


@dataclass(frozen=True)
class Pass:
    """A render pass: its name in the native renderer and in Blender, and its channels.

    kind: VALUE, VECTOR or COLOR. switch: the property that enables it, of the view layer or, if `own`, of its
    `halfspace` group; "" for the pass that is always present. before_5: its name in Blender before 5.0, where that
    differs.
    """

    name: str
    channels: str
    kind: str
    switch: str = ""
    own: bool = False
    before_5: str = ""

    @property
    def in_blender(self) -> str:
        """Its name in this version of Blender."""
        return self.before_5 if self.before_5 and bpy.app.version < (5, 0) else self.name

    def wanted(self, view_layer: Any) -> bool:
        """Whether this pass is enabled in this view layer."""
        return not self.switch or getattr(view_layer.halfspace if self.own else view_layer, self.switch)


PASSES = (
    Pass("Combined", "RGBA", "COLOR"),
    Pass("Depth", "Z", "VALUE", "use_pass_z"),
    Pass("Mist", "Z", "VALUE", "use_pass_mist"),
    Pass("Position", "XYZ", "VECTOR", "use_pass_position"),
    Pass("Normal", "XYZ", "VECTOR", "use_pass_normal"),
    Pass("UV", "UVA", "VECTOR", "use_pass_uv"),
    Pass("Object Index", "X", "VALUE", "use_pass_object_index", before_5="IndexOB"),
    Pass("Material Index", "X", "VALUE", "use_pass_material_index", before_5="IndexMA"),
    Pass("Denoising Albedo", "RGB", "COLOR", "use_pass_albedo", own=True),
    Pass("Sample Count", "X", "VALUE", "use_pass_samples", own=True),
    Pass("Traversal Steps", "X", "VALUE", "use_pass_steps", own=True),
    Pass("Triangle Tests", "X", "VALUE", "use_pass_tests", own=True),
    Pass("Leaf Depth", "X", "VALUE", "use_pass_depth", own=True),
)


def wanted_passes(view_layer: Any) -> list[Pass]:
    """The enabled passes of a view layer, Combined first."""
    return [render_pass for render_pass in PASSES if render_pass.wanted(view_layer)]


def register_passes(engine: Any, scene: Any, view_layer: Any) -> None:
    """Register the enabled passes in Blender, for the compositor and for files."""
    for render_pass in wanted_passes(view_layer):
        engine.register_pass(
            scene,
            view_layer,
            render_pass.in_blender,
            len(render_pass.channels),
            render_pass.channels,
            render_pass.kind,
        )


def native_names() -> dict[str, str]:
    """The native name of each pass by its name in this version of Blender."""
    return {render_pass.in_blender: render_pass.name for render_pass in PASSES}


BYTES = 8 + 4 + 4
"""Bytes per channel of a pixel: in the film, in the copy from it, and in Blender's result."""

NOISE_BYTES = 6 * 8
"""Bytes per pixel in the film for adaptive sampling."""


def bytes_needed(settings: RenderSettings) -> int:
    """Bytes of memory for the pixels of a picture."""
    width, height = settings.size
    channels = sum(len(each.channels) for each in PASSES if each.name in settings.passes)
    return width * height * (BYTES * channels + NOISE_BYTES * bool(settings.noise_threshold > 0.0))

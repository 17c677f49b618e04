# SPDX-License-Identifier: GPL-3.0-or-later
"""The render passes of the engine, and their registration in Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from .value_nodes import outputs

if TYPE_CHECKING:
    from ...core.structures.settings import RenderSettings


@dataclass(frozen=True)
class Pass:
    """A render pass: its name in the native renderer and in Blender, and its channels.

    kind: VALUE, VECTOR or COLOR. switch: the property that enables it, of the view layer or, if `own`, of its
    `halfspace` group; "" for the pass that is always present. before_5: its name in Blender before 5.0, and called: in
    any Blender, where they differ.
    """

    name: str
    channels: str
    kind: str
    switch: str = ""
    own: bool = False
    before_5: str = ""
    called: str = ""

    @property
    def in_blender(self) -> str:
        """Its name in this version of Blender."""
        if self.called:
            return self.called
        return self.before_5 if self.before_5 and bpy.app.version < (5, 0) else self.name

    def wanted(self, view_layer: Any) -> bool:
        """Whether this pass is enabled in this view layer."""
        return not self.switch or getattr(view_layer.halfspace if self.own else view_layer, self.switch)


DATA_PASSES = (
    Pass("Combined", "RGBA", "COLOR"),
    Pass("Depth", "Z", "VALUE", "use_pass_z"),
    Pass("Mist", "Z", "VALUE", "use_pass_mist"),
    Pass("Position", "XYZ", "VECTOR", "use_pass_position"),
    Pass("Normal", "XYZ", "VECTOR", "use_pass_normal"),
    Pass("UV", "UVA", "VECTOR", "use_pass_uv"),
    Pass("Vector", "XYZW", "VECTOR", "use_pass_vector"),
    Pass("Object Index", "X", "VALUE", "use_pass_object_index", before_5="IndexOB"),
    Pass("Material Index", "X", "VALUE", "use_pass_material_index", before_5="IndexMA"),
)
"""The picture, and what Blender's own switches enable about the first surface."""

LIGHT_PASSES = (
    Pass("Diffuse Direct", "RGB", "COLOR", "use_pass_diffuse_direct", before_5="DiffDir"),
    Pass("Diffuse Indirect", "RGB", "COLOR", "use_pass_diffuse_indirect", before_5="DiffInd"),
    Pass("Diffuse Color", "RGB", "COLOR", "use_pass_diffuse_color", before_5="DiffCol"),
    Pass("Glossy Direct", "RGB", "COLOR", "use_pass_glossy_direct", before_5="GlossDir"),
    Pass("Glossy Indirect", "RGB", "COLOR", "use_pass_glossy_indirect", before_5="GlossInd"),
    Pass("Glossy Color", "RGB", "COLOR", "use_pass_glossy_color", before_5="GlossCol"),
    Pass("Transmission Direct", "RGB", "COLOR", "use_pass_transmission_direct", before_5="TransDir"),
    Pass("Transmission Indirect", "RGB", "COLOR", "use_pass_transmission_indirect", before_5="TransInd"),
    Pass("Transmission Color", "RGB", "COLOR", "use_pass_transmission_color", before_5="TransCol"),
    Pass("Emission", "RGB", "COLOR", "use_pass_emit", before_5="Emit"),
    Pass("Environment", "RGB", "COLOR", "use_pass_environment", before_5="Env"),
)
"""The parts of the light, as in Cycles."""

VOLUME_PASSES = (
    Pass("Volume Direct", "RGB", "COLOR", "use_pass_volume_direct", own=True, before_5="VolumeDir"),
    Pass("Volume Indirect", "RGB", "COLOR", "use_pass_volume_indirect", own=True, before_5="VolumeInd"),
)
"""The parts of the light that a volume scatters first, whose switches in Cycles belong to its add-on."""

CATCHER_PASS = Pass("Shadow Catcher", "RGB", "COLOR", "use_pass_shadow_catcher", own=True)
"""The shadow on shadow catchers, whose switch in Cycles belongs to its add-on."""

OWN_PASSES = (
    Pass("Denoising Albedo", "RGB", "COLOR", "use_pass_albedo", own=True),
    Pass("Sample Count", "X", "VALUE", "use_pass_samples", own=True),
    Pass("Traversal Steps", "X", "VALUE", "use_pass_steps", own=True),
    Pass("Triangle Tests", "X", "VALUE", "use_pass_tests", own=True),
    Pass("Leaf Depth", "X", "VALUE", "use_pass_depth", own=True),
)
"""Passes of this engine alone."""

MATTES = {
    "Object": "use_pass_cryptomatte_object",
    "Material": "use_pass_cryptomatte_material",
    "Asset": "use_pass_cryptomatte_asset",
}
"""Kinds of things that Cryptomatte distinguishes, with the property of the view layer that enables it."""

PASSES = (*DATA_PASSES, *LIGHT_PASSES, *VOLUME_PASSES, CATCHER_PASS, *OWN_PASSES)


def wanted_passes(view_layer: Any) -> list[Pass]:
    """The enabled passes of a view layer, Combined first."""
    plain = [render_pass for render_pass in PASSES if render_pass.wanted(view_layer)]
    return [*plain, *_mattes(view_layer), *_outputs(view_layer), *_groups(view_layer)]


def _mattes(view_layer: Any) -> list[Pass]:
    """The passes of Cryptomatte: two ranks each. Lower case keeps EXR files from compressing them with loss."""
    levels = (min(view_layer.pass_cryptomatte_depth, 16) + 1) // 2
    return [
        Pass(f"Crypto{kind}{level:02}", "rgba", "COLOR")
        for kind, switch in MATTES.items()
        if getattr(view_layer, switch)
        for level in range(levels)
    ]


def _outputs(view_layer: Any) -> list[Pass]:
    """The passes that materials write."""
    return [
        Pass(f"Output {number}", *(("RGBA", "COLOR") if kind == "COLOR" else ("X", "VALUE")), called=name)
        for name, (number, kind) in outputs.wanted(view_layer).items()
    ]


def _groups(view_layer: Any) -> list[Pass]:
    """The passes of the light groups."""
    return [
        Pass(f"Light Group {number - 1}", "RGB", "COLOR", called=f"Combined_{name}")
        for name, number in outputs.groups(view_layer).items()
    ]


def wanted_data(view_layer: Any) -> outputs.Wanted:
    """Data of the scene that the enabled passes need."""
    mattes = any(getattr(view_layer, switch) for switch in MATTES.values())
    return outputs.Wanted(mattes, outputs.wanted(view_layer), outputs.groups(view_layer))


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


def native_names(view_layer: Any) -> dict[str, str]:
    """The native name of each pass of a view layer by its name in this version of Blender."""
    return {render_pass.in_blender: render_pass.name for render_pass in wanted_passes(view_layer)}


BYTES = 8 + 4 + 4
"""Bytes per channel of a pixel: in the film, in the copy from it, and in Blender's result."""

NOISE_BYTES = 6 * 8
"""Bytes per pixel in the film for adaptive sampling."""


def bytes_needed(settings: RenderSettings) -> int:
    """Bytes of memory for the pixels of a picture."""
    width, height = settings.size
    known = {each.name: len(each.channels) for each in PASSES}
    channels = sum(known.get(name, 4) for name in settings.passes)
    return width * height * (BYTES * channels + NOISE_BYTES * bool(settings.noise_threshold > 0.0))

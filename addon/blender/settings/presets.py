# SPDX-License-Identifier: GPL-3.0-or-later
"""Named configurations: those of the literature, those of pictures, and the user's own in Blender's preset system."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.props import StringProperty

from ...core.base import native
from ...core.structures import catalogue, presets, specs
from ...core.structures.settings import BOUNCES
from . import properties


def apply(group: Any, spec: str) -> None:
    """Set the structure and all parameters of a configuration in a `scene.halfspace` group. Raises specs.SpecError."""
    structure, values = presets.settings(catalogue.load(), spec)
    group.structure = structure
    for name, value in values.items():
        setattr(group, name, value)


class HALFSPACE_OT_use_spec(bpy.types.Operator):
    """Applies a configuration."""

    bl_idname = "halfspace.use_spec"
    bl_label = "Use This One"
    bl_description = "Choose this structure with these parameters"
    bl_options = {"REGISTER", "UNDO"}

    spec: StringProperty(name="Configuration", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        """The structure's summary and source as the tooltip."""
        structure = catalogue.load().get(specs.structure_of(properties.spec))
        return f"{structure.summary} {structure.paper}" if structure is not None else cls.bl_description

    def execute(self, context: Any) -> set[str]:
        try:
            apply(context.scene.halfspace, self.spec)
        except specs.SpecError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class _NamesMenu:
    """The names of the literature for the structures of one menu."""

    def draw(self, context: Any) -> None:
        for preset in presets.offered(catalogue.load()):
            if preset.menu == self.bl_label:  # type: ignore[attr-defined]
                button = self.layout.operator(  # type: ignore[attr-defined]
                    HALFSPACE_OT_use_spec.bl_idname, text=preset.name
                )
                button.spec = preset.spec


@cache
def _menus() -> dict[str, type]:
    """The submenus by title, in the order of the registry."""
    titles = dict.fromkeys(preset.menu for preset in presets.offered(catalogue.load()))
    return {title: type(_menu_id(title), (_NamesMenu, bpy.types.Menu), {"bl_label": title}) for title in titles}


def _menu_id(title: str) -> str:
    return f"HALFSPACE_MT_presets_{title.lower().replace(' ', '_').replace('-', '_')}"


class HALFSPACE_MT_presets(bpy.types.Menu):
    """The names of the literature by kind of structure, then the user's presets."""

    bl_label = "Structure Presets"
    preset_subdir = "halfspace/structure"
    preset_operator = "script.execute_preset"

    def draw(self, context: Any) -> None:
        layout = self.layout
        for title in _menus():
            layout.menu(_menu_id(title), text=title)
        layout.separator()
        self.draw_preset(context)


class _AddPreset(AddPresetBase):
    """An operator that saves or removes a preset, and reports a folder that cannot be written."""

    def execute(self, context: Any) -> set[str]:
        try:
            # Blender prints a traceback where it cannot make the folder itself.
            folder = Path(bpy.utils.user_resource("SCRIPTS", path="presets"), self.preset_subdir)
            folder.mkdir(parents=True, exist_ok=True)
            found: set[str] = super().execute(context)
        except OSError as error:
            # Blender lets this through where its folder is read-only or the disk is full.
            self.report({"ERROR"}, f"The preset cannot be saved: {error.filename}: {error.strerror}")
            return {"CANCELLED"}
        return found


class HALFSPACE_OT_preset_add(_AddPreset, bpy.types.Operator):
    """Saves or removes a preset."""

    bl_idname = "halfspace.preset_add"
    bl_label = "Save Structure Preset"
    bl_description = "Save the structure and its parameters under a name, or forget the chosen preset"
    preset_menu = "HALFSPACE_MT_presets"
    preset_subdir = "halfspace/structure"
    preset_defines = ("group = bpy.context.scene.halfspace",)

    @property
    def preset_values(self) -> list[str]:
        """The saved properties: the structure first, because setting it resets the others."""
        names = [parameter.name for parameter in properties.structure_parameters(bpy.context.scene.halfspace)]
        return [f"group.{name}" for name in ("structure", *names)]


@dataclass(frozen=True)
class Picture:
    """Presets of a part of the settings of pictures. key: of their folder and classes. names: of the properties that a
    preset holds. offered: presets that the extension brings, by title.
    """

    key: str
    label: str
    names: tuple[str, ...]
    offered: dict[str, dict[str, Any]]


def _quality(prefix: str, samples: int, threshold: float, *, denoised: bool) -> dict[str, Any]:
    """The values of a preset of sampling. prefix: of the properties. threshold: of noise, 0 = all samples."""
    found = {f"use_{prefix}adaptive": threshold > 0, f"{prefix}samples": samples, f"{prefix}min_samples": 0}
    if threshold > 0:
        found[f"{prefix}noise_threshold"] = threshold
    return {**found, f"use_{prefix}denoising": denoised}


def _paths(bounces: tuple[int, int, int, int, int], *, caustics: bool) -> dict[str, Any]:
    """The values of a preset of light paths. bounces: total, diffuse, glossy, transmission and volume."""
    return {
        **dict(zip(BOUNCES, bounces, strict=True)),
        **{f"caustics_{kind}": caustics for kind in ("reflective", "refractive")},
    }


PICTURES = (
    Picture(
        "sampling",
        "Sampling Presets",
        ("use_adaptive", "noise_threshold", "samples", "min_samples", "time_limit", "use_denoising"),
        {
            "Preview": _quality("", 1024, 0.1, denoised=True),
            "Final": _quality("", 4096, 0.01, denoised=True),
            "Unbiased": _quality("", 1024, 0.0, denoised=False),
        },
    ),
    Picture(
        "viewport_sampling",
        "Viewport Sampling Presets",
        (
            *("use_preview_adaptive", "preview_noise_threshold", "preview_samples", "preview_min_samples"),
            *("use_preview_denoising", "preview_denoising_start_sample"),
        ),
        {
            "Preview": _quality("preview_", 1024, 0.1, denoised=False),
            "Final": _quality("preview_", 4096, 0.01, denoised=True),
        },
    ),
    Picture(
        "light_paths",
        "Light Paths Presets",
        (
            *BOUNCES,
            *("clamp_direct", "clamp_indirect", "filter_glossy"),
            *("caustics_reflective", "caustics_refractive"),
        ),
        {
            "Direct Light": _paths((8, 0, 1, 2, 0), caustics=False),
            "Limited Global Illumination": _paths((8, 1, 4, 8, 0), caustics=False),
            "Full Global Illumination": _paths((32, 32, 32, 32, 32), caustics=True),
        },
    ),
)
"""Presets of pictures, by the parts of the panels. Samples and thresholds are those of Cycles' presets."""


class HALFSPACE_OT_use_picture_preset(bpy.types.Operator):
    """Applies one of the presets of pictures that the extension brings."""

    bl_idname = "halfspace.use_picture_preset"
    bl_label = "Use Preset"
    bl_description = "Take over the values of this preset"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    part: StringProperty(name="Part", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    preset: StringProperty(name="Preset", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    def execute(self, context: Any) -> set[str]:
        values = next((one.offered.get(self.preset) for one in PICTURES if one.key == self.part), None)
        if values is None:
            self.report({"ERROR"}, f"There is no preset {self.preset} of {self.part}")
            return {"CANCELLED"}
        for name, value in values.items():
            setattr(context.scene.halfspace, name, value)
        context.scene.update_tag()
        return {"FINISHED"}


class _PicturePresets(PresetPanel):
    """The list of presets of one part: those that the extension brings, then the user's own."""

    preset_operator = "script.execute_preset"
    part: Picture

    def draw(self, context: Any) -> None:
        layout = self.layout  # type: ignore[attr-defined]
        layout.emboss = "PULLDOWN_MENU"
        for name in self.part.offered:
            button = layout.operator(HALFSPACE_OT_use_picture_preset.bl_idname, text=name)
            button.part, button.preset = self.part.key, name
        super().draw(context)


@cache
def _picture_classes() -> dict[str, tuple[type, type]]:
    """The panel and the operator of each part, by its key."""
    found = {}
    for part in PICTURES:
        panel, operator = f"HALFSPACE_PT_{part.key}_presets", f"halfspace.{part.key}_preset_add"
        folder = f"halfspace/{part.key}"
        shown = {"bl_label": part.label, "preset_subdir": folder, "preset_add_operator": operator, "part": part}
        saved = {
            "__doc__": "Save these settings under a name, or forget a preset",
            "bl_idname": operator,
            "bl_label": f"Save {part.label[:-1]}",
            "preset_menu": panel,
            "preset_subdir": folder,
            "preset_defines": ("group = bpy.context.scene.halfspace",),
            "preset_values": [f"group.{name}" for name in part.names],
        }
        found[part.key] = (
            type(panel, (_PicturePresets, bpy.types.Panel), shown),
            type(f"HALFSPACE_OT_{part.key}_preset_add", (_AddPreset, bpy.types.Operator), saved),
        )
    return found


def draw_picture(layout: Any, key: str) -> None:
    """Draw the button that lists the presets of a part in the header of its panel."""
    panel: Any = _picture_classes()[key][0]
    panel.draw_panel_header(layout)


def _classes() -> tuple[type, ...]:
    return (HALFSPACE_OT_use_spec, *_menus().values(), HALFSPACE_MT_presets, HALFSPACE_OT_preset_add)


_registered: list[type] = []


def draw(layout: Any) -> None:
    """Draw the menu, and the buttons that save and remove presets."""
    row = layout.row(align=True)
    row.menu(HALFSPACE_MT_presets.__name__, text=HALFSPACE_MT_presets.bl_label)
    row.operator(HALFSPACE_OT_preset_add.bl_idname, text="", icon="ADD")
    row.operator(HALFSPACE_OT_preset_add.bl_idname, text="", icon="REMOVE").remove_active = True


def register() -> None:
    """Register menus, panels and operators; those of structures need a catalogue."""
    of_structures = _classes() if native.problem() is None else ()
    of_pictures = (kind for pair in _picture_classes().values() for kind in pair)
    for kind in (*of_structures, HALFSPACE_OT_use_picture_preset, *of_pictures):
        bpy.utils.register_class(kind)
        _registered.append(kind)


def unregister() -> None:
    """Undo `register`."""
    while _registered:
        bpy.utils.unregister_class(_registered.pop())

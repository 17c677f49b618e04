# SPDX-License-Identifier: GPL-3.0-or-later
"""Named configurations: those of the literature, and the user's own in Blender's preset system."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import StringProperty

from ...core.base import native
from ...core.structures import catalogue, presets, specs
from . import properties


def _settings(spec: str) -> tuple[str, dict[str, catalogue.Value]]:
    """`presets.settings`, also for configurations of former versions, whose names the native module knows."""
    known = catalogue.load()
    try:
        return presets.settings(known, spec)
    except specs.SpecError:
        try:
            today = specs.canonical(native.load(), spec)
        except specs.SpecError:
            pass
        else:
            return presets.settings(known, today)
        raise


def apply(group: Any, spec: str) -> None:
    """Set the structure and all parameters of a configuration in a `scene.halfspace` group. Raises specs.SpecError."""
    structure, values = _settings(spec)
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


FAMILIES = (
    ("kd", "Kd-Trees", ("kd",)),
    ("bsp", "BSP and RBSP", ("rbsp", "bsp", "beam")),
    ("bih", "Interval Hierarchies", ("bih", "skd", "boxtree")),
    ("boxes", "Hierarchies of Boxes", ("bvh", "obb", "bbox")),
    ("octrees", "Octrees", ("octree",)),
    ("others", "Others", ("",)),
)
"""Submenus of the presets: key, title, and how the ids of their structures begin. The first that fits is taken."""


def family(preset: presets.Preset) -> str:
    """The key of the submenu that lists a preset."""
    name = specs.structure_of(preset.spec)
    return next(key for key, _, beginnings in FAMILIES if name.startswith(beginnings))


class _FamilyMenu:
    """The names of the literature for the structures of one family."""

    key = ""

    def draw(self, context: Any) -> None:
        for preset in presets.offered(catalogue.load()):
            if family(preset) == self.key:
                button = self.layout.operator(  # type: ignore[attr-defined]
                    HALFSPACE_OT_use_spec.bl_idname, text=preset.name
                )
                button.spec = preset.spec


def _family_menu(key: str) -> str:
    return f"HALFSPACE_MT_presets_{key}"


FAMILY_MENUS = tuple(
    type(_family_menu(key), (_FamilyMenu, bpy.types.Menu), {"bl_label": title, "key": key})
    for key, title, _ in FAMILIES
)


class HALFSPACE_MT_presets(bpy.types.Menu):
    """The names of the literature by family, then the user's presets."""

    bl_label = "Structure Presets"
    preset_subdir = "halfspace/structure"
    preset_operator = "script.execute_preset"

    def draw(self, context: Any) -> None:
        layout = self.layout
        for key, title, _ in FAMILIES:
            layout.menu(_family_menu(key), text=title)
        layout.separator()
        self.draw_preset(context)


class HALFSPACE_OT_preset_add(AddPresetBase, bpy.types.Operator):
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


KINDS = (HALFSPACE_OT_use_spec, *FAMILY_MENUS, HALFSPACE_MT_presets, HALFSPACE_OT_preset_add)


def draw(layout: Any) -> None:
    """Draw the menu, and the buttons that save and remove presets."""
    row = layout.row(align=True)
    row.menu(HALFSPACE_MT_presets.__name__, text=HALFSPACE_MT_presets.bl_label)
    row.operator(HALFSPACE_OT_preset_add.bl_idname, text="", icon="ADD")
    row.operator(HALFSPACE_OT_preset_add.bl_idname, text="", icon="REMOVE").remove_active = True


def register() -> None:
    """Register menu and operators, which need a catalogue."""
    if native.problem() is None:
        for kind in KINDS:
            bpy.utils.register_class(kind)


def unregister() -> None:
    """Undo `register`."""
    for kind in reversed(KINDS):
        if kind.is_registered:
            bpy.utils.unregister_class(kind)

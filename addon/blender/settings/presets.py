# SPDX-License-Identifier: GPL-3.0-or-later
"""Named configurations: those of the literature, and the user's own in Blender's preset system."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import StringProperty

from ...core.base import native
from ...core.structures import catalogue, presets, specs
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
    """Register menu and operators, which need a catalogue."""
    if native.problem() is None:
        for kind in _classes():
            bpy.utils.register_class(kind)
            _registered.append(kind)


def unregister() -> None:
    """Undo `register`."""
    while _registered:
        bpy.utils.unregister_class(_registered.pop())

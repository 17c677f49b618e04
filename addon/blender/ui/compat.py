# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility of Blender's own panels for this engine: their classes list the engines that they appear for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

MODEL = "BLENDER_RENDER"
"""Panels for the most general engine also suit ours, except those below."""

ADDED = {
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
}
"""Panels of which this engine reads all settings, though they are not for the most general engine."""

UNREAD = {
    "EEVEE_MATERIAL_PT_viewport_settings",
    "PARTICLE_PT_render_path_timing",
}
"""Panels whose settings do not change a picture of this engine, or that are empty."""

REPLACED = {
    "DATA_PT_light": "HALFSPACE_PT_light",
    "DATA_PT_spot": "HALFSPACE_PT_light_beam_shape",
    "EEVEE_MATERIAL_PT_displacement": "HALFSPACE_PT_material_displacement",
    "EEVEE_MATERIAL_PT_settings": "HALFSPACE_PT_material_settings",
    "EEVEE_MATERIAL_PT_surface": "HALFSPACE_PT_material",
    "EEVEE_MATERIAL_PT_volume": "HALFSPACE_PT_material_volume",
    "EEVEE_WORLD_PT_mist": "HALFSPACE_PT_world_mist",
    "EEVEE_WORLD_PT_surface": "HALFSPACE_PT_world",
    "EEVEE_WORLD_PT_volume": "HALFSPACE_PT_world_volume",
    "NODE_DATA_PT_light": "HALFSPACE_PT_light",
    "OBJECT_PT_visibility": "HALFSPACE_PT_visibility",
    "RENDER_PT_eevee_film": "HALFSPACE_PT_film",
    "RENDER_PT_eevee_performance_compositor": "HALFSPACE_PT_compositor",
    "RENDER_PT_eevee_performance_compositor_denoise_settings": "HALFSPACE_PT_compositor_denoise_settings",
    "RENDER_PT_eevee_sampling": "HALFSPACE_PT_sampling",
    "RENDER_PT_simplify": "HALFSPACE_PT_simplify",
    "RENDER_PT_simplify_greasepencil": "HALFSPACE_PT_simplify_greasepencil",
    "RENDER_PT_simplify_render": "HALFSPACE_PT_simplify_render",
    "RENDER_PT_simplify_viewport": "HALFSPACE_PT_simplify_viewport",
    "VIEWLAYER_PT_filter": "HALFSPACE_PT_filter",
    "VIEWLAYER_PT_layer_passes": "HALFSPACE_PT_passes",
    "VIEWLAYER_PT_override": "HALFSPACE_PT_override",
}
"""Panels in whose place one of ours shows the settings that this engine reads."""

UNREAD_ROOMS = {
    "bl_ui.properties_data_lightprobe",
    "bl_ui.properties_freestyle",
}
"""Modules of panels that all belong to a feature that this engine does not have."""


def appears(panel: Any) -> bool:
    """Whether one of Blender's panels is shown for this engine."""
    name, engines = panel.__name__, getattr(panel, "COMPAT_ENGINES", ())
    if name in ADDED:
        return True
    return MODEL in engines and name not in UNREAD | REPLACED.keys() and panel.__module__ not in UNREAD_ROOMS


def _panels() -> Iterator[Any]:
    yield from filter(appears, bpy.types.Panel.__subclasses__())


def register(engine: str) -> None:
    """Make Blender's panels appear for `engine`.

    Each gets a set of its own: some of Blender's panels share one, also with panels that are not shown.
    """
    for panel in _panels():
        panel.COMPAT_ENGINES = {*panel.COMPAT_ENGINES, engine}


def unregister(engine: str) -> None:
    """Remove `engine` from every panel that lists it."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if isinstance(engines, set) and engine in engines:
            panel.COMPAT_ENGINES = engines - {engine}

# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting that the engine reads is in a panel, and no panel shows one that does nothing."""

import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.blender.render.engine import ENGINE
from addon.blender.ui import compat, data_panels, panels, pass_panels
from addon.blender.ui.data_panels import OF_PANORAMAS
from tests.blender.layouts import Layout, draw_own
from tests.blender.shapes import cube

SOURCES = Path(compat.__file__).parents[1]

READ = {
    "BakeSettings": "view_from",
    "Camera": "lens clip_start clip_end dof panorama_type fisheye_fov fisheye_lens latitude_min latitude_max "
    "longitude_min longitude_max fisheye_polynomial_k0 fisheye_polynomial_k1 fisheye_polynomial_k2 "
    "fisheye_polynomial_k3 fisheye_polynomial_k4 central_cylindrical_range_u_min central_cylindrical_range_u_max "
    "central_cylindrical_range_v_min central_cylindrical_range_v_max central_cylindrical_radius",
    "CameraDOFSettings": "use_dof focus_object focus_distance aperture_fstop aperture_blades aperture_rotation "
    "aperture_ratio",
    "CyclesLightSettings": "max_bounces",
    "CyclesObjectSettings": "use_motion_blur use_deform_motion use_camera_cull use_distance_cull",
    "CyclesRenderSettings": "transparent_max_bounces film_transparent_glass film_transparent_roughness use_camera_cull "
    "camera_cull_margin use_distance_cull distance_cull_margin texture_limit texture_limit_render "
    "rolling_shutter_type rolling_shutter_duration dicing_rate preview_dicing_rate max_subdivisions dicing_camera "
    "offscreen_dicing_scale",
    "CyclesWorldSettings": "max_bounces use_shadows",
    "CyclesRenderLayerSettings": "use_denoising",
    "CyclesVisibilitySettings": "camera diffuse glossy transmission scatter",
    "HalfspaceSettings": "integrator ambient_distance samples preview_samples use_preview_denoising "
    "preview_denoising_start_sample use_denoising use_adaptive noise_threshold min_samples use_preview_adaptive "
    "preview_noise_threshold preview_min_samples time_limit render_seed use_animated_seed max_bounces "
    "diffuse_bounces glossy_bounces transmission_bounces "
    "volume_bounces motion_steps clamp_direct clamp_indirect filter_glossy caustics_reflective caustics_refractive "
    "secondary_beams "
    "film_exposure pixel_filter_type filter_width bake_type automatic instancing top memory_limit structure",
    "HalfspaceViewLayerSettings": "use_pass_volume_direct use_pass_volume_indirect use_pass_shadow_catcher "
    "use_pass_albedo use_pass_samples use_pass_steps use_pass_tests use_pass_depth",
    "Light": "type color use_temperature temperature_color exposure normalize use_shadow",
    "PointLight": "energy shadow_soft_size use_soft_falloff",
    "SpotLight": "energy shadow_soft_size use_soft_falloff spot_size spot_blend",
    "SunLight": "energy angle",
    "AreaLight": "energy shape size size_y spread",
    "Material": "pass_index displacement_method use_transparent_shadow",
    "Object": "visible_camera visible_diffuse visible_glossy visible_transmission visible_shadow "
    "visible_volume_scatter is_holdout is_shadow_catcher pass_index lightgroup shadow_terminator_geometry_offset",
    "World": "lightgroup",
    "RenderSettings": "use_motion_blur motion_blur_position motion_blur_shutter "
    "film_transparent threads_mode threads use_persistent_data use_border pixel_aspect_x "
    "pixel_aspect_y",
    "ViewLayer": "use_sky use_solid use_strand use_volumes use_motion_blur material_override world_override samples "
    "use_pass_z use_pass_mist use_pass_position use_pass_normal use_pass_uv use_pass_vector use_pass_object_index "
    "use_pass_material_index use_pass_diffuse_direct use_pass_diffuse_indirect use_pass_diffuse_color "
    "use_pass_glossy_direct use_pass_glossy_indirect use_pass_glossy_color use_pass_transmission_direct "
    "use_pass_transmission_indirect use_pass_transmission_color use_pass_emit use_pass_environment "
    "use_pass_cryptomatte_object use_pass_cryptomatte_material use_pass_cryptomatte_asset pass_cryptomatte_depth",
    "WorldMistSettings": "start depth falloff",
}
"""Properties that the sources of the extension read, by type of Blender's data."""

CARRIED_OUT = {
    "BakeSettings": "use_pass_direct use_pass_indirect use_pass_color use_pass_diffuse use_pass_glossy "
    "use_pass_transmission use_pass_emit normal_space normal_r normal_g normal_b use_selected_to_active use_cage "
    "cage_object cage_extrusion max_ray_distance target use_clear margin margin_type",
    "Camera": "type angle lens_unit ortho_scale shift_x shift_y sensor_fit sensor_width sensor_height",
    "CameraDOFSettings": "focus_subtarget",
    "Light": "temperature",
    "Object": "hide_viewport hide_render hide_select hide_surface_pick",
    "RenderSettings": "resolution_x resolution_y resolution_percentage use_crop_to_border use_single_layer "
    "use_simplify simplify_subdivision simplify_subdivision_render simplify_child_particles "
    "simplify_child_particles_render simplify_volumes use_simplify_normals simplify_gpencil simplify_gpencil_onplay "
    "simplify_gpencil_view_fill simplify_gpencil_modifier simplify_gpencil_shader_fx simplify_gpencil_tint "
    "simplify_gpencil_antialiasing compositor_device compositor_precision compositor_denoise_device "
    "compositor_denoise_preview_quality compositor_denoise_final_quality",
    "SpotLight": "show_cone",
    "ViewLayer": "use use_pass_combined",
}
"""Properties that take effect through Blender: its projection matrix, its objects, its editor, its operators."""

HIDDEN = {
    ("Camera", "dof"),
    ("CyclesWorldSettings", "use_shadows"),
    ("Light", "temperature_color"),
    ("RenderSettings", "compositor_precision"),
    ("ViewLayer", "world_override"),
}
"""Read through their parts or another property; some are not in the panels of Blender 4.5."""

WITHOUT_NODES = {"Material": "use_nodes diffuse_color", "World": "use_nodes color", "Light": "use_nodes"}
"""Shown only for data without nodes, or before Blender 5.0."""

OF_BLENDER = (
    "animation",
    "background_image",
    "camera_display",
    "color_management",
    "context_",
    "custom_props",
    "safe_areas",
    "viewport",
)
"""Parts of the names of Blender's panels about its editors and its animation, which suit any engine."""

OTHER_ROOMS = tuple(f"bl_ui.properties_{name}" for name in ("data_mesh", "particle", "physics", "texture"))
"""Modules of panels about what makes geometry, which Blender does for any engine."""

OF_CYCLES = "LIGHT_PT_(light|settings|beam)|visib|WORLD_PT_mist|PT_filter|film|threads|final"
"""Part of the names of Cycles' panels whose settings ours show too."""

WITHOUT = {
    "CYCLES_CAMERA_PT_lens_custom_parameters": "cameras of a shader",
    "CYCLES_LIGHT_PT_settings": "importance of a light; its bounces are in Light",
    "CYCLES_MATERIAL_PT_settings_surface": "sampling of emission, bump correction",
    "CYCLES_MATERIAL_PT_settings_volume": "steps through volumes",
    "CYCLES_OBJECT_PT_motion_blur": "steps of an object; its switches are in Visibility",
    "CYCLES_OBJECT_PT_shading_caustics": "manifold next event estimation",
    "CYCLES_OBJECT_PT_shading_gi_approximation": "ambient occlusion in place of light",
    "CYCLES_OBJECT_PT_visibility_culling": "two rows, in Visibility",
    "CYCLES_RENDER_PT_curves": "shapes of hair",
    "CYCLES_RENDER_PT_curves_viewport_display": "shapes of hair",
    "CYCLES_RENDER_PT_debug": "instruction sets",
    "CYCLES_RENDER_PT_light_paths_fast_gi": "ambient occlusion in place of light",
    "CYCLES_RENDER_PT_bake_output_margin": "two rows, in Output",
    "CYCLES_RENDER_PT_film_transparency": "three rows, in Film",
    "CYCLES_RENDER_PT_passes_data": "the first rows of Passes",
    "CYCLES_RENDER_PT_performance_acceleration_structure": "in Structure",
    "CYCLES_RENDER_PT_performance_final_render": "one row, in Performance",
    "CYCLES_RENDER_PT_performance_memory": "tiles",
    "CYCLES_RENDER_PT_performance_texture_cache": "a cache of textures",
    "CYCLES_RENDER_PT_performance_threads": "two rows, in Performance",
    "CYCLES_RENDER_PT_performance_viewport": "pixel sizes",
    "CYCLES_RENDER_PT_sampling_advanced_sample_subset": "a part of the samples",
    "CYCLES_RENDER_PT_sampling_lights": "a threshold of lights",
    "CYCLES_RENDER_PT_sampling_path_guiding": "guiding",
    "CYCLES_RENDER_PT_sampling_path_guiding_debug": "guiding",
    "CYCLES_RENDER_PT_volumes": "steps through volumes",
    "CYCLES_WORLD_PT_settings": "sampling of the world",
    "CYCLES_WORLD_PT_settings_surface": "sampling of the world",
    "CYCLES_WORLD_PT_settings_volume": "steps through volumes",
}
"""Panels of Cycles without one here, by what they are about: what this engine does not have, or shows elsewhere."""

TABS = {"view_layer", "world", "object", "material", "data"}
"""The tabs of the Properties editor in which each panel's every setting is judged."""


def names(table: dict[str, str]) -> set[tuple[str, str]]:
    return {(kind, name) for kind, text in table.items() for name in text.split()}


class Context(SimpleNamespace):
    """The context of a Properties editor; what is not given is None."""

    def __getattr__(self, name: str) -> Any:
        return None


def contexts(scene: Any) -> Iterator[Context]:
    """Editors of every kind of data that the engine renders."""
    scene.view_layers[0].use_pass_mist = True
    scene.render.threads_mode = "FIXED"
    scene.world = bpy.data.worlds.new("World")
    material = bpy.data.materials.new("Material")
    mesh = bpy.data.objects.new("Item", cube())
    mesh.data.materials.append(material)
    common = {
        "engine": ENGINE,
        "scene": scene,
        "view_layer": scene.view_layers[0],
        "world": scene.world,
        "preferences": bpy.context.preferences,
        "blend_data": bpy.data,
    }
    scene.render.bake.use_cage = True
    scene.halfspace.instancing = "two-level"
    scene.halfspace.use_adaptive = scene.halfspace.use_preview_adaptive = True
    for integrator, bake in (("ao", "NORMAL"), ("whitted", "DIFFUSE"), ("path", "COMBINED")):
        scene.halfspace.integrator, scene.halfspace.bake_type = integrator, bake
        yield Context(**common, object=mesh, material=material, mesh=mesh.data)
    for kind in ("POINT", "SUN", "SPOT", "AREA"):
        light = bpy.data.lights.new("Light", kind)
        if kind == "AREA":
            light.shape = "RECTANGLE"
        yield Context(**common, object=bpy.data.objects.new("Light", light), light=light)
    for kind in ("PERSP", "ORTHO"):
        camera = bpy.data.cameras.new("Camera")
        camera.type = kind
        camera.sensor_fit = "AUTO" if kind == "PERSP" else "VERTICAL"
        for unit in ("MILLIMETERS", "FOV"):
            camera.lens_unit = unit
            yield Context(**common, object=bpy.data.objects.new("Camera", camera), camera=camera)
    camera = bpy.data.cameras.new("Camera")
    camera.type = "PANO"
    for kind in OF_PANORAMAS:
        camera.panorama_type = kind
        yield Context(**common, object=bpy.data.objects.new("Camera", camera), camera=camera)


def shown(context: Context) -> Iterator[tuple[Any, Layout]]:
    """The panels that a Properties editor shows for the engine, with what they draw."""
    for panel in bpy.types.Panel.__subclasses__():
        ours = panel.__name__.startswith("HALFSPACE_PT")
        if not ours and ENGINE not in getattr(panel, "COMPAT_ENGINES", ()):
            continue
        if (panel.bl_space_type, panel.bl_region_type) != ("PROPERTIES", "WINDOW"):
            continue
        of_blender = panel.__module__.startswith(OTHER_ROOMS) or any(part in panel.__name__ for part in OF_BLENDER)
        if (ours or not of_blender) and (not hasattr(panel, "poll") or panel.poll(context)):
            yield panel, draw_own(panel, context)


@pytest.fixture(name="drawn")
def every_panel(scene: Any) -> list[tuple[Any, Layout]]:
    """All panels of all contexts."""
    return [pair for context in contexts(scene) for pair in shown(context)]


def test_every_setting_that_is_read_is_in_a_panel(drawn: list[tuple[Any, Layout]]) -> None:
    found = {pair for _, layout in drawn for pair in layout.labels}
    missing = (names(READ) | names(CARRIED_OUT)) - found - HIDDEN
    # The index of an object is in Blender's panel Relations, which is not about engines.
    missing -= {("Object", "pass_index"), ("Object", "hide_surface_pick"), ("CameraDOFSettings", "focus_subtarget")}
    assert not missing


def test_no_panel_shows_a_setting_that_does_nothing(drawn: list[tuple[Any, Layout]]) -> None:
    known = names(READ) | names(CARRIED_OUT) | names(WITHOUT_NODES)
    wrong = {
        (panel.__name__, *pair)
        for panel, layout in drawn
        if panel.__name__.startswith("HALFSPACE_PT") or panel.bl_context in TABS
        for pair in layout.labels
        if pair not in known and not pair[0].startswith("Halfspace")
    }
    assert not wrong


def test_the_sources_read_what_the_table_lists() -> None:
    text = "\n".join(
        path.read_text(encoding="utf-8") for path in SOURCES.rglob("*.py") if path.parent.name not in ("ui", "overlay")
    )
    words = set(re.findall(r"\w+", text))
    assert not {pair for pair in names(READ) if pair[1] not in words and not pair[1].startswith("visible_")}


@pytest.mark.skipif(
    bpy.app.version < (5, 2) or not hasattr(bpy.types, "CYCLES_LIGHT_PT_light"), reason="needs Cycles of Blender 5.2"
)
def test_labels_are_those_of_cycles(scene: Any, drawn: list[tuple[Any, Layout]]) -> None:
    theirs: dict[tuple[str, str], set[str | None]] = {}
    for context in contexts(scene):
        context.engine = "CYCLES"
        for panel in bpy.types.Panel.__subclasses__():
            if "CYCLES" not in panel.__name__ or panel.bl_space_type != "PROPERTIES":
                continue
            if re.search(OF_CYCLES, panel.__name__):
                if ("LIGHT" in panel.__name__ and context.light is None) or not panel.poll(context):
                    continue
                for pair, text in draw_own(panel, context).labels.items():
                    theirs.setdefault(pair, set()).add(text)
    compared = 0
    for panel, layout in drawn:
        for pair, text in layout.labels.items():
            if panel.__name__.startswith("HALFSPACE_PT") and pair in theirs and pair[0] != "RenderSettings":
                assert text in theirs[pair], (panel, pair)
                compared += 1
    assert compared > 40


def test_panels_in_place_of_blenders_have_their_names_and_places() -> None:
    ours = {panel.__name__: panel for panel in (*panels.CLASSES, *data_panels.CLASSES, *pass_panels.CLASSES)}
    for theirs, name in compat.REPLACED.items():
        panel = getattr(bpy.types, theirs, None)
        if panel is not None:
            assert ours[name].bl_label == panel.bl_label
            assert ours[name].bl_context == getattr(panel, "bl_context", ours[name].bl_context)


def test_named_panels_exist() -> None:
    named = compat.ADDED | compat.UNREAD | compat.REPLACED.keys()
    known = {panel.__name__ for panel in bpy.types.Panel.__subclasses__()}
    if bpy.app.version >= (5, 2):
        assert not named - known
    assert known >= compat.ADDED
    assert {panel.__module__ for panel in bpy.types.Panel.__subclasses__()} >= compat.UNREAD_ROOMS


def _title(panel: Any) -> tuple[str, str]:
    """Tab and label of a panel. Of two in Cycles the tab is that of their parents."""
    tab = "data" if "_CAMERA_PT_" in panel.__name__ else getattr(panel, "bl_context", "")
    return tab, panel.bl_label


@pytest.mark.skipif(
    bpy.app.version < (5, 2) or not hasattr(bpy.types, "CYCLES_LIGHT_PT_light"), reason="needs Cycles of Blender 5.2"
)
def test_every_panel_of_cycles_has_its_like_or_is_listed() -> None:
    kinds = [panel for panel in bpy.types.Panel.__subclasses__() if panel.bl_space_type == "PROPERTIES"]
    theirs = {panel.__name__: _title(panel) for panel in kinds if panel.__name__.startswith("CYCLES_")}
    ours = {_title(panel) for panel in kinds if panel.__name__.startswith("HALFSPACE_PT")}
    ours |= {_title(panel) for panel in kinds if ENGINE in getattr(panel, "COMPAT_ENGINES", ())}
    assert len(theirs) > 60
    assert {name for name, title in theirs.items() if title not in ours and name not in WITHOUT} == set()
    assert set(WITHOUT) - set(theirs) == set()


def test_sampling_comes_before_the_structure() -> None:
    order = [panel.bl_label for panel in panels.CLASSES if not getattr(panel, "bl_parent_id", "")]
    assert order[:3] == ["Sampling", "Light Paths", "Structure"]
    assert max(order.index(label) for label in ("Sampling", "Light Paths")) < order.index("Structure")


def test_light_paths_show_only_what_the_integrator_reads(scene: Any) -> None:
    context = Context(engine=ENGINE, scene=scene)
    for integrator, paths, caustics in (("path", True, True), ("whitted", True, False), ("ao", False, False)):
        scene.halfspace.integrator = integrator
        assert bool(panels.HALFSPACE_PT_light_paths.poll(context)) == paths
        assert bool(panels.HALFSPACE_PT_light_paths_caustics.poll(context)) == caustics
        shown = draw_own(panels.HALFSPACE_PT_light_paths, context) if paths else Layout()
        assert ("secondary_beams" in shown.log) == (integrator == "whitted")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Every property of Blender and of Cycles that a scene has is honoured, named in a note, or listed without an effect.

A property that a newer Blender adds fails until it is one of these.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import pytest

from tests.blender.shapes import cube, material, read
from tests.blender.walking import LIGHTS, OWNERS, Outcome, build, differs, outcome, owners, values

EVERYWHERE = "*"

WITHOUT_EFFECT: dict[str, dict[str, str]] = {
    "identity in Blender's data": {
        EVERYWHERE: "name use_fake_user use_extra_user is_runtime_data tag asset_data",
    },
    "another engine, time or camera; the end of a layer; the objects of another scene": {
        "RenderSettings": "engine",
        "ViewLayer": "use",
        "Scene": "frame_current camera background_set",
    },
    "animation, sound, physics and editing, before Blender evaluates the scene": {
        "Scene": "frame_start frame_end frame_step time_jump_unit time_jump_delta lock_frame_selection_to_range "
        "allow_preroll use_preview_range frame_preview_start frame_preview_end show_subframe "
        "show_keys_from_selected_only use_custom_simulation_range simulation_frame_start simulation_frame_end "
        "sync_mode playback_loop_mode grease_pencil annotation gravity use_gravity use_audio use_audio_scrub "
        "audio_doppler_speed audio_doppler_factor audio_distance_model audio_volume active_clip "
        "wrap_timeline_navigation",
        "Object": "track_axis up_axis use_camera_lock_parent lock_location lock_rotation lock_rotation_w "
        "lock_rotations_4d lock_scale use_simulation_cache use_mesh_mirror_x use_mesh_mirror_y use_mesh_mirror_z "
        "use_shape_key_edit_mode active_shape_key_index active_material_index active_selection_set "
        "add_rest_position_attribute use_parent_final_indices",
        "Mesh": "uv_layer_clone uv_layer_clone_index uv_layer_stencil uv_layer_stencil_index texture_mesh "
        "remesh_voxel_size remesh_voxel_adaptivity use_remesh_fix_poles use_remesh_preserve_volume "
        "use_remesh_preserve_attributes remesh_mode use_mirror_x use_mirror_y use_mirror_z use_mirror_vertex_groups "
        "radial_symmetry use_mirror_topology use_paint_bone_selection use_paint_mask use_paint_mask_vertex",
        "Hair": "surface surface_uv_map use_mirror_x use_mirror_y use_mirror_z selection_domain use_sculpt_collision "
        "surface_collision_distance",
        "Material": "paint_active_slot paint_clone_slot",
    },
    "another property decides, or the scene of this test has nothing that it concerns": {
        "RenderSettings": "simplify_child_particles_render",
        "ViewLayer": "use_volumes",
        "Object": "parent parent_type parent_vertices parent_bone parent_bone_head_tail_factor rotation_quaternion "
        "rotation_axis_angle delta_rotation_quaternion matrix_world matrix_local matrix_basis matrix_parent_inverse "
        "show_instancer_for_render use_instance_vertices_rotation use_instance_faces_scale instance_faces_scale "
        "instance_collection instance_type show_only_shape_key dimensions color",
        "Subdivision": "boundary_smooth use_creases",
        "Material": "diffuse_color roughness metallic use_nodes",
        "World": "color use_nodes",
        "Camera": "sensor_height ortho_scale panorama_type fisheye_fov fisheye_lens latitude_min latitude_max "
        "longitude_min longitude_max fisheye_polynomial_k0 fisheye_polynomial_k1 fisheye_polynomial_k2 "
        "fisheye_polynomial_k3 fisheye_polynomial_k4 central_cylindrical_range_u_min central_cylindrical_range_u_max "
        "central_cylindrical_range_v_min central_cylindrical_range_v_max central_cylindrical_radius custom_filepath "
        "custom_shader custom_mode custom_bytecode custom_bytecode_hash",
        "DOF": "focus_subtarget",
        "Image": "filepath filepath_raw file_format source use_deinterlace use_multiview views_format display_aspect "
        "resolution use_half_precision alpha_mode",
        "Mesh": "texco_mesh use_auto_texspace auto_texspace texspace_location texspace_size",
        "Collection": "instance_offset",
        "Scene": "use_nodes",
        **dict.fromkeys(("POINT", "SPOT"), "use_nodes"),
        "SUN": "use_nodes shadow_soft_size",
        "AREA": "use_nodes shadow_soft_size size_y",
        **dict.fromkeys((f"Cycles of {kind}" for kind in LIGHTS if kind != "AREA"), "is_portal"),
    },
    "Blender's interface and its viewport": {
        "ViewLayer": "active_aov_index active_lightgroup_index active_layer_collection",
        "Camera": "passepartout_alpha display_size show_limits show_mist show_passepartout show_safe_areas "
        "show_safe_center show_name show_sensor show_background_images lens_unit composition_guide_color "
        "show_composition_center show_composition_center_diagonal show_composition_thirds show_composition_golden "
        "show_composition_golden_tria_a show_composition_golden_tria_b show_composition_harmony_tri_a "
        "show_composition_harmony_tri_b",
        "Object": "empty_display_type empty_display_size empty_image_offset empty_image_depth "
        "show_empty_image_perspective show_empty_image_orthographic show_empty_image_only_axis_aligned "
        "use_empty_image_alpha empty_image_side hide_viewport hide_select hide_surface_pick "
        "show_instancer_for_viewport display_type show_bounds display_bounds_type show_name show_axis "
        "show_texture_space show_wire show_all_edges show_transparent show_in_front",
        "Material": "preview_render_type use_preview_world",
        "Collection": "hide_select hide_viewport color_tag active_exporter_index",
        "LayerCollection": "hide_viewport",
        "Subdivision": "show_viewport show_in_editmode show_on_cage show_expanded is_active use_pin_to_last "
        "use_apply_on_spline open_adaptive_subdivision_panel open_advanced_panel show_only_control_edges levels",
        "SPOT": "show_cone",
        "Image": "use_view_as_render seam_margin",
        "RenderSettings": "preview_pixel_size use_lock_interface sequencer_gl_preview simplify_subdivision "
        "simplify_child_particles simplify_volumes use_simplify_normals",
        "Cycles of Scene": "preview_pause texture_resolution texture_limit volume_preview_step_rate "
        "preview_dicing_rate preview_denoising_upscale_quality",
        "Curves of Scene": "",
    },
    "after the render: files, stamps, the sequencer and the compositor": {
        "Scene": "use_stamp_note compositing_node_group",
        "RenderSettings": "ppm_factor ppm_base fps fps_base dither_intensity use_crop_to_border use_placeholder "
        "use_overwrite save_output use_compositing use_sequencer use_file_extension filepath use_render_cache "
        "use_stamp_time use_stamp_date use_stamp_frame use_stamp_frame_range use_stamp_camera use_stamp_lens "
        "use_stamp_scene use_stamp_note use_stamp_marker use_stamp_filename use_stamp_sequencer_strip "
        "use_stamp_render_time stamp_note_text use_stamp use_stamp_labels metadata_input use_stamp_memory "
        "use_stamp_hostname stamp_font_size stamp_foreground stamp_background use_sequencer_override_scene_strip "
        "use_single_layer views_format compositor_device compositor_precision compositor_denoise_device "
        "compositor_denoise_preview_quality compositor_denoise_final_quality use_compositor_frames_cache",
        "ViewLayer": "use_pass_combined",
    },
    "bakes, which have settings of their own": {
        "RenderSettings": "bake_type use_bake_selected_to_active use_bake_clear bake_margin bake_margin_type bake_bias "
        "use_bake_multires use_bake_lores_mesh bake_samples use_bake_user_scale bake_user_scale",
    },
    "grease pencil, Freestyle and line art, which Blender draws": {
        "ViewLayer": "use_grease_pencil use_freestyle",
        "RenderSettings": "line_thickness_mode line_thickness simplify_gpencil simplify_gpencil_onplay "
        "simplify_gpencil_antialiasing simplify_gpencil_view_fill simplify_gpencil_modifier "
        "simplify_gpencil_shader_fx simplify_gpencil_tint",
        "Collection": "lineart_usage lineart_use_intersection_mask lineart_intersection_mask "
        "lineart_intersection_priority use_lineart_intersection_priority",
        "Material": "line_color line_priority",
        "Object": "use_grease_pencil_lights",
    },
    "EEVEE's and Workbench's, which Cycles does not read either": {
        "RenderSettings": "filter_size hair_type hair_subdiv use_high_quality_normals anisotropic_filter",
        "ViewLayer": "pass_alpha_threshold",
        "World": "use_eevee_finite_volume probe_resolution sun_threshold sun_angle use_sun_shadow "
        "sun_shadow_maximum_resolution sun_shadow_filter_radius use_sun_shadow_jitter sun_shadow_jitter_overblur",
        "Visibility of World": "shadow",
        "Object": "hide_probe_volume hide_probe_sphere hide_probe_plane shadow_terminator_normal_offset",
        "Material": "surface_render_method blend_method alpha_threshold use_transparency_overlap show_transparent_back "
        "use_backface_culling use_backface_culling_shadow use_backface_culling_lightprobe_volume "
        "use_raytrace_refraction use_screen_refraction use_sss_translucency refraction_depth thickness_mode "
        "use_thickness_from_shadow volume_intersection_method max_vertex_displacement specular_color "
        "specular_intensity",
        **dict.fromkeys(
            LIGHTS,
            "specular_factor diffuse_factor transmission_factor volume_factor use_custom_distance cutoff_distance "
            "shadow_buffer_clip_start shadow_filter_radius shadow_maximum_resolution use_shadow_jitter "
            "shadow_jitter_overblur use_absolute_resolution shadow_cascade_max_distance shadow_cascade_count "
            "shadow_cascade_exponent shadow_cascade_fade use_square",
        ),
    },
    "Halfspace has a setting of its own": {
        "Cycles of Scene": "use_denoising use_preview_denoising preview_denoising_start_sample samples preview_samples "
        "time_limit use_adaptive_sampling adaptive_threshold adaptive_min_samples use_preview_adaptive_sampling "
        "preview_adaptive_threshold preview_adaptive_min_samples caustics_reflective caustics_refractive blur_glossy "
        "max_bounces diffuse_bounces glossy_bounces transmission_bounces volume_bounces film_exposure "
        "pixel_filter_type filter_width seed use_animated_seed "
        "sample_clamp_direct sample_clamp_indirect bake_type debug_bvh_type debug_use_spatial_splits "
        "debug_use_hair_bvh debug_use_compact_bvh debug_bvh_time_steps debug_bvh_layout",
        "Cycles of Object": "motion_steps",
    },
    "how Cycles samples: its noise and time, not what it converges to": {
        "ViewLayer": "use_pass_cryptomatte_accurate",
        "Cycles of Scene": "use_sample_subset sample_offset sample_subset_length sampling_pattern scrambling_distance "
        "preview_scrambling_distance auto_scrambling_distance use_layer_samples light_sampling_threshold "
        "direct_light_sampling_type use_light_tree min_light_bounces min_transparent_bounces use_guiding "
        "use_deterministic_guiding guiding_distribution_type guiding_directional_sampling_type use_surface_guiding "
        "surface_guiding_probability use_volume_guiding guiding_training_samples volume_guiding_probability "
        "use_guiding_direct_light use_guiding_mis_weights guiding_roughness_threshold use_pixel_jitter",
        "Cycles of World": "sampling_method sample_map_resolution volume_sampling",
        "Cycles of Material": "emission_sampling volume_sampling",
        **dict.fromkeys((f"Cycles of {kind}" for kind in LIGHTS), "use_multiple_importance_sampling"),
    },
    "Cycles' devices, memory and ways of denoising": {
        "Cycles of Scene": "device shading_system feature_set denoiser denoising_prefilter denoising_quality "
        "denoising_input_passes denoising_use_gpu preview_denoiser preview_denoising_prefilter "
        "preview_denoising_quality preview_denoising_input_passes preview_denoising_use_gpu use_auto_tile tile_size "
        "debug_use_cpu_avx2 debug_use_cpu_sse42 debug_use_cuda_adaptive_compile debug_use_optix_debug "
        "debug_use_hip_adaptive_compile debug_use_metal_adaptive_compile debug_use_texture_cache_eviction "
        "debug_texture_cache_preserve_unused",
        "RenderSettings": "use_texture_cache use_auto_generate_texture_cache use_persistent_data",
        "Cycles of ViewLayer": "denoising_pass_follow_reflections denoising_pass_use_albedo_roughness_weighting",
    },
    "the accuracy of steps that Halfspace does not take": {
        "Cycles of Scene": "volume_step_rate volume_max_steps volume_biased",
        "Cycles of World": "volume_interpolation volume_step_size homogeneous_volume",
        "Cycles of Material": "volume_step_rate homogeneous_volume",
        "Curves of Scene": "shape subdivisions",
    },
    "parts of a feature that is named where it is in use": {
        "Cycles of Scene": "fast_gi_method ao_bounces ao_bounces_render",
        "Cycles of Object": "ao_distance",
        "ViewLayer": "use_ao",
        "WorldLighting": "ao_factor distance use_ambient_occlusion",
    },
    "whether and how finely adaptive subdivision dices, see test_dicing.py": {
        "Cycles of Scene": "dicing_rate max_subdivisions dicing_camera offscreen_dicing_scale",
        "Cycles of Object": "use_adaptive_subdivision dicing_rate",
        "Subdivision": "adaptive_space adaptive_pixel_size adaptive_object_edge_length",
    },
    "read by earlier versions of Blender": {
        "Cycles of Object": "shadow_terminator_offset shadow_terminator_geometry_offset",
        "Mist": "use_mist intensity height",
    },
}
"""The properties without an effect on a picture, by the reason, then by the names of `owners`."""


LISTED = {
    (owner, name): reason
    for reason, listed in WITHOUT_EFFECT.items()
    for owner, names in listed.items()
    for name in names.split()
}
"""The reason of each listed property, by its owner's name and its own."""


def reason_for(owner: str, name: str) -> str:
    """Why a property has no effect, "" if it is not listed."""
    return LISTED.get((owner, name)) or LISTED.get((EVERYWHERE, name), "")


def shown(scene: Any, base: Sequence[Outcome], block: Any, name: str) -> str:
    """How another value of a property shows: the first of those tried that shows at all. base: without and with other
    times.
    """
    others = list(values(block, block.bl_rna.properties[name]))
    for moving in (False, True):
        for value in others[: 2 if moving else None]:
            try:
                setattr(block, name, value)
            except (TypeError, AttributeError, ValueError, RuntimeError):
                continue
            if how := differs(base[moving], outcome(scene, moving=moving)):
                return how
    return ""


def restored(scene: Any, base: Sequence[Outcome], block: Any, before: dict[str, Any]) -> Any:
    """The scene with the former values of these properties, made anew if they do not bring it back."""
    for name, value in before.items():
        setattr(block, name, value)
    return build() if differs(base[0], outcome(scene, moving=False)) else scene


def former(block: Any, name: str) -> Any:
    value = getattr(block, name)
    item = block.bl_rna.properties[name]
    return tuple(value) if getattr(item, "is_array", False) else value


def unlisted(block: Any, owner: str) -> list[str]:
    """The properties that a user can set and the table does not list."""
    items = [item for item in block.bl_rna.properties if not item.is_readonly and item.type != "COLLECTION"]
    return [
        item.identifier for item in items if item.identifier != "rna_type" and not reason_for(owner, item.identifier)
    ]


@pytest.mark.parametrize("owner", OWNERS)
def test_no_setting_is_ignored_in_silence(owner: str) -> None:
    scene = build()
    if owner not in owners(scene):
        pytest.skip("this Blender has none")
    base = [outcome(scene, moving=moving) for moving in (False, True)]
    ignored = []
    for name in unlisted(owners(scene)[owner], owner):
        block = owners(scene)[owner]
        before = {name: former(block, name)}
        if not shown(scene, base, block, name):
            ignored.append(name)
        scene = restored(scene, base, block, before)
    assert not ignored, f"of {owner}: honour or name, or list with a reason: {' '.join(ignored)}"


def test_every_owner_is_tested() -> None:
    assert set(owners(build())) <= set(OWNERS)


NODES_WITHOUT_EFFECT = {
    "ShaderNodeLightEvaluation": "mode",  # Blender takes links from it in a material for invalid
    "ShaderNodeMixRGB": "use_alpha",  # nor in Cycles
    "ShaderNodeRaycast": "active_index active_item",  # the node's interface
    "ShaderNodeScript": "script filepath mode use_auto_update bytecode bytecode_hash",  # named where it has outputs
    "ShaderNodeTexIES": "ies",  # texts: see test_lights.py
    "ShaderNodeUVMap": "from_instancer",  # of instances alone
}
"""Properties of shader nodes without an effect on a picture, by the type of the node."""


def node_types() -> list[str]:
    """The types of nodes that a material's tree can have, but for groups and outputs."""
    found = [name for name in dir(bpy.types) if name.startswith("ShaderNode") and name != "ShaderNode"]
    others = ("Group", "Output", "Custom", "Tree")
    return [name for name in found if not any(part in name for part in others)]


def varied(kind: str, output: int = 0, **chosen: Any) -> Any:
    """A node of this type whose inputs vary, as the surface of the only material in use. output: which of its outputs.
    chosen: properties of the node.
    """
    block = bpy.data.materials["Skin"]
    tree = block.node_tree
    tree.nodes.clear()
    noise, place = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexCoord")
    made, end = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    if "image" in made.bl_rna.properties:
        made.image = bpy.data.images["Picture"]
    for name, value in chosen.items():
        setattr(made, name, value)
    for socket in made.inputs:
        if socket.enabled and socket.type in ("VALUE", "RGBA", "VECTOR", "INT"):
            tree.links.new((place if socket.type == "VECTOR" else noise).outputs[0], socket)
    outputs = [socket for socket in made.outputs if socket.enabled]
    result = outputs[output] if output < len(outputs) else None
    if result is not None and result.type != "SHADER":
        glow = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(result, glow.inputs[0])
        result = glow.outputs[0]
    if result is not None:
        volume = "Volume" in kind and "Info" not in kind
        tree.links.new(result, end.inputs["Volume" if volume else "Surface"])
    return made


def ways(kind: str, name: str) -> Iterator[Any]:
    """The node in ways in which a property may have an effect: its other outputs, other choices of its kind."""
    first = varied(kind)
    yield first
    for output in range(1, len([socket for socket in first.outputs if socket.enabled])):
        yield varied(kind, output)
    for other in settable(varied(kind)):
        item = varied(kind).bl_rna.properties[other]
        if item.type == "ENUM" and other != name:
            for value in [one.identifier for one in item.enum_items]:
                try:
                    yield varied(kind, **{other: value})
                except TypeError:
                    continue


def settable(node: Any) -> list[str]:
    """The properties of a node's own type."""
    common = set(bpy.types.ShaderNode.bl_rna.properties.keys())
    items = [item for item in node.bl_rna.properties if item.identifier not in common and not item.is_readonly]
    return [item.identifier for item in items if item.type != "COLLECTION"]


def has_effect(node: Any, name: str) -> bool:
    """Whether another value of a node's property changes what is read, or the node is named."""
    base = read()
    if base[1]:
        return True
    for value in list(values(node, node.bl_rna.properties[name])):
        try:
            setattr(node, name, value)
        except (TypeError, AttributeError, ValueError, RuntimeError):
            continue
        if differs(base, read()):
            return True
    return False


def test_no_property_of_a_node_is_ignored_in_silence(scene: Any, add: Any) -> None:
    mesh = cube()
    mesh.materials.append(material("Skin"))
    bpy.data.images.new("Picture", 2, 2)
    add("Thing", mesh)
    ignored = []
    for kind in node_types():
        for name in settable(varied(kind)):
            listed = name in NODES_WITHOUT_EFFECT.get(kind, "").split()
            if not listed and not any(has_effect(node, name) for node in ways(kind, name)):
                ignored.append(f"{kind}.{name}")
    assert not ignored, " ".join(ignored)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects, lights, cameras and passes with the tests that compare them with Cycles, for docs/nodes.md."""

from collections.abc import Sequence

SUPPORTED, DIFFERS, NOT = "supported", "differs", "not"

ROWS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("Object", "Mesh, displaced mesh", SUPPORTED, ("test_passes_are_those_of_cycles", "test_displaced_surfaces")),
    ("Object", "Adaptive subdivision", DIFFERS, ("test_diced_surfaces",)),
    ("Object", "Hair curves", DIFFERS, ("test_coverage_of_hair", "test_brightness_of_hair")),
    ("Object", "Particle hair", DIFFERS, ("test_particle_hair_with_children",)),
    ("Object", "Point cloud", SUPPORTED, ("test_brightness_of_points",)),
    ("Object", "Volume", DIFFERS, ("test_volume_objects_are_those_of_cycles",)),
    ("Object", "Instances, instancers", SUPPORTED, ("test_attributes_and_places_of_instances_are_those_of_cycles",)),
    ("Object", "Overlapping media", SUPPORTED, ("test_overlapping_instances",)),
    ("Object", "Shadow catcher", DIFFERS, ("test_the_picture_is_that_of_cycles",)),
    ("Object", "Motion by transform", SUPPORTED, ("test_a_moving_object",)),
    ("Object", "Motion by deformation", SUPPORTED, ("test_an_object_that_changes_its_shape",)),
    ("Object", "Without motion blur or deformation", SUPPORTED, ("test_an_object_may_have_no_motion_blur",)),
    ("Object", "Culled by Simplify", SUPPORTED, ("test_objects_out_of_view_are_left_out",)),
    ("Object", "Shadow terminator, geometry offset", SUPPORTED, ("test_the_offset_of_shadow_terminators",)),
    ("Object", "Opaque shadow of a material", SUPPORTED, ("test_a_transparent_surface_may_have_an_opaque_shadow",)),
    ("Object", "Grease pencil", NOT, ("test_grease_pencil_is_drawn_by_blender_and_not_reported",)),
    ("World", "Fog", SUPPORTED, ("test_a_world_of_fog",)),
    ("World", "Max bounces, shadows", SUPPORTED, ("test_light_samples_of_the_world",)),
    ("World", "Volume that varies", NOT, ("test_a_world_of_fog_is_read_and_one_that_varies_is_named",)),
    ("Light", "Point, sun, spot, area", SUPPORTED, ("test_lights_look_as_in_cycles", "test_lights_shine_as_in_cycles")),
    ("Light", "Spread", SUPPORTED, ("test_spread_of_area_lights",)),
    ("Light", "Soft falloff", SUPPORTED, ("test_falloff_of_lights_with_a_radius",)),
    ("Light", "Light and shadow linking", SUPPORTED, ("test_linked_lights",)),
    ("Light", "Max bounces", SUPPORTED, ("test_light_samples_see_a_light_up_to_its_bounces",)),
    ("Light", "Linking of glowing meshes", SUPPORTED, ("test_linked_glowing_objects",)),
    ("Camera", "Perspective, depth of field", SUPPORTED, ("test_objects_out_of_focus_are_blurred_as_in_cycles",)),
    ("Camera", "Panoramic, all kinds", SUPPORTED, ("test_panoramas_are_those_of_cycles",)),
    ("Camera", "Stereo", SUPPORTED, ("test_both_eyes_see_what_they_see_in_cycles",)),
    ("Camera", "Motion", SUPPORTED, ("test_a_moving_and_turning_camera",)),
    ("Camera", "Rolling shutter", SUPPORTED, ("test_a_rolling_shutter",)),
    (
        "Film",
        "Transparent bounces",
        SUPPORTED,
        ("test_as_many_transparent_surfaces_are_passed", "test_shadow_rays_pass_as_many_as_their_paths_left"),
    ),
    ("Film", "Transparent glass", SUPPORTED, ("test_a_transparent_film_sees_through_glass",)),
    ("Pass", "Combined, Depth, Normal, UV, indices", SUPPORTED, ("test_passes_are_those_of_cycles",)),
    ("Pass", "Mist", SUPPORTED, ("test_mist_grows_as_in_cycles",)),
    (
        "Pass",
        "Light passes",
        SUPPORTED,
        ("test_each_light_pass_is_that_of_cycles", "test_light_passes_add_up_to_combined"),
    ),
    ("Pass", "Light groups", SUPPORTED, ("test_groups_have_the_light_that_they_have_in_cycles",)),
    ("Pass", "Cryptomatte", SUPPORTED, ("test_mattes_and_their_metadata_are_those_of_cycles",)),
    ("Pass", "Shader AOVs", SUPPORTED, ("test_materials_write_what_they_write_in_cycles",)),
    ("Pass", "Vector", SUPPORTED, ("test_vectors_are_those_of_cycles",)),
    ("Pass", "Shadow Catcher", SUPPORTED, ("test_the_pass_is_that_of_cycles",)),
    (
        "Baking",
        "Surfaces, light",
        SUPPORTED,
        ("test_surfaces_are_baked_as_in_cycles", "test_light_is_baked_as_in_cycles"),
    ),
)
"""Kind, thing, state and tests. Differences are those that docs/rendering.md lists."""

SECTION = """
## Objects, lights, cameras and passes

*Differs* marks the differences that [rendering](rendering.md) lists; *not* is reported. The tests require means within
1 %, motion and hair those of their comments.
"""


def line(name: str, state: str, tests: Sequence[str]) -> str:
    """A line of a list: a name, its state unless it is supported, and its tests."""
    named = name if state == SUPPORTED else f"{name} (*{state}*)"
    return f"- {named}: {', '.join(f'`{test}`' for test in tests)}" if tests else f"- {named}"


def section() -> str:
    """The section of the page."""
    lines = [SECTION]
    for kind in dict.fromkeys(kind for kind, *_ in ROWS):
        rows = [line(thing, state, tests) for own, thing, state, tests in ROWS if own == kind]
        lines += [f"### {kind}\n", "\n".join(rows) + "\n"]
    return "\n".join(lines)

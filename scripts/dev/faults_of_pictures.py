# SPDX-License-Identifier: GPL-3.0-or-later
"""Deliberate faults of surfaces, cameras and passes: the last of the list."""

from __future__ import annotations

from fault import Fault

_LOBES = "bsdf::tests::lobes"
_LINKED = "shadows::linked_lights_shine_on_their_receivers_and_are_shaded_by_their_blockers"

SURFACES = (
    Fault(
        "light that leaves a sphere of lights bounded at its centre",
        "native/render/src/light/emission.rs",
        "less(beside, [sine, cosine])",
        "less(beside, [0.0 * sine, cosine.max(1.0)])",
        ("lib", "emission::tests::light_that_arrives_is_never_bounded_by_zero"),
    ),
    Fault(
        "a spot's bound without the scale of its matrix",
        "native/render/src/light/shapes/cone.rs",
        "half.tan() * across / along",
        "half.tan()",
        ("lib", "cone::tests::light_leaves_only_into_the_bound"),
    ),
    Fault(
        "lights divided regardless of their directions",
        "native/render/src/light/division.rs",
        "self.emission?.measure()",
        "self.emission.map(|_| 1.0)?",
        ("lib", "division::tests::lights_of_other_directions_are_separated"),
    ),
    Fault(
        "facets seen from the light's side",
        "native/render/src/material/bsdf/facets.rs",
        "facets.d(h) * 0.25 / wi.z",
        "facets.d(h) * 0.25 / wo.z",
        ("lib", f"{_LOBES}::densities_and_values_integrate_to_what_is_sampled"),
    ),
    Fault(
        "sheen sampled on the other side of the normal",
        "native/render/src/material/sheen/mod.rs",
        "w.x - self.b * w.z",
        "w.x + self.b * w.z",
        ("lib", f"{_LOBES}::densities_and_values_integrate_to_what_is_sampled"),
    ),
    Fault(
        "sheen dims what is below by half",
        "native/render/src/material/closure/layering.rs",
        "1.0 - self.color.max_component() * albedo",
        "1.0 - 0.5 * self.color.max_component() * albedo",
        ("lib", f"{_LOBES}::a_furnace_is_white"),
    ),
    Fault(
        "interference with the sign turned over",
        "native/render/src/material/film.rs",
        "2.0 * (back - t)",
        "2.0 * (back + t)",
        ("lib", "film::tests::a_quarter_wave_of_the_geometric_mean_hardly_reflects"),
    ),
    Fault(
        "slopes that are seen turned away from the viewer",
        "native/render/src/material/microfacets.rs",
        "across * s - slope * c",
        "across * s + slope * c",
        ("lib", "microfacets::tests::visible_normals_have_the_stated_density"),
    ),
    Fault(
        "a tangent that is mirrored by its rotation",
        "native/render/src/material/bsdf/layers.rs",
        "x * cos + y * sin",
        "x * cos - y * sin",
        ("lib", f"{_LOBES}::lobes_are_reciprocal_where_the_model_is"),
    ),
    Fault(
        "normals of closures taken for those of the shading frame",
        "native/render/src/material/bsdf/layers.rs",
        "shading.to_local(normal)",
        "shading.to_world(normal)",
        ("lib", f"{_LOBES}::a_closure_with_a_normal_of_its_own_is_lit_from_there"),
    ),
)

_MATTE = "native/render/src/film/matte.rs"
_MOTION = "native/render/src/camera/motion.rs"
_PARTS = "native/render/src/film/light_parts.rs"

PICTURES = (
    Fault(
        "glossy light in the pass of diffuse light",
        _PARTS,
        "light * glossy",
        "light * diffuse",
        ("lib", "film::light_parts::tests::scattered_light_is_divided_without_loss"),
    ),
    Fault(
        "channels without colour stay black",
        _PARTS,
        "quotient.unwrap_or(mean)",
        "quotient.unwrap_or(0.0)",
        ("lib", "film::light_parts::tests::channels_without_colour_take_the_mean_of_the_others"),
    ),
    Fault(
        "the shares of a later surface in the light passes",
        "native/render/src/path/shade/scatter.rs",
        "path.bounce == 0",
        "path.bounce < u16::MAX",
        ("lib", "tests::light_passes::what_a_mirror_shows_is_glossy_light"),
    ),
    Fault(
        "each pass of mattes one rank below the last",
        _MATTE,
        "2 * usize::from(pass.level)",
        "usize::from(pass.level)",
        ("lib", "film::matte::tests::surfaces_are_ranked_by_their_samples_then_by_their_identities"),
    ),
    Fault(
        "surfaces of equal shares in the order of their samples",
        _MATTE,
        "(std::cmp::Reverse(count), identity)",
        "(std::cmp::Reverse(count), 0 * identity)",
        ("lib", "film::matte::tests::surfaces_are_ranked_by_their_samples_then_by_their_identities"),
    ),
    Fault(
        "motion to the picture after instead of from it",
        _MOTION,
        "sign * (x1 - x)",
        "(x1 - x)",
        ("lib", "camera::motion::tests::points_and_cameras_move_the_picture"),
    ),
    Fault(
        "the view from behind in a mirror ball",
        "native/render/src/camera/panorama.rs",
        "normal * (-2.0 * normal.z)",
        "normal * (2.0 * normal.z)",
        ("lib", "camera::panorama::tests::the_centre_looks_ahead_and_the_sides_to_their_sides"),
    ),
    Fault(
        "lamps that the camera sees in every light group",
        "native/render/src/light/mod.rs",
        "group.is_some_and(|group| group != light.group)",
        "group.is_some_and(|_| false)",
        ("lib", "tests::light_passes::lamps_that_the_camera_sees_are_in_their_own_group"),
    ),
    Fault(
        "a spread that dims what it narrows",
        "native/render/src/light/shapes/spread.rs",
        "(1.0 / (wide.tan() - wide)) as f32",
        "(1.0 / wide.tan()) as f32",
        ("lib", "light::shapes::spread::tests::every_spread_emits_the_same_power"),
    ),
    Fault(
        "a sphere's cap of directions as from afar",
        "native/render/src/light/shapes/sphere.rs",
        "s / (1.0 + (1.0 - s).sqrt())",
        "0.5 * s",
        ("lib", "light::shapes::sphere::tests::the_density_covers_the_solid_angle"),
    ),
    Fault(
        "densities of a light that is chosen alone where several are sampled",
        "native/render/src/light/several.rs",
        "each[index] / sum * (sum * (SAMPLES / total)).min(1.0)",
        "each[index] / total",
        ("lib", "light::several::tests::lights_are_sampled_as_often_as_their_probabilities_state"),
    ),
    Fault(
        "half of the solid angle of a near triangle",
        "native/render/src/light/shapes/spherical_triangle.rs",
        "2.0 * volume.atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a))",
        "volume.atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a))",
        ("lib", "light::shapes::spherical_triangle::tests::directions_are_uniform_over_the_triangle"),
    ),
    Fault(
        "half of what a spread shows of an area light",
        "native/render/src/light/shapes/area.rs",
        "(middle + reach).min(half)",
        "middle.min(half)",
        ("lib", "light::shapes::area::tests::samples_cover_what_lights_with_a_spread_emit"),
    ),
    Fault(
        "distances by angle counted as rarer than they are",
        "native/render/src/medium/distance.rs",
        "0.5 * (by_distance + angles.density(distance))",
        "0.5 * (by_distance + 0.5 * angles.density(distance))",
        ("lib", "medium::distance::tests::lit_points_integrate_what_a_segment_scatters"),
    ),
    Fault(
        "lights without regard to their distance from a segment",
        "native/render/src/light/segment.rs",
        "angle.max(1e-7) / height",
        "0.0 * height",
        ("lib", "light::segment::tests::lights_are_chosen_by_probabilities_that_add_up"),
    ),
    Fault(
        "all objects shade linked lights",
        "native/render/src/path/shadow_rays.rs",
        "surface.material.sets.shades(self.aim.blockers)",
        "true",
        ("lib", _LINKED),
    ),
    Fault(
        "linked lights shine on all objects",
        "native/render/src/light/prepared.rs",
        "contains(receiver.sets, self.sets.receivers)",
        "true",
        ("lib", _LINKED),
    ),
    Fault(
        "references of evaluated programs not checked",
        "native/render/src/values/evaluate.rs",
        "usize::from(reference) < count",
        "true",
        ("lib", "values::evaluate::tests::wrong_arrays_and_references_are_named"),
    ),
    Fault(
        "a gradient of noise in lanes without its last case",
        "native/render/src/values/texture/perlin_lanes.rs",
        "(h & 13).simd_eq(12)",
        "(h & 15).simd_eq(12)",
        ("lib", "perlin_lanes::tests::noise_is_that_of_single_points"),
    ),
    Fault(
        "noise in lanes with the octaves of the first point",
        "native/render/src/values/texture/fractal_lanes.rs",
        "one.detail == first.detail",
        "true",
        ("lib", "wide::tests::eight_points_get_the_values_of_each"),
    ),
    Fault(
        "a step in lanes not clamped",
        "native/render/src/values/program/wide.rs",
        "if *clamp { x.map(clamp_unit) } else { x }",
        "x",
        ("lib", "wide::tests::eight_points_get_the_values_of_each"),
    ),
    Fault(
        "hits that get the values of the first of their lanes",
        "native/render/src/path/shade/programs.rs",
        "wide.map(|lanes| lanes[lane])",
        "wide.map(|lanes| lanes[0])",
        ("lib", "programs_ahead::a_picture_is_that_of_its_pixels_one_by_one"),
    ),
    Fault(
        "programs ahead of shading at the wrong distance",
        "native/render/src/path/shade/programs.rs",
        "wave.hits[hit(lane)].t",
        "0.0 * wave.hits[hit(lane)].t",
        ("lib", "programs_ahead::a_picture_is_that_of_its_pixels_one_by_one"),
    ),
)

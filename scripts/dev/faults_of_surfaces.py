# SPDX-License-Identifier: GPL-3.0-or-later
"""Deliberate faults in how surfaces scatter light."""

from __future__ import annotations

from fault import Fault

_LOBES = "bsdf::tests::lobes"

SURFACES = (
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
        "self.normals.frame.to_local(normal)",
        "self.normals.frame.to_world(normal)",
        ("lib", f"{_LOBES}::a_closure_with_a_normal_of_its_own_is_lit_from_there"),
    ),
)

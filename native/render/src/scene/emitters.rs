// SPDX-License-Identifier: GPL-3.0-or-later
//! The emissive triangles of a scene, which are sampled as lights.

use crate::light::EmissiveTriangle;
use crate::material::Material;
use crate::math::vector::Vec3;
use crate::scene::attributes::Attributes;
use crate::values::image::Image;
use crate::values::shading_point::ShadingPoint;
use crate::values::varying::Varying;
use crate::values::view::History;
use crate::values::visibility::RayKind;
use halfspace_ray::Tracer;

/// The parts of the scene that emission depends on.
pub(super) struct EmissionProbe<'a> {
    pub(super) tracer: &'a dyn Tracer,
    pub(super) attributes: &'a Attributes,
    pub(super) materials: &'a [Material],
    pub(super) images: &'a [Image],
    pub(super) varying: &'a Varying,
}

/// Barycentric weights at which a triangle's emission is probed, to estimate its brightness.
const PROBES: [[f32; 3]; 4] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.8, 0.1, 0.1],
    [0.1, 0.8, 0.1],
    [0.1, 0.1, 0.8],
];

/// Largest number of emissive triangles of instances that are lights of their own; chosen: 100 MB of lights.
const MOST_INSTANCED: usize = 1 << 20;

impl EmissionProbe<'_> {
    /// Returns the emissive triangles with an estimate of their radiance; none if instances have more than
    /// [`MOST_INSTANCED`], which only scattered rays find then.
    pub(super) fn emissive_triangles(&self) -> Vec<EmissiveTriangle> {
        let emits: Vec<bool> = self.materials.iter().map(|m| m.emits).collect();
        let mut out = Vec::new();
        if !emits.contains(&true) {
            return out;
        }
        let mut registers = Vec::new();
        let triangles = self.tracer.triangles();
        let live = triangles.map_or(&[][..], |triangles| triangles.live());
        let found = self.attributes.wearing(live, &emits, MOST_INSTANCED);
        for triangle in found.unwrap_or_default() {
            let at = self.attributes.at(triangle);
            let material = &self.materials[at.material()];
            // Average the emission towards the normal over the probes.
            let corners = self.tracer.corners(triangle).map(Vec3::from);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalized();
            let mut sum = 0.0;
            for weights in PROBES {
                // Evaluate the emission along the normal, as a diffuse ray would meet it.
                let point = || ShadingPoint {
                    varying: self.varying,
                    row: at.row(),
                    weights,
                    position: a * weights[0] + b * weights[1] + c * weights[2],
                    normal,
                    length: 1.0,
                    geometric: normal,
                    incoming: normal,
                    inside: false,
                    ray: RayKind::Diffuse,
                    edges: [b - a, c - a],
                    footprint: 0.0,
                    view: None,
                    history: History::default(),
                    probes: 0,
                    around: None,
                    lamp: None,
                };
                let unscattered = material.unscattered_reduced(self.images, point, &mut registers);
                sum += unscattered.emission.mean_abs();
            }
            // A texture may be dark at all probes and emit between them, so keep the estimate positive.
            let lower_bound = if material.has_constant_emission() {
                0.0
            } else {
                1e-3
            };
            out.push(EmissiveTriangle {
                triangle,
                visible: material.visible,
                sets: material.emits_to,
                corners,
                radiance: (sum / PROBES.len() as f32).max(lower_bound),
            });
        }
        out
    }
}

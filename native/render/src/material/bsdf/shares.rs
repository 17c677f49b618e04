// SPDX-License-Identifier: GPL-3.0-or-later
//! The shares of kinds of lobes in the light that a surface scatters, and their colours: for the light passes. Nothing
//! here runs, and nothing is computed for it, unless such a pass is filled.

use crate::film::Shares;
use crate::material::bsdf::lobe::Shape;
use crate::material::bsdf::{Boundary, Bsdf, Scatter};
use crate::material::closure::Reflected;
use crate::math::fresnel;
use crate::math::vector::Vec3;
use crate::settings::LobeKind;
use crate::values::visibility::{RayKind, Visibility};

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// Returns the shares of the lobes in the light from direction `wo`, restricted to the lobes that see a light of
    /// this visibility.
    #[cold]
    #[inline(never)]
    pub fn shares(&self, wo: Vec3, visible: Visibility) -> Shares {
        let refracting = visible.without(RayKind::Transmission);
        let (diffuse, _) = self.eval_lit(wo, refracting.without(RayKind::Glossy));
        let (glossy, _) = self.eval_lit(wo, refracting.without(RayKind::Diffuse));
        let (all, _) = self.eval_lit(wo, visible);
        Shares::of(diffuse, glossy, all)
    }

    /// Returns the shares of the lobes in a sampled direction.
    #[cold]
    #[inline(never)]
    pub fn shares_of(&self, scatter: &Scatter) -> Shares {
        if scatter.pdf.is_finite() {
            return self.shares(scatter.wo, Visibility::ALL);
        }
        // Mirrors and windows are sampled alone.
        Shares::only(match scatter.kind {
            RayKind::Glossy => LobeKind::Glossy,
            RayKind::Transmission => LobeKind::Transmission,
            RayKind::Diffuse
            | RayKind::Camera
            | RayKind::Shadow
            | RayKind::Volume
            | RayKind::Plain => LobeKind::Diffuse,
        })
    }

    /// Returns the mean reflectance of the facets of a boundary that are seen; for a constant tint that of a smooth
    /// boundary, as in Cycles.
    fn mean_reflectance(&self, boundary: &Boundary) -> f32 {
        let at = |cos: f32| fresnel::dielectric(cos, boundary.eta).0;
        if boundary.smooth || !matches!(boundary.reflect, Some(Reflected::Dielectric { .. })) {
            return at(self.wi.z);
        }
        // Average over facets in 4 × 4 strata of the directions that sampling finds.
        let mut sum = 0.0;
        for i in 0..16_u8 {
            let u = [i % 4, i / 4].map(|k| (f32::from(k) + 0.5) / 4.0);
            let facet = boundary.ggx.sample_visible(self.wi, u);
            sum += at(self.wi.dot(facet));
        }
        sum / 16.0
    }

    /// Returns the mean roughness of the lobes by their weights, as in Cycles: that of Lambertian and translucent lobes
    /// does not count, and without other lobes it is 1.
    #[cold]
    #[inline(never)]
    pub fn roughness(&self) -> f32 {
        let (mut sum, mut weights) = (0.0, 0.0);
        let mut add = |weight: Vec3, roughness: f32| {
            sum += weight.mean_abs() * roughness;
            weights += weight.mean_abs();
        };
        // The roughness is the square root of the width.
        for facets in &self.facets[..self.facet_count] {
            add(facets.scale, facets.ggx.alpha2.sqrt().sqrt());
        }
        for boundary in &self.boundaries[..self.boundary_count] {
            add(boundary.scale, boundary.ggx.alpha2.sqrt().sqrt());
        }
        for rough in &self.rough[..self.rough_count] {
            add(rough.weight, rough.roughness());
        }
        for lobe in self.own_lobes() {
            match &lobe.shape {
                Shape::Facets(facets, _) | Shape::Boundary(facets, _) => {
                    let [a, b] = facets.width;
                    add(lobe.scale, (a * b).sqrt().sqrt());
                }
                Shape::Rough(rough) => add(rough.weight * lobe.scale, rough.roughness()),
                Shape::ToonGlossy(_) => add(lobe.scale, 1.0),
                _ => {}
            }
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }

    /// Whether a lobe that refracts is at most this rough.
    #[cold]
    #[inline(never)]
    pub fn is_clear(&self, roughness: f32) -> bool {
        // The width is the square of the roughness.
        let most = roughness * roughness;
        let boundaries = &self.boundaries[..self.boundary_count];
        boundaries.iter().any(|b| b.ggx.alpha2.sqrt() <= most)
            || self.own_lobes().iter().any(|lobe| match &lobe.shape {
                Shape::Boundary(facets, _) => (facets.width[0] * facets.width[1]).sqrt() <= most,
                _ => false,
            })
    }

    /// Returns the albedos of the diffuse, glossy and transmitting lobes at the viewing direction, as in Cycles:
    /// refraction as if it were smooth, rough diffuse lobes as if they were Lambertian.
    #[cold]
    #[inline(never)]
    pub fn colors(&self) -> [Vec3; 3] {
        let mut diffuse = self.diffuse + self.translucent;
        for rough in &self.rough[..self.rough_count] {
            diffuse += rough.weight;
        }
        // The probability of a lobe is its share of the estimated energy, so its albedo has that mean.
        let scaled = |color: Vec3, energy: f32| color * (energy / color.mean().max(1e-12));
        let mut glossy = Vec3::ZERO;
        for facets in &self.facets[..self.facet_count] {
            let color = facets.fresnel.at(self.wi.z) * facets.scale;
            glossy += scaled(color, facets.p * self.energy);
        }
        // A boundary divides its weight between reflection and refraction.
        let mut transmitted = Vec3::ZERO;
        for boundary in &self.boundaries[..self.boundary_count] {
            let weight = scaled(boundary.scale, boundary.p * self.energy);
            let (reflectance, _) = fresnel::dielectric(self.wi.z, boundary.eta);
            glossy += weight * boundary.reflected(self.mean_reflectance(boundary));
            transmitted += weight * boundary.passed(reflectance);
        }
        for lobe in self.own_lobes() {
            let energy = lobe.p * self.energy;
            match &lobe.shape {
                Shape::Facets(_, reflectance) => {
                    glossy += scaled(reflectance.at(lobe.wi.z) * lobe.scale, energy);
                }
                Shape::Fiber(fiber) => glossy += lobe.scale * fiber.albedo(),
                Shape::Strand(strand) if strand.transmits => transmitted += lobe.scale,
                Shape::Strand(_) => glossy += lobe.scale,
                Shape::ToonGlossy(_) => glossy += scaled(lobe.scale, energy),
                Shape::Boundary(_, interface) => {
                    let (weight, split) = (scaled(lobe.scale, energy), interface.split(lobe.wi.z));
                    glossy += weight * split.reflected;
                    transmitted += weight * split.passed;
                }
                Shape::Rough(rough) => diffuse += rough.weight * lobe.scale,
                _ => diffuse += scaled(lobe.scale, energy),
            }
        }
        [diffuse, glossy, transmitted]
    }
}

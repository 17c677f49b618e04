// SPDX-License-Identifier: GPL-3.0-or-later
//! Facets in the frame of a lobe: their normals, reflection and refraction.

use std::f32::consts::TAU;

use crate::material::bsdf::Interface;
use crate::material::bsdf::lobe::UP;
use crate::material::closure::Reflected;
use crate::material::microfacets::{Distribution, Microfacets};
use crate::math::fresnel;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};

/// Exponents of Ashikhmin and Shirley's lobe for these widths.
fn exponents(facets: &Microfacets) -> [f32; 2] {
    facets
        .width
        .map(|w| (2.0 / (w * w).max(1e-9) - 2.0).max(0.0))
}

/// Samples a facet's normal.
pub(super) fn facet(facets: &Microfacets, wi: Vec3, u: [f32; 2]) -> Vec3 {
    if facets.distribution != Distribution::AshikhminShirley {
        return facets.sample_visible(wi, u);
    }
    // Ashikhmin and Shirley 2000, eq. 9 and 10: the azimuth of elliptical highlights, then the angle.
    let [nx, ny] = exponents(facets);
    let (s, c) = sin_cos_turns(u[0]);
    let stretched = vec3(c * (ny + 1.0).sqrt(), s * (nx + 1.0).sqrt(), 0.0);
    let across = stretched.normalized_or(vec3(1.0, 0.0, 0.0));
    let exponent = nx * across.x * across.x + ny * across.y * across.y;
    let z = (1.0 - u[1]).powf(1.0 / (exponent + 1.0));
    let r = (1.0 - z * z).max(0.0).sqrt();
    vec3(r * across.x, r * across.y, z)
}

/// Returns BSDF × cosine and density of facets that reflect. `reflectance`: at the cosine to the facet, and the
/// probability of reflection there.
pub(super) fn reflected(
    facets: &Microfacets,
    wi: Vec3,
    wo: Vec3,
    reflectance: impl Fn(f32) -> (Vec3, f32),
) -> (Vec3, f32) {
    if wo.z <= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let h = (wi + wo).normalized_or(UP);
    let c = wi.dot(h);
    let (color, share) = reflectance(c);
    if facets.distribution == Distribution::AshikhminShirley {
        // Density of the facet's normal: eq. 4 and 6 without the Fresnel factor.
        let [nx, ny] = exponents(facets);
        let sin2 = (1.0 - h.z * h.z).max(1e-12);
        let exponent = (nx * h.x * h.x + ny * h.y * h.y) / sin2;
        let density = ((nx + 1.0) * (ny + 1.0)).sqrt() / TAU * h.z.max(0.0).powf(exponent);
        let pdf = 0.25 * density / c.max(1e-6);
        let value = 0.25 * density * wo.z / (c * wi.z.max(wo.z)).max(1e-6);
        return (color * value, pdf * share);
    }
    let lambda = facets.lambda(wi);
    let common = facets.d(h) * 0.25 / wi.z;
    let value = common / (1.0 + lambda + facets.lambda(wo));
    (color * value, common / (1.0 + lambda) * share)
}

/// Returns BSDF × |cosine| and density of facets that refract: Walter et al. 2007, eq. 21.
pub(super) fn refracted(
    facets: &Microfacets,
    interface: &Interface,
    wi: Vec3,
    wo: Vec3,
) -> (Vec3, f32) {
    let eta = interface.eta;
    let sum = -(wo * eta + wi);
    let inverse_length = 1.0 / sum.length().max(1e-20);
    let h = sum * inverse_length;
    let h = if h.z < 0.0 { -h } else { h };
    let (c, ct) = (wi.dot(h), wo.dot(h));
    if c <= 0.0 || ct >= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    let split = interface.split(c);
    let jacobian = eta * inverse_length;
    let common = facets.d(h) / wi.z * jacobian * jacobian * (c * ct).abs();
    let lambda = facets.lambda(wi);
    let value = common / (1.0 + lambda + facets.lambda(wo));
    let pdf = common / (1.0 + lambda) * (1.0 - split.reflect_probability());
    (split.passed * value, pdf)
}

/// How a boundary divides light at a facet.
pub struct Split {
    /// Reflected colour.
    pub reflected: Vec3,
    /// Transmitted colour.
    pub passed: Vec3,
    /// Cosine of the refracted ray; 0 under total reflection.
    pub cos_t: f32,
}

impl Split {
    /// Returns the share of samples that reflect, in proportion to the energy of the two parts.
    pub fn reflect_probability(&self) -> f32 {
        let (reflected, passed) = (self.reflected.mean(), self.passed.mean());
        if reflected + passed > 0.0 {
            reflected / (reflected + passed)
        } else {
            1.0
        }
    }
}

impl Interface {
    /// Whether the index is so close to 1 that the half vector is undefined.
    pub fn is_window(&self) -> bool {
        (self.eta - 1.0).abs() < 1e-4
    }

    /// Returns how light that meets a facet at this cosine is divided.
    pub fn split(&self, c: f32) -> Split {
        let (f, cos_t) = fresnel::dielectric(c, self.eta);
        let Some(film) = &self.film else {
            let reflected = match self.reflect {
                Some(reflect) if self.reflections => reflect.at(f),
                _ => Vec3::ZERO,
            };
            let passed = match self.reflect {
                None => self.tint,
                Some(reflect) => self.tint * reflect.rest(f),
            };
            return Split {
                reflected,
                passed,
                cos_t,
            };
        };
        // The film's colour replaces the reflectance of the boundary.
        let [reflected, rest] = match self.reflect {
            None => [Vec3::ZERO, Vec3::ONE],
            Some(Reflected::Alike(color)) => {
                let f = film.over_dielectric(c, self.eta);
                [f * color, Vec3::ONE - f]
            }
            Some(Reflected::Dielectric { own, f0, .. }) => {
                let f = film.tinted(c, self.eta, f0 * (1.0 / own.max(1e-12)));
                [f, Vec3::ONE - f]
            }
        };
        let reflected = if self.reflections {
            reflected
        } else {
            Vec3::ZERO
        };
        let passed = self.tint * rest;
        Split {
            reflected,
            passed,
            cos_t,
        }
    }
}

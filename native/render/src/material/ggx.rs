// SPDX-License-Identifier: GPL-3.0-or-later
//! The GGX distribution of microfacets with Smith's height-correlated masking, in a frame whose z axis is the
//! shading normal. Walter et al. 2007; Heitz 2014, eq. 72 and §5.3.

use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};

/// Squared widths up to this count as perfectly smooth, as in Cycles.
const SMOOTH: f32 = 2e-10;

/// An isotropic GGX distribution of width `alpha` = roughness².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ggx {
    /// Width of the distribution, squared.
    pub alpha2: f32,
    alpha: f32,
}

impl Ggx {
    /// A perfectly smooth surface.
    pub const MIRROR: Self = Self {
        alpha2: 0.0,
        alpha: 0.0,
    };

    /// The distribution for a roughness in 0..1, as the Principled BSDF defines it.
    pub fn new(roughness: f32) -> Self {
        let alpha = roughness * roughness;
        Self {
            alpha2: alpha * alpha,
            alpha,
        }
    }

    /// The distribution with a width of at least `alpha`.
    #[inline(always)]
    pub fn widened(self, alpha: f32) -> Self {
        if self.alpha >= alpha {
            return self;
        }
        Self {
            alpha2: alpha * alpha,
            alpha,
        }
    }

    /// Whether the surface acts as a perfect mirror or window. The methods below must then not be called.
    #[inline(always)]
    pub fn is_smooth(self) -> bool {
        self.alpha2 <= SMOOTH
    }

    /// Returns the density of facets with normal `h`. The sine comes from the components of `h`, because 1 - cos²
    /// cancels all digits for narrow distributions.
    #[inline(always)]
    pub fn d(self, h: Vec3) -> f32 {
        let t = h.x * h.x + h.y * h.y + self.alpha2 * h.z * h.z;
        self.alpha2 / (std::f32::consts::PI * t * t)
    }

    /// Returns Smith's Λ for a direction with this cosine.
    #[inline(always)]
    pub fn lambda(self, cos: f32) -> f32 {
        let c2 = cos * cos;
        0.5 * ((1.0 + self.alpha2 * (1.0 - c2).max(0.0) / c2).sqrt() - 1.0)
    }

    /// Samples a facet normal visible from `wi` (z > 0), with density D(h) G1(wi) max(0, wi·h) / wi.z. Heitz 2018,
    /// "Sampling the GGX Distribution of Visible Normals", listing 1, in the spherical cap form of Dupuy and
    /// Benyoub 2023, listing 3.
    #[inline(always)]
    pub fn sample_visible(self, wi: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch the view to a surface of roughness 1, whose visible normals follow from a uniform spherical cap.
        let stretched = vec3(self.alpha * wi.x, self.alpha * wi.y, wi.z);
        let stretched = stretched * (1.0 / stretched.length());
        // Sample the spherical cap, and add the view to get the half vector.
        let z = (1.0 - u[1]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = sin_cos_turns(u[0]);
        let h = vec3(r * cos, r * sin, z) + stretched;
        // Undo the stretch; normals transform by the inverse transpose.
        let h = vec3(self.alpha * h.x, self.alpha * h.y, h.z.max(0.0));
        h.normalized_or(vec3(0.0, 0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visible_normals_have_the_stated_density() {
        for roughness in [0.3, 0.7, 1.0] {
            let g = Ggx::new(roughness);
            for cos in [0.3_f32, 0.6, 1.0] {
                let wi = vec3((1.0 - cos * cos).sqrt(), 0.0, cos);
                // Check that the density integrates to 1 over the hemisphere.
                let n = 600;
                let mut sum = 0.0_f64;
                for i in 0..n {
                    for j in 0..n {
                        // Uniform steps of s2 sample D cos. They are squeezed towards the horizon, where the
                        // integrand grows like 1 / √(1 - s2).
                        let rest = 1.0 - (i as f32 + 0.5) / n as f32;
                        let s2 = 1.0 - rest * rest;
                        let phi = std::f32::consts::TAU * (j as f32 + 0.5) / n as f32;
                        let tan2 = g.alpha2 * s2 / (1.0 - s2);
                        let c = (1.0 / (1.0 + tan2)).sqrt();
                        let s = (1.0 - c * c).sqrt();
                        let h = vec3(s * phi.cos(), s * phi.sin(), c);
                        // With this map, D cos dω = ds2 dphi / 2π.
                        let visible = wi.dot(h).max(0.0) / (c * cos * (1.0 + g.lambda(cos)));
                        sum += f64::from(visible * 2.0 * rest);
                    }
                }
                let integral = sum / f64::from(n * n);
                assert!(
                    (integral - 1.0).abs() < 2e-3,
                    "{roughness} {cos}: {integral}"
                );
                // Check that the sampled mean of the normal's cosine equals that of the integral.
                let m = 256;
                let (mut sampled, mut exact) = (0.0_f64, 0.0_f64);
                for i in 0..m {
                    for j in 0..m {
                        let u = [(i as f32 + 0.5) / m as f32, (j as f32 + 0.5) / m as f32];
                        sampled += f64::from(g.sample_visible(wi, u).z);
                        let tan2 = g.alpha2 * u[0] / (1.0 - u[0]);
                        let c = (1.0 / (1.0 + tan2)).sqrt();
                        let s = (1.0 - c * c).sqrt();
                        let phi = std::f32::consts::TAU * u[1];
                        let h = vec3(s * phi.cos(), s * phi.sin(), c);
                        exact += f64::from(wi.dot(h).max(0.0) / (cos * (1.0 + g.lambda(cos))));
                    }
                }
                let scale = f64::from(m * m);
                assert!(
                    (sampled / scale - exact / scale).abs() < 4e-3,
                    "{roughness} {cos}: {} {}",
                    sampled / scale,
                    exact / scale
                );
            }
        }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! Distributions of microfacets with two widths, in a frame whose z axis is the normal and whose x axis is the
//! tangent: GGX and Beckmann with Smith's height-correlated masking. Heitz 2014, "Understanding the Masking-Shadowing
//! Function in Microfacet-Based BRDFs", eq. 72 and §5.4.

use std::f32::consts::PI;

use crate::math::erf::{erf, inverse_erf};
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};

/// The kind of a distribution of microfacets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// Trowbridge and Reitz's.
    #[default]
    Ggx,
    /// Beckmann and Spizzichino's.
    Beckmann,
    /// The model of Ashikhmin and Shirley 2000, which has no masking by Smith.
    AshikhminShirley,
}

/// Products of both widths up to this count as perfectly smooth, as in Cycles.
const SMOOTH: f32 = 2e-10;

/// Least width of a distribution that is not smooth, so that squares do not underflow.
const LEAST: f32 = 1e-6;

/// A distribution of microfacets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Microfacets {
    /// Its kind.
    pub distribution: Distribution,
    /// Widths along the tangent and across.
    pub width: [f32; 2],
}

impl Microfacets {
    /// The distribution with widths of at least `least`.
    pub fn new(distribution: Distribution, width: [f32; 2], least: f32) -> Self {
        Self {
            distribution,
            width: width.map(|w| w.max(least)),
        }
    }

    /// Whether the surface acts as a perfect mirror or window. The methods below must then not be called.
    pub fn is_smooth(&self) -> bool {
        self.width[0] * self.width[1] <= SMOOTH
    }

    /// The widths, at least [`LEAST`].
    fn widths(&self) -> [f32; 2] {
        self.width.map(|w| w.max(LEAST))
    }

    /// Returns the density of facets with normal `h`.
    pub fn d(&self, h: Vec3) -> f32 {
        let [ax, ay] = self.widths();
        let (x, y) = (h.x / ax, h.y / ay);
        match self.distribution {
            Distribution::Beckmann => {
                let c2 = (h.z * h.z).max(1e-12);
                (-(x * x + y * y) / c2).exp() / (PI * ax * ay * c2 * c2)
            }
            _ => {
                let t = x * x + y * y + h.z * h.z;
                1.0 / (PI * ax * ay * t * t)
            }
        }
    }

    /// Returns Smith's Λ for a direction.
    pub fn lambda(&self, w: Vec3) -> f32 {
        let [ax, ay] = self.widths();
        let across2 = ax * ax * w.x * w.x + ay * ay * w.y * w.y;
        match self.distribution {
            Distribution::Beckmann => {
                // Reciprocal of width times tangent; beyond 4 the result is below 1e-8.
                let a = w.z.abs() / across2.sqrt().max(1e-20);
                if a > 4.0 {
                    return 0.0;
                }
                let a = a.max(1e-6);
                0.5 * ((-a * a).exp() / (a * PI.sqrt()) - (1.0 - erf(a)))
            }
            _ => 0.5 * ((1.0 + across2 / (w.z * w.z).max(1e-20)).sqrt() - 1.0),
        }
    }

    /// Samples a facet normal visible from `wi` (z > 0), with density D(h) G1(wi) max(0, wi·h) / wi.z.
    pub fn sample_visible(&self, wi: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch the view to a surface of widths 1, and undo the stretch for the normal found there.
        let [ax, ay] = self.widths();
        let up = vec3(0.0, 0.0, 1.0);
        let stretched = vec3(ax * wi.x, ay * wi.y, wi.z).normalized_or(up);
        let h = match self.distribution {
            Distribution::Beckmann => visible_slopes(stretched, u),
            _ => visible_cap(stretched, u),
        };
        vec3(ax * h.x, ay * h.y, h.z.max(0.0)).normalized_or(up)
    }
}

/// Samples a visible normal of GGX of width 1, not normalised: Dupuy and Benyoub 2023, listing 3.
fn visible_cap(wi: Vec3, u: [f32; 2]) -> Vec3 {
    let z = (1.0 - u[1]) * (1.0 + wi.z) - wi.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u[0]);
    vec3(r * cos, r * sin, z) + wi
}

/// Samples a visible normal of Beckmann's distribution of width 1, with z = 1: Heitz and d'Eon 2014, "Importance
/// Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals", with the inversion by Newton's method
/// in the error function of the slope after Jakob 2014, "An Improved Visible Normal Sampling Routine for the Beckmann
/// Distribution".
fn visible_slopes(wi: Vec3, u: [f32; 2]) -> Vec3 {
    let sin = (wi.x * wi.x + wi.y * wi.y).sqrt();
    // Seen from above all slopes are visible alike.
    if sin < 1e-4 {
        let r = (-(1.0 - u[0]).max(1e-30).ln()).max(0.0).sqrt();
        let (s, c) = sin_cos_turns(u[1]);
        return vec3(r * c, r * s, 1.0);
    }
    // Slopes towards the viewer up to the cotangent are visible; invert their cumulative distribution.
    let tangent = sin / wi.z.max(1e-6);
    let cotangent = 1.0 / tangent;
    let grazing = tangent / PI.sqrt();
    let last = erf(cotangent);
    let total = 1.0 + last + grazing * (-cotangent * cotangent).exp();
    let want = u[0].clamp(1e-6, 1.0 - 1e-6) * total;
    let (mut low, mut high) = (-1.0_f32, last);
    let mut b = 0.5 * (low + high);
    let mut slope = inverse_erf(b);
    for _ in 0..24 {
        // Keep the root bracketed: bisect where Newton's step leaves the bracket.
        let excess = 1.0 + b + grazing * (-slope * slope).exp() - want;
        if excess.abs() < 1e-6 * total {
            break;
        }
        if excess > 0.0 {
            high = b;
        } else {
            low = b;
        }
        let next = b - excess / (1.0 - slope * tangent);
        b = if next > low && next < high {
            next
        } else {
            0.5 * (low + high)
        };
        slope = inverse_erf(b);
    }
    // The slope across is independent; rotate both to the viewer's azimuth.
    let across = inverse_erf((2.0 * u[1] - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6));
    let (c, s) = (wi.x / sin, wi.y / sin);
    vec3(across * s - slope * c, -slope * s - across * c, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The direction with this cosine and azimuth in turns.
    fn direction(cos: f32, turns: f32) -> Vec3 {
        let (s, c) = sin_cos_turns(turns);
        let r = (1.0 - cos * cos).sqrt();
        vec3(r * c, r * s, cos)
    }

    #[test]
    fn visible_normals_have_the_stated_density() {
        for distribution in [Distribution::Ggx, Distribution::Beckmann] {
            for width in [[0.3, 0.3], [0.2, 0.8]] {
                let facets = Microfacets::new(distribution, width, 0.0);
                for (cos, turns) in [(0.3_f32, 0.1), (0.7, 0.4), (1.0, 0.0)] {
                    let wi = direction(cos, turns);
                    check(&facets, wi);
                }
            }
        }
    }

    /// Compares moments of sampled normals with integrals over the stated density.
    fn check(facets: &Microfacets, wi: Vec3) {
        let n = 700;
        let seen = 1.0 / (wi.z * (1.0 + facets.lambda(wi)));
        let (mut exact, mut sampled) = ([0.0_f64; 4], [0.0_f64; 4]);
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32];
                // Uniform in z and azimuth: the solid angle of the hemisphere.
                let h = direction(u[0] * u[0], u[1]);
                let density = facets.d(h) * wi.dot(h).max(0.0) * seen;
                let weight = f64::from(density) * f64::from(2.0 * u[0]) * std::f64::consts::TAU;
                let moments = |h: Vec3| [1.0, h.x, h.y * h.y, h.z].map(f64::from);
                for (sum, m) in exact.iter_mut().zip(moments(h)) {
                    *sum += weight * m;
                }
                for (sum, m) in sampled
                    .iter_mut()
                    .zip(moments(facets.sample_visible(wi, u)))
                {
                    *sum += m;
                }
            }
        }
        let count = f64::from(n * n);
        for k in 0..4 {
            let (e, s) = (exact[k] / count, sampled[k] / count);
            assert!(
                (e - s).abs() < 4e-3,
                "{facets:?} {wi:?} moment {k}: {e} {s}"
            );
        }
    }

    #[test]
    fn equal_widths_are_the_isotropic_distribution() {
        let one = crate::material::ggx::Ggx::new(0.6);
        let facets = Microfacets::new(Distribution::Ggx, [0.36, 0.36], 0.0);
        for (cos, turns) in [(0.2, 0.3), (0.9, 0.8)] {
            let w = direction(cos, turns);
            assert!((facets.d(w) / one.d(w) - 1.0).abs() < 1e-5);
            assert!((facets.lambda(w) / one.lambda(cos) - 1.0).abs() < 1e-4);
        }
    }
}

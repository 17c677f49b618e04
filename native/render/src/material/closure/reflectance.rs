// SPDX-License-Identifier: GPL-3.0-or-later
//! Reflectance of facets and boundaries, and its colour.

use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};

/// Reflectance of a facet as a function of the cosine.
#[derive(Debug, Clone, Copy)]
pub enum Fresnel {
    /// f0 + (edge - f0) (1 - c)⁵ - dip c (1 - c)⁶: Schlick's curve with a tinted edge.
    Metal {
        /// Reflectance at normal incidence.
        f0: Vec3,
        /// Reflectance at grazing incidence.
        edge: Vec3,
        /// Coefficient of the edge tint, see `edge_dip`.
        dip: Vec3,
    },
    /// A dielectric boundary whose reflectance `own` at normal incidence is replaced by `f0`.
    Dielectric {
        /// Relative index.
        eta: f32,
        /// Reflectance of the index `eta` at normal incidence.
        own: f32,
        /// Lower bound of the reflectance before the replacement.
        lower_bound: f32,
        /// Reflectance wanted at normal incidence, at most 1.
        f0: Vec3,
    },
}

impl Fresnel {
    /// A dielectric boundary of relative index `eta` whose reflection is tinted.
    pub fn dielectric(eta: f32, tint: Vec3) -> Self {
        let own = fresnel::f0_from_ior(eta);
        Self::Dielectric {
            eta,
            own,
            lower_bound: fresnel::min_reflectance(eta),
            f0: (tint * own).map(|x| x.min(1.0)),
        }
    }

    /// Schlick's curve through the reflectance of a conductor at normal incidence and at cosine 1/7, for estimates.
    pub fn like_conductor(n: Vec3, k: Vec3) -> Self {
        let f0 = conductor(1.0, n, k).map(|f| f.clamp(0.0, 1.0));
        let low = conductor(1.0 / 7.0, n, k);
        let m5 = (6.0_f32 / 7.0).powi(5);
        let plain = f0 + (Vec3::ONE - f0) * m5;
        Self::Metal {
            f0,
            edge: Vec3::ONE,
            dip: (plain - low) * (7.0 / (m5 * 6.0 / 7.0)),
        }
    }

    /// Returns the index of the boundary; 1 for metal.
    #[inline(always)]
    pub fn index(&self) -> f32 {
        match *self {
            Self::Dielectric { eta, .. } => eta,
            Self::Metal { .. } => 1.0,
        }
    }

    /// Returns the reflectance at a cosine.
    #[inline(always)]
    pub fn at(&self, c: f32) -> Vec3 {
        match *self {
            Self::Metal { f0, edge, dip } => {
                // Schlick's curve, lowered near the edge.
                let m = (1.0 - c).clamp(0.0, 1.0);
                let m5 = m * m * m * m * m;
                f0 + (edge - f0) * m5 - dip * (c * m5 * m)
            }
            Self::Dielectric {
                eta,
                own,
                lower_bound,
                f0,
            } => {
                // Fresnel's equations, then the replacement of the value at normal incidence.
                let f = fresnel::dielectric(c, eta).0;
                tinted(f.max(lower_bound), own, f0)
            }
        }
    }

    /// Returns the cosine-weighted mean over the hemisphere. `of_index`: returns that of an untinted dielectric.
    pub fn mean(&self, of_index: impl Fn(f32) -> f32) -> Vec3 {
        match *self {
            // The integrals over 0..1 of 2 c (1 - c)⁵ and 2 c² (1 - c)⁶ are 1/21 and 1/126.
            Self::Metal { f0, edge, dip } => f0 + (edge - f0) * (1.0 / 21.0) - dip * (1.0 / 126.0),
            Self::Dielectric {
                eta,
                own,
                lower_bound,
                f0,
            } => tinted(of_index(eta).max(lower_bound), own, f0),
        }
    }
}

/// Replaces a dielectric's reflectance `own` at normal incidence by `f0` and keeps total reflection at 1. `f`: the
/// reflectance before; the result is linear in `f`, so the same function maps means.
#[inline(always)]
fn tinted(f: f32, own: f32, f0: Vec3) -> Vec3 {
    let rest = (f - own) / (1.0 - own).max(1e-6);
    f0 * (1.0 - rest) + Vec3::splat(rest)
}

/// Colour of the light that a boundary reflects.
#[derive(Debug, Clone, Copy)]
pub enum Reflected {
    /// Constant tint; it does not change the transmitted part.
    Alike(Vec3),
    /// Reflectance `own` at normal incidence replaced by `f0`, as for [`Fresnel::Dielectric`]; what is not
    /// reflected is transmitted.
    Dielectric {
        /// Reflectance of the index at normal incidence.
        own: f32,
        /// Lower bound of the reflectance before the replacement.
        lower_bound: f32,
        /// Reflectance wanted at normal incidence, at most 1.
        f0: Vec3,
    },
}

impl Reflected {
    /// Returns the reflected colour where the Fresnel reflectance is `reflectance`.
    #[inline(always)]
    pub fn at(&self, reflectance: f32) -> Vec3 {
        match *self {
            Self::Alike(color) => color * reflectance,
            Self::Dielectric {
                own,
                lower_bound,
                f0,
            } => tinted(reflectance.max(lower_bound), own, f0),
        }
    }

    /// Returns the fraction that is left for transmission.
    #[inline(always)]
    pub fn rest(&self, reflectance: f32) -> Vec3 {
        match self {
            Self::Alike(_) => Vec3::splat(1.0 - reflectance),
            Self::Dielectric { .. } => Vec3::ONE - self.at(reflectance),
        }
    }
}

/// Returns the unpolarised reflectance of a conductor with index of refraction `n` and extinction coefficient `k`
/// at a cosine: the Fresnel equations for a complex index, as in Born and Wolf 1999, §14.2.
pub fn conductor(cos: f32, n: Vec3, k: Vec3) -> Vec3 {
    let channel = |n: f32, k: f32| {
        // Cosine of the complex angle inside, times the index: a + ib.
        let c2 = (cos * cos).min(1.0);
        let s2 = 1.0 - c2;
        let t = n * n - k * k - s2;
        let ab = (t * t + 4.0 * n * n * k * k).sqrt();
        let a = (0.5 * (ab + t)).max(0.0).sqrt();
        let c = c2.sqrt();
        let s = (ab + c2 - 2.0 * a * c) / (ab + c2 + 2.0 * a * c).max(1e-20);
        let p = s * (c2 * ab + s2 * s2 - 2.0 * a * c * s2)
            / (c2 * ab + s2 * s2 + 2.0 * a * c * s2).max(1e-20);
        (0.5 * (s + p)).clamp(0.0, 1.0)
    };
    vec3(channel(n.x, k.x), channel(n.y, k.y), channel(n.z, k.z))
}

/// Returns the coefficient that lowers Schlick's curve to `tint` times its value at cosine 1/7 (82°): Kutz, Hašan
/// and Edmondson 2021, "Novel aspects of the Adobe Standard Material", §F82.
pub fn edge_dip(f0: Vec3, tint: Vec3) -> Vec3 {
    let f = 6.0_f32 / 7.0;
    let f5 = f * f * f * f * f;
    let channel =
        |f0: f32, tint: f32| (f0 + (1.0 - f0) * f5) * 7.0 / (f5 * f) * (1.0 - tint.min(1.0));
    vec3(
        channel(f0.x, tint.x),
        channel(f0.y, tint.y),
        channel(f0.z, tint.z),
    )
}

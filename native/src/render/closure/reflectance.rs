// SPDX-License-Identifier: GPL-3.0-or-later
//! How much facets and boundaries reflect, and in which colour.

use super::super::fresnel;
use super::super::vector::{Vec3, vec3};

/// How much a facet reflects.
#[derive(Debug, Clone, Copy)]
pub enum Fresnel {
    /// f0 + (edge - f0) (1 - c)⁵ - dip c (1 - c)⁶.
    Metal {
        /// At normal incidence.
        f0: Vec3,
        /// At grazing incidence.
        edge: Vec3,
        /// What an edge tint takes away between.
        dip: Vec3,
    },
    /// A dielectric boundary of this relative index, with the reflectance `f0` at normal incidence
    /// in place of its own, `own`.
    Dielectric {
        /// Index.
        eta: f32,
        /// Its own normal reflectance.
        own: f32,
        /// The least reflectance that counts.
        least: f32,
        /// The normal reflectance wanted, at most 1.
        f0: Vec3,
    },
}

impl Fresnel {
    /// Of a boundary of this relative index, with its reflection in this colour.
    pub fn dielectric(eta: f32, tint: Vec3) -> Self {
        let own = fresnel::f0_from_ior(eta);
        Self::Dielectric {
            eta,
            own,
            least: fresnel::least(eta),
            f0: (tint * own).map(|x| x.min(1.0)),
        }
    }

    /// Index of the boundary; 1 where there is none.
    #[inline(always)]
    pub fn index(&self) -> f32 {
        match *self {
            Self::Dielectric { eta, .. } => eta,
            Self::Metal { .. } => 1.0,
        }
    }

    /// Reflectance at a cosine.
    #[inline(always)]
    pub fn at(&self, c: f32) -> Vec3 {
        match *self {
            Self::Metal { f0, edge, dip } => {
                let m = (1.0 - c).clamp(0.0, 1.0);
                let m5 = m * m * m * m * m;
                f0 + (edge - f0) * m5 - dip * (c * m5 * m)
            }
            Self::Dielectric {
                eta,
                own,
                least,
                f0,
            } => {
                let f = fresnel::dielectric(c, eta).0;
                tinted(f.max(least), own, f0)
            }
        }
    }

    /// Cosine-weighted mean over the hemisphere.
    pub fn mean(&self, of_index: impl Fn(f32) -> f32) -> Vec3 {
        match *self {
            // The integrals of 2 c (1 - c)⁵ and 2 c² (1 - c)⁶ are 1/21 and 1/126.
            Self::Metal { f0, edge, dip } => f0 + (edge - f0) * (1.0 / 21.0) - dip * (1.0 / 126.0),
            Self::Dielectric {
                eta,
                own,
                least,
                f0,
            } => tinted(of_index(eta).max(least), own, f0),
        }
    }
}

/// A dielectric's reflectance `f` with its value at normal incidence, `own`, replaced by `f0`, and
/// 1 kept. Linear in `f`, so it holds for means of it as well.
#[inline(always)]
fn tinted(f: f32, own: f32, f0: Vec3) -> Vec3 {
    let rest = (f - own) / (1.0 - own).max(1e-6);
    f0 * (1.0 - rest) + Vec3::splat(rest)
}

/// How the light is coloured that a boundary reflects.
#[derive(Debug, Clone, Copy)]
pub enum Reflected {
    /// All of it alike; what passes is not changed by that.
    Alike(Vec3),
    /// As a dielectric's, by the reflectance `f0` at normal incidence in place of its own, `own`; what is not reflected
    /// passes.
    Dielectric {
        /// Its own normal reflectance.
        own: f32,
        /// The least reflectance that counts.
        least: f32,
        /// The normal reflectance wanted, at most 1.
        f0: Vec3,
    },
}

impl Reflected {
    /// What is reflected where the boundary's own reflectance is this.
    #[inline(always)]
    pub fn at(&self, reflectance: f32) -> Vec3 {
        match *self {
            Self::Alike(color) => color * reflectance,
            Self::Dielectric { own, least, f0 } => tinted(reflectance.max(least), own, f0),
        }
    }

    /// What is left to pass.
    #[inline(always)]
    pub fn rest(&self, reflectance: f32) -> Vec3 {
        match self {
            Self::Alike(_) => Vec3::splat(1.0 - reflectance),
            Self::Dielectric { .. } => Vec3::ONE - self.at(reflectance),
        }
    }
}

/// What Schlick's curve loses so that at the angle of cosine 1/7 (82°) it has `tint` of its value:
/// Kutz, Hašan and Edmondson 2021, "Novel aspects of the Adobe Standard Material", §F82.
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

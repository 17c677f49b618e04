// SPDX-License-Identifier: GPL-3.0-or-later
//! A material seen from one direction: evaluate it, sample it.
//!
//! Directions are in the shading frame (z = shading normal) and point away from the surface; `wi`
//! is where the path came from (z > 0), `wo` where it goes. `GLOSSY` and `GLASS` say whether the
//! scene has such lobes at all: without them their code is not compiled into the path.

use super::closure::{Fresnel, Reflected};
use super::ggx::Ggx;
use super::material::{MOST_CLOSURES, MOST_PRINCIPLED};
use super::place::RayKind;
use super::vector::Vec3;

mod assemble;
mod evaluate;
mod sample;

pub use self::sample::cosine_direction;

/// The other normals at the point, in the shading frame, whose z axis is the normal of facets.
#[derive(Debug, Clone, Copy)]
pub struct Normals {
    /// The triangle's, towards the viewer.
    pub geometric: Vec3,
    /// The surface's own and the one the material gave it, where it gave one. Facets take the
    /// latter bent so that a mirror sees nothing inside; the matte base takes it as it is.
    pub mapped: Option<[Vec3; 2]>,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Where the path goes.
    pub wo: Vec3,
    /// BSDF × cosine / density.
    pub weight: Vec3,
    /// Density per solid angle; infinite for a mirror or window, which no light sample can find.
    pub pdf: f32,
    /// What happened.
    pub kind: RayKind,
}

/// Reflection off facets, for one viewing direction.
#[derive(Clone, Copy)]
struct Facets {
    ggx: Ggx,
    smooth: bool,
    lambda_i: f32,
    fresnel: Fresnel,
    scale: Vec3,
    /// Share of the samples.
    p: f32,
}

/// Reflection and refraction at facets, for one viewing direction.
#[derive(Clone, Copy)]
struct Boundary {
    ggx: Ggx,
    smooth: bool,
    lambda_i: f32,
    /// Index of the far side over that of the near side.
    eta: f32,
    scale: Vec3,
    reflect: Option<Reflected>,
    tint: Vec3,
    p: f32,
}

/// Most facet lobes of a material, and most boundaries.
pub const MOST_FACETS: usize = 3 * MOST_PRINCIPLED + (MOST_CLOSURES - MOST_PRINCIPLED);
const MOST_BOUNDARIES: usize = MOST_CLOSURES;

/// The lobes of a material with their weights for one viewing direction.
pub struct Bsdf<const GLOSSY: bool, const GLASS: bool> {
    wi: Vec3,
    normals: Normals,
    facets: [Facets; MOST_FACETS],
    facet_count: usize,
    boundaries: [Boundary; MOST_BOUNDARIES],
    boundary_count: usize,
    diffuse: Vec3,
    diffuse_probability: f32,
}

impl<const GLOSSY: bool, const GLASS: bool> Bsdf<GLOSSY, GLASS> {
    /// Whether light can pass to the other side.
    #[inline(always)]
    pub fn transmits(&self) -> bool {
        GLASS && self.boundary_count > 0
    }

    /// Whether there is a reflecting lobe.
    #[inline(always)]
    pub fn reflects(&self) -> bool {
        GLOSSY && self.facet_count > 0
    }

    /// Whether some lobe has a density, so that light samples are worth a ray.
    #[inline(always)]
    pub fn has_density(&self) -> bool {
        self.diffuse_probability > 0.0
            || (GLOSSY && self.facets[..self.facet_count].iter().any(|f| !f.smooth))
            || (GLASS
                && self.boundaries[..self.boundary_count]
                    .iter()
                    .any(|b| !b.smooth))
    }
}

impl Boundary {
    /// What is reflected where the boundary's own reflectance is this.
    #[inline(always)]
    fn reflected(&self, reflectance: f32) -> Vec3 {
        self.reflect.map_or(Vec3::ZERO, |r| r.at(reflectance))
    }

    /// What passes.
    #[inline(always)]
    fn passed(&self, reflectance: f32) -> Vec3 {
        match self.reflect {
            None => self.tint,
            Some(reflect) => self.tint * reflect.rest(reflectance),
        }
    }

    /// Share of the samples that reflect: by energy.
    #[inline(always)]
    fn reflect_probability(&self, reflectance: f32) -> f32 {
        let reflected = self.reflected(reflectance).mean();
        let passed = self.passed(reflectance).mean();
        if reflected + passed > 0.0 {
            reflected / (reflected + passed)
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests;

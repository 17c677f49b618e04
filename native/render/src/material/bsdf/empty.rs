// SPDX-License-Identifier: GPL-3.0-or-later
//! A BSDF without lobes, and one that is only Lambertian.

use crate::material::bsdf::lobe::{Lobe, UP};
use crate::material::bsdf::rough::RoughDiffuse;
use crate::material::bsdf::{
    Boundary, Bsdf, Facets, LobeFilter, MAX_BOUNDARIES, MAX_FACETS, Normals,
};
use crate::material::closure::{Fresnel, MAX_CLOSURES};
use crate::material::ggx::Ggx;
use crate::math::vector::{Frame, Vec3};

/// An empty slot of the array of reflecting lobes.
const NO_FACETS: Facets = Facets {
    ggx: Ggx::MIRROR,
    smooth: true,
    lambda_i: 0.0,
    fresnel: Fresnel::Metal {
        f0: Vec3::ZERO,
        edge: Vec3::ZERO,
        dip: Vec3::ZERO,
    },
    scale: Vec3::ZERO,
    p: 0.0,
};

/// An empty slot of the array of refracting lobes.
const NO_BOUNDARY: Boundary = Boundary {
    ggx: Ggx::MIRROR,
    smooth: true,
    lambda_i: 0.0,
    eta: 1.0,
    scale: Vec3::ZERO,
    reflect: None,
    reflections: true,
    tint: Vec3::ZERO,
    p: 0.0,
};

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// A BSDF without lobes, whose memory [`Self::assemble`] uses again and again: the path allocates nothing.
    pub fn empty() -> Self {
        Self {
            wi: UP,
            normals: Normals {
                geometric: UP,
                mapped: None,
            },
            filter: LobeFilter::NONE,
            facets: [NO_FACETS; MAX_FACETS],
            facet_count: 0,
            boundaries: [NO_BOUNDARY; MAX_BOUNDARIES],
            boundary_count: 0,
            diffuse: Vec3::ZERO,
            rough: [RoughDiffuse::NONE; MAX_CLOSURES],
            rough_count: 0,
            diffuse_probability: 0.0,
            translucent: Vec3::ZERO,
            translucent_probability: 0.0,
            lobes: [Lobe::NONE; LOBES],
            lobe_count: 0,
            energy: 0.0,
        }
    }

    /// A white Lambertian lobe: what light that leaves a walk meets.
    pub fn lambertian(wi: Vec3, normals: Normals, frame: &Frame) -> Self {
        let mut out = Self::new(&[], &[], wi, normals, false, LobeFilter::NONE, frame);
        out.diffuse = Vec3::ONE;
        out.share_samples();
        out
    }
}

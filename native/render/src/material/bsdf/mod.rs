// SPDX-License-Identifier: GPL-3.0-or-later
//! The BSDF of a material for one viewing direction: evaluation and sampling.
//!
//! Directions are in the shading frame (z = shading normal) and point away from the surface; `wi` is where the path
//! came from (z > 0), `wo` where it goes. `GLOSSY` and `GLASS` are false if no material of the scene has such
//! lobes; their code is then compiled out. `LOBES` is 0 if none has lobes with frames of their own.

use crate::material::bsdf::lobe::Lobe;
use crate::material::bsdf::rough::RoughDiffuse;
use crate::material::closure::{Fresnel, MAX_CLOSURES, MAX_PRINCIPLED, Reflected, Subsurface};
use crate::material::film::Film;
use crate::material::ggx::Ggx;
use crate::material::microfacets::Distribution;
use crate::math::vector::{Frame, Vec3, vec3};
use crate::values::visibility::RayKind;

mod assemble;
mod empty;
mod evaluate;
mod facets;
mod layers;
mod lobe;
mod rough;
mod sample;
mod shares;

pub use crate::material::bsdf::lobe::MAX_LOBES;
pub use crate::material::bsdf::sample::{Entrance, cosine_direction};

/// The other normals at the point, in the shading frame, whose z axis is the normal of the facets.
#[derive(Debug, Clone, Copy)]
pub struct Normals {
    /// The triangle's normal, on the viewer's side.
    pub geometric: Vec3,
    /// The surface's shading normal and the normal that the material's nodes computed, or the surface's again; `None`
    /// if both are that of the facets. Facets use the second one bent so that no mirror direction points below the
    /// surface; the diffuse base uses it unchanged.
    pub mapped: Option<[Vec3; 2]>,
}

impl Normals {
    /// Returns the surface's shading normal.
    #[inline(always)]
    pub fn own(&self) -> Vec3 {
        self.mapped.map_or(vec3(0.0, 0.0, 1.0), |[own, _]| own)
    }

    /// Returns the cosine between a viewer and the normal of the diffuse base, at least 0.
    #[inline(always)]
    pub fn diffuse_cosine(&self, wi: Vec3) -> f32 {
        self.mapped
            .map_or(wi.z, |[_, mapped]| mapped.dot(wi))
            .max(0.0)
    }
}

/// Changes of the lobes that a path meets, from a render's settings, to reduce noise. Bias on purpose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeFilter {
    /// Least width (roughness²) of lobes that reflect or refract. Narrower ones are widened without a change of
    /// their weights, as in Cycles.
    pub min_width: f32,
    /// Whether lobes that reflect off facets are kept. What lies below a dropped layer gets all light.
    pub reflections: bool,
    /// Whether refraction is kept.
    pub refractions: bool,
    /// Whether light walks below surfaces; they are diffuse otherwise.
    pub walks: bool,
    /// Whether facets are seen. Where their normal faces away from the viewer they scatter nothing, but dim what lies
    /// below them as at grazing angles, as in Cycles.
    pub seen: bool,
}

impl LobeFilter {
    /// Changes nothing.
    pub const NONE: Self = Self {
        min_width: 0.0,
        reflections: true,
        refractions: true,
        walks: true,
        seen: true,
    };
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Where the path goes.
    pub wo: Vec3,
    /// BSDF × cosine / density: the factor on the path's throughput.
    pub weight: Vec3,
    /// Density per solid angle; infinite for a mirror or window, which light samples cannot find.
    pub pdf: f32,
    /// Kind of the scattered ray.
    pub kind: RayKind,
    /// Whether the path continues on the other side of the surface.
    pub through: bool,
    /// Index of refraction of the far side over that of the near side, for a window's direction; otherwise 1.
    pub eta: f32,
}

/// A reflecting lobe for one viewing direction.
#[derive(Clone, Copy)]
struct Facets {
    ggx: Ggx,
    /// Whether the facets form a perfect mirror.
    smooth: bool,
    /// Smith's Λ of the viewing direction.
    lambda_i: f32,
    fresnel: Fresnel,
    /// Factor on the reflectance: weight of the lobe and compensation of multiple scattering.
    scale: Vec3,
    /// Probability of sampling this lobe.
    p: f32,
}

/// A lobe that reflects and refracts, for one viewing direction.
#[derive(Clone, Copy)]
struct Boundary {
    ggx: Ggx,
    /// Whether the facets form a perfect mirror and window.
    smooth: bool,
    /// Smith's Λ of the viewing direction.
    lambda_i: f32,
    /// Index of the far side over that of the near side.
    eta: f32,
    /// Factor on both parts: weight of the lobe and compensation of multiple scattering.
    scale: Vec3,
    /// Colour of the reflection; `None` = refraction only.
    reflect: Option<Reflected>,
    /// Whether reflection is kept; what it would take is lost otherwise.
    reflections: bool,
    /// Filter of refracted light.
    tint: Vec3,
    /// Probability of sampling this lobe.
    p: f32,
}

/// How a boundary with a frame of its own divides light.
#[derive(Debug, Clone, Copy)]
pub struct Interface {
    /// Index of the far side over that of the near side.
    eta: f32,
    /// Colour of the reflection; `None` = refraction only.
    reflect: Option<Reflected>,
    /// Whether reflection is kept; what it would take is lost otherwise.
    reflections: bool,
    /// Filter of refracted light.
    tint: Vec3,
    /// A thin film on the boundary.
    film: Option<Film>,
}

/// Where a closure is seen from.
#[derive(Debug, Clone, Copy)]
struct Vantage<'a> {
    /// The shading frame in scene space.
    frame: &'a Frame,
    /// Whether the path arrives at the back of the surface.
    inside: bool,
}

/// The frame in which the lobes of a closure, or its coat, are assembled.
#[derive(Debug, Clone, Copy)]
struct Seat {
    /// Frame of the facets in the shading frame.
    frame: Frame,
    /// The viewer in it.
    wi: Vec3,
    /// Normal of the diffuse base in the shading frame.
    mapped: Vec3,
    /// Whether facets need a lobe of their own.
    apart: bool,
    /// Whether the normal differs from that of the material.
    turned: bool,
    /// Distribution of the facets.
    distribution: Distribution,
    /// Factors on their widths along the tangent and across.
    stretch: [f32; 2],
    /// Indices of refraction and extinction coefficients of a conductor.
    conductor: Option<[Vec3; 2]>,
    /// A thin film on the facets: thickness and index of refraction.
    film: Option<[f32; 2]>,
    /// The medium below the base.
    subsurface: Option<Subsurface>,
}

/// Largest number of reflecting lobes of a material (a Principled closure has three, the others one).
pub const MAX_FACETS: usize = 3 * MAX_PRINCIPLED + (MAX_CLOSURES - MAX_PRINCIPLED);
/// Largest number of refracting lobes of a material.
const MAX_BOUNDARIES: usize = MAX_CLOSURES;

/// The lobes of a material with their weights for one viewing direction.
pub struct Bsdf<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> {
    wi: Vec3,
    normals: Normals,
    filter: LobeFilter,
    facets: [Facets; MAX_FACETS],
    facet_count: usize,
    boundaries: [Boundary; MAX_BOUNDARIES],
    boundary_count: usize,
    /// Albedo of the Lambertian lobe.
    diffuse: Vec3,
    rough: [RoughDiffuse; MAX_CLOSURES],
    rough_count: usize,
    /// Probability of sampling the Lambertian and the rough diffuse lobes, by the cosine.
    diffuse_probability: f32,
    /// Albedo of the translucent lobe, whose axis is the normal of the facets.
    translucent: Vec3,
    /// Probability of sampling the translucent lobe.
    translucent_probability: f32,
    /// Lobes with frames of their own.
    lobes: [Lobe; LOBES],
    lobe_count: usize,
    /// Estimated energy of all lobes, of which their probabilities are shares.
    energy: f32,
}

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// The lobes with frames of their own; none, known at compile time, without `LOBES`.
    #[inline(always)]
    fn own_lobes(&self) -> &[Lobe] {
        if LOBES > 0 {
            &self.lobes[..self.lobe_count]
        } else {
            &[]
        }
    }

    /// Whether a lobe transmits light to the other side.
    #[inline(always)]
    pub fn transmits(&self) -> bool {
        GLASS
            && (self.boundary_count > 0
                || self.translucent != Vec3::ZERO
                || self.own_lobes().iter().any(Lobe::transmits))
    }

    /// Whether there is a reflecting lobe.
    #[inline(always)]
    pub fn reflects(&self) -> bool {
        GLOSSY && (self.facet_count > 0 || self.own_lobes().iter().any(Lobe::reflects))
    }

    /// Whether a lobe has a finite density, so that light samples can contribute.
    #[inline(always)]
    pub fn has_density(&self) -> bool {
        self.diffuse_probability > 0.0
            || self.own_lobes().iter().any(|lobe| !lobe.is_smooth())
            || (GLASS && self.translucent_probability > 0.0)
            || (GLOSSY && self.facets[..self.facet_count].iter().any(|f| !f.smooth))
            || (GLASS
                && self.boundaries[..self.boundary_count]
                    .iter()
                    .any(|b| !b.smooth))
    }
}

impl Boundary {
    /// Returns the reflected colour where the Fresnel reflectance of the boundary is `reflectance`.
    #[inline(always)]
    fn reflected(&self, reflectance: f32) -> Vec3 {
        match self.reflect {
            Some(reflect) if self.reflections => reflect.at(reflectance),
            _ => Vec3::ZERO,
        }
    }

    /// Returns the transmitted colour where the Fresnel reflectance of the boundary is `reflectance`.
    #[inline(always)]
    fn passed(&self, reflectance: f32) -> Vec3 {
        match self.reflect {
            None => self.tint,
            Some(reflect) => self.tint * reflect.rest(reflectance),
        }
    }

    /// Returns the share of samples that reflect, in proportion to the energy of the two parts.
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

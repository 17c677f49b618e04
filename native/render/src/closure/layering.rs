// SPDX-License-Identifier: GPL-3.0-or-later
//! Energy that a lobe reflects at a viewing angle, and what a coat leaves to the lobes below it.

use std::sync::Arc;

use crate::albedo::Grid;
use crate::closure::reflectance::{Fresnel, Reflected};
use crate::closure::{Closure, Reflector, Transmitter};
use crate::fresnel;
use crate::program::Value;
use crate::vector::{Vec3, vec3};

impl Reflector {
    /// Returns the reflected fraction at this cosine, and the factor by which it exceeds single scattering.
    /// `single`: albedo of white facets and its mean over the hemisphere; `albedo`: albedo of the dielectric
    /// facets.
    #[inline(always)]
    pub fn reflected(
        &self,
        cos: f32,
        single: (f32, f32),
        albedo: Option<f32>,
        multiscatter: bool,
    ) -> (Vec3, Vec3) {
        let smooth = self.ggx.is_smooth();
        // A mirror loses nothing between facets.
        let (single, mean) = if smooth { (1.0, 1.0) } else { single };
        // Scale the lobe so that the energy of multiple scattering returns.
        let regained = if multiscatter {
            regain(self.multiple, single, mean)
        } else {
            Vec3::ONE
        };
        let reflected = match (self.fresnel, albedo) {
            (Fresnel::Dielectric { own, f0, .. }, Some(albedo)) if !smooth => {
                // `Fresnel::at` is linear in the boundary's own reflectance, so its mean is too.
                let rest = (albedo - own * single) / (1.0 - own).max(1e-6);
                f0 * (single - rest) + Vec3::splat(rest)
            }
            _ => self.fresnel.at(cos) * single,
        } * regained
            * self.weight;
        (reflected, regained)
    }
}

impl Transmitter {
    /// Returns the albedo of single scattering and its mean, per channel. `single`: both without a tint of the
    /// reflection; `white`: returns both for facets that reflect all light.
    #[inline(always)]
    pub fn single(&self, single: (f32, f32), white: impl FnOnce() -> (f32, f32)) -> (Vec3, Vec3) {
        let plain = (Vec3::splat(single.0), Vec3::splat(single.1));
        let Some(Reflected::Dielectric { own, f0, .. }) = self.reflect else {
            return plain;
        };
        if f0 == Vec3::splat(own) {
            return plain;
        }
        // What is not reflected passes and `Reflected::at` is linear in `f0`, so the albedo is linear in `f0` too:
        // it equals `single` at `f0 = own` and `white` at `f0 = 1`.
        let white = white();
        let share = (f0 - Vec3::splat(own)) * (1.0 / (1.0 - own).max(1e-6));
        let between = |a: f32, b: f32| share.map(|s| (a + s * (b - a)).clamp(0.0, 1.0));
        (between(single.0, white.0), between(single.1, white.1))
    }
}

impl Closure {
    /// Returns the fraction of light from below that the coat transmits towards a viewer at this cosine.
    pub fn through_coat(&self, registers: &[Value], cos: f32) -> Vec3 {
        let parts = self.parts(registers);
        // Without a coat everything passes.
        let (Some((reflector, absorb)), Some([facets, dielectric])) =
            (&parts.coat, &self.grids.coat)
        else {
            return Vec3::ONE;
        };
        let (single, albedo) = coat_albedos(reflector, [facets, dielectric], cos);
        let (reflected, _) = reflector.reflected(cos, single, Some(albedo), true);
        let left = (1.0 - reflected.max_component()).max(0.0);
        absorbed(reflector, *absorb, cos) * left
    }
}

/// Albedo of a coat's facets: as if they were white, with its mean, and as a dielectric.
#[inline(always)]
pub fn coat_albedos(
    reflector: &Reflector,
    [facets, dielectric]: [&Arc<Grid>; 2],
    cos: f32,
) -> ((f32, f32), f32) {
    let Reflector {
        roughness, fresnel, ..
    } = *reflector;
    let single = facets.at(roughness, 1.0, cos);
    (single, dielectric.at(roughness, fresnel.index(), cos).0)
}

/// Returns the transmittance of a coat's absorption. The path through the coat is 1 / cosine of the refracted ray.
#[inline(always)]
pub fn absorbed(reflector: &Reflector, absorb: Vec3, cos: f32) -> Vec3 {
    let (_, cos_t) = fresnel::dielectric(cos, reflector.fresnel.index());
    // Beer's law along the refracted path; a coat of partial weight absorbs in that share of the surface.
    let way = 1.0 / cos_t.max(1e-3);
    let share = reflector.weight.x;
    absorb.map(|c| 1.0 - share + share * c.powf(way))
}

/// Like [`regain`], with an albedo per channel.
#[inline(always)]
pub fn regain_each(reflectance: Vec3, single: Vec3, mean: Vec3) -> Vec3 {
    // Common case: without a tint all channels have the same albedo.
    if single == Vec3::splat(single.x) {
        return regain(reflectance, single.x, mean.x);
    }
    let channel = |f: f32, single: f32, mean: f32| regain(Vec3::splat(f), single, mean).x;
    vec3(
        channel(reflectance.x, single.x, mean.x),
        channel(reflectance.y, single.y, mean.y),
        channel(reflectance.z, single.z, mean.z),
    )
}

/// Factor on single scattering that restores the energy lost between facets, from the albedo `single` of one
/// bounce, its mean and the mean reflectance of the facets. Kulla and Conty 2017, appendix, in the form of Cycles'
/// `microfacet_ggx_preserve_energy`.
#[inline(always)]
fn regain(reflectance: Vec3, single: f32, mean: f32) -> Vec3 {
    let missing = (1.0 - single) / single.max(1e-4);
    reflectance.map(|f| 1.0 + f * mean / (1.0 - f * (1.0 - mean)).max(1e-6) * missing)
}

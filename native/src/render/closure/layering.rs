// SPDX-License-Identifier: GPL-3.0-or-later
//! How much a lobe takes of the light that comes in under an angle, and what a coat leaves to what is below it.

use std::sync::Arc;

use super::super::albedo::Grid;
use super::super::fresnel;
use super::super::program::Value;
use super::super::vector::{Vec3, vec3};
use super::reflectance::{Fresnel, Reflected};
use super::{Closure, Reflector, Transmitter};

impl Reflector {
    /// How much it reflects of what comes in under this cosine, and how much brighter that is than a single bounce.
    /// `single`: albedo of white facets and its mean; `albedo`: of the dielectric ones.
    #[inline(always)]
    pub fn reflected(
        &self,
        cos: f32,
        single: (f32, f32),
        albedo: Option<f32>,
        multiscatter: bool,
    ) -> (Vec3, Vec3) {
        let smooth = self.ggx.is_smooth();
        let (single, mean) = if smooth { (1.0, 1.0) } else { single };
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
    /// Albedo of a single bounce and its mean, per channel, where they are `single` without a tint of the reflection.
    /// `white`: the same of facets that reflect everything.
    #[inline(always)]
    pub fn single(&self, single: (f32, f32), white: impl FnOnce() -> (f32, f32)) -> (Vec3, Vec3) {
        let plain = (Vec3::splat(single.0), Vec3::splat(single.1));
        let Some(Reflected::Dielectric { own, f0, .. }) = self.reflect else {
            return plain;
        };
        if f0 == Vec3::splat(own) {
            return plain;
        }
        // What is not reflected passes, and `Reflected::at` is linear in `f0`: so is the sum, which is `single` where
        // that is `own`, and `white` where it is 1.
        let white = white();
        let share = (f0 - Vec3::splat(own)) * (1.0 / (1.0 - own).max(1e-6));
        let between = |a: f32, b: f32| share.map(|s| (a + s * (b - a)).clamp(0.0, 1.0));
        (between(single.0, white.0), between(single.1, white.1))
    }
}

impl Closure {
    /// What the coat lets through of what shines below it, seen under this cosine.
    pub fn through_coat(&self, registers: &[Value], cos: f32) -> Vec3 {
        let parts = self.parts(registers);
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

/// Albedo of a coat's facets as if they reflected everything, with its mean, and as they are.
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

/// What a coat with this absorption lets through. The way is longer when seen from the side.
#[inline(always)]
pub fn absorbed(reflector: &Reflector, absorb: Vec3, cos: f32) -> Vec3 {
    let (_, cos_t) = fresnel::dielectric(cos, reflector.fresnel.index());
    let way = 1.0 / cos_t.max(1e-3);
    let share = reflector.weight.x;
    absorb.map(|c| 1.0 - share + share * c.powf(way))
}

/// [`regain`] with an albedo per channel.
#[inline(always)]
pub fn regain_each(reflectance: Vec3, single: Vec3, mean: Vec3) -> Vec3 {
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

/// How much brighter than a single bounce the lobe has to be so that no energy is lost, given the
/// albedo `single` of one bounce, its mean and the mean reflectance between facets. Kulla and
/// Conty 2017, appendix, in the form of Cycles' `microfacet_ggx_preserve_energy`.
#[inline(always)]
fn regain(reflectance: Vec3, single: f32, mean: f32) -> Vec3 {
    let missing = (1.0 - single) / single.max(1e-4);
    reflectance.map(|f| 1.0 + f * mean / (1.0 - f * (1.0 - mean)).max(1e-6) * missing)
}

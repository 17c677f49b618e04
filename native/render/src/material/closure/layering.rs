// SPDX-License-Identifier: GPL-3.0-or-later
//! Energy that a lobe reflects at a viewing angle, and what a coat leaves to the lobes below it.

use std::sync::Arc;

use crate::material::albedo::{Albedo, Grid};
use crate::material::closure::reflectance::{Fresnel, Reflected};
use crate::material::closure::{Closure, Reflector, SheenLayer, Transmitter};
use crate::material::sheen::Microfibers;
use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};
use crate::values::program::Value;

impl Reflector {
    /// Returns the reflected fraction at this cosine, and the factor by which it exceeds single scattering.
    /// `single`: albedo of white facets; `dielectric`: albedo of the dielectric facets at the cosine.
    #[inline(always)]
    pub fn reflected(
        &self,
        cos: f32,
        single: Albedo,
        dielectric: Option<f32>,
        multiscatter: bool,
    ) -> (Vec3, Vec3) {
        let smooth = self.ggx.is_smooth();
        // A mirror loses nothing between facets.
        let single = if smooth { Albedo::ONE } else { single };
        // Scale the lobe so that the energy of multiple scattering returns.
        let compensated = if multiscatter {
            compensation(self.multiple, single)
        } else {
            Vec3::ONE
        };
        let single = single.directional;
        let reflected = match (self.fresnel, dielectric) {
            (Fresnel::Dielectric { own, f0, .. }, Some(dielectric)) if !smooth => {
                // `Fresnel::at` is linear in the boundary's own reflectance, so its mean is too.
                let rest = (dielectric - own * single) / (1.0 - own).max(1e-6);
                f0 * (single - rest) + Vec3::splat(rest)
            }
            _ => self.fresnel.at(cos) * single,
        } * compensated
            * self.weight;
        (reflected, compensated)
    }
}

impl Transmitter {
    /// Returns the albedo of single scattering per channel. `single`: without a tint of the reflection; `white`:
    /// returns that of facets that reflect all light.
    #[inline(always)]
    pub fn single(&self, single: Albedo, white: impl FnOnce() -> Albedo) -> ChannelAlbedo {
        let plain = ChannelAlbedo {
            directional: Vec3::splat(single.directional),
            mean: Vec3::splat(single.mean),
        };
        let Some(Reflected::Dielectric { own, f0, .. }) = self.reflect else {
            return plain;
        };
        if f0 == Vec3::splat(own) {
            return plain;
        }
        // Interpolate the albedo: the rest of the light passes and `Reflected::at` is linear in `f0`, so the albedo is, too:
        // it equals `single` at `f0 = own` and `white` at `f0 = 1`.
        let white = white();
        let share = (f0 - Vec3::splat(own)) * (1.0 / (1.0 - own).max(1e-6));
        let between = |a: f32, b: f32| share.map(|s| (a + s * (b - a)).clamp(0.0, 1.0));
        ChannelAlbedo {
            directional: between(single.directional, white.directional),
            mean: between(single.mean, white.mean),
        }
    }
}

impl Closure {
    /// Returns the fraction of light from below that sheen and coat transmit towards a viewer at this cosine.
    pub fn through_coat(&self, registers: &[Value], cos: f32) -> Vec3 {
        let sheen = self.sheen(registers).map_or(1.0, |s| s.below(cos));
        let lobes = self.lobes(registers);
        // Without a coat everything that passes the sheen passes.
        let (Some((reflector, absorb)), Some([facets, dielectric])) =
            (&lobes.coat, &self.grids.coat)
        else {
            return Vec3::splat(sheen);
        };
        let (single, dielectric) = coat_albedos(reflector, [facets, dielectric], cos);
        let (reflected, _) = reflector.reflected(cos, single, Some(dielectric), true);
        let left = (1.0 - reflected.max_component()).max(0.0);
        absorbed(reflector, *absorb, cos) * (left * sheen)
    }
}

impl SheenLayer {
    /// Returns the fraction of light that passes below, towards a viewer at this cosine.
    pub fn below(&self, cos: f32) -> f32 {
        let albedo = Microfibers::new(self.roughness, cos).map_or(0.0, |(_, albedo)| albedo);
        (1.0 - self.color.max_component() * albedo).clamp(0.0, 1.0)
    }
}

/// An albedo per channel.
#[derive(Debug, Clone, Copy)]
pub struct ChannelAlbedo {
    /// At the viewing direction.
    pub directional: Vec3,
    /// Mean over the hemisphere.
    pub mean: Vec3,
}

/// Returns the albedo of a coat's facets: as if they were white, and as a dielectric at the cosine.
#[inline(always)]
pub fn coat_albedos(
    reflector: &Reflector,
    [facets, dielectric]: [&Arc<Grid>; 2],
    cos: f32,
) -> (Albedo, f32) {
    let Reflector {
        roughness, fresnel, ..
    } = *reflector;
    let single = facets.at(roughness, 1.0, cos);
    let dielectric = dielectric.at(roughness, fresnel.index(), cos);
    (single, dielectric.directional)
}

/// Returns the transmittance of a coat's absorption. The path through the coat is 1 / cosine of the refracted ray.
#[inline(always)]
pub fn absorbed(reflector: &Reflector, absorb: Vec3, cos: f32) -> Vec3 {
    let (_, cos_t) = fresnel::dielectric(cos, reflector.fresnel.index());
    // Beer's law along the refracted path; a coat of partial weight absorbs in that share of the surface.
    let path_length = 1.0 / cos_t.max(1e-3);
    let share = reflector.weight.x;
    absorb.map(|c| 1.0 - share + share * c.powf(path_length))
}

/// Like [`compensation`], with an albedo per channel.
#[inline(always)]
pub fn compensation_per_channel(reflectance: Vec3, single: ChannelAlbedo) -> Vec3 {
    let ChannelAlbedo { directional, mean } = single;
    // Common case: without a tint all channels have the same albedo.
    let albedo = |directional: f32, mean: f32| Albedo { directional, mean };
    if directional == Vec3::splat(directional.x) {
        return compensation(reflectance, albedo(directional.x, mean.x));
    }
    let channel = |f: f32, single: Albedo| compensation(Vec3::splat(f), single).x;
    vec3(
        channel(reflectance.x, albedo(directional.x, mean.x)),
        channel(reflectance.y, albedo(directional.y, mean.y)),
        channel(reflectance.z, albedo(directional.z, mean.z)),
    )
}

/// Factor on single scattering that restores the energy lost between facets, from the albedo of one bounce and the
/// mean reflectance of the facets. Kulla and Conty 2017, appendix, in the form of Cycles'
/// `microfacet_ggx_preserve_energy`.
#[inline(always)]
fn compensation(reflectance: Vec3, single: Albedo) -> Vec3 {
    let Albedo { directional, mean } = single;
    let missing = (1.0 - directional) / directional.max(1e-4);
    reflectance.map(|f| 1.0 + f * mean / (1.0 - f * (1.0 - mean)).max(1e-6) * missing)
}

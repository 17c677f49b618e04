// SPDX-License-Identifier: GPL-3.0-or-later
//! Rough diffuse reflection: the model of Oren and Nayar as improved by Fujii ("A tiny improvement of Oren-Nayar
//! reflectance model"), with light that bounces more than once after Portsmouth, Kutz and Hill 2024 ("EON: a practical
//! energy-preserving rough diffuse BRDF"). Parameters as in Cycles.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use crate::math::vector::Vec3;

/// A rough diffuse lobe for one viewing direction.
#[derive(Debug, Clone, Copy)]
pub struct RoughDiffuse {
    /// Factor on single scattering at all angles.
    a: f32,
    /// Factor on the part that depends on the angle between both directions.
    b: f32,
    /// Light that bounces more than once, relative to a direction that loses all light of single scattering.
    multiple: Vec3,
    /// Cosine between the normal and the viewer.
    cos_i: f32,
    /// Albedo of the lobe if it were Lambertian.
    pub weight: Vec3,
}

impl RoughDiffuse {
    /// An empty slot.
    pub const NONE: Self = Self {
        a: 0.0,
        b: 0.0,
        multiple: Vec3::ZERO,
        cos_i: 0.0,
        weight: Vec3::ZERO,
    };

    /// Returns the roughness of the lobe.
    pub fn roughness(&self) -> f32 {
        self.b / self.a
    }

    /// A lobe of this roughness, 0..1. `weight`: its albedo without roughness; `color`: of the surface, for further
    /// bounces; `cos_i`: between normal and viewer.
    #[inline(always)]
    pub fn new(roughness: f32, weight: Vec3, color: Vec3, cos_i: f32) -> Self {
        let a = 1.0 / (PI + roughness * (FRAC_PI_2 - 2.0 / 3.0));
        let b = roughness * a;
        // Energy lost by single scattering: in the mean over all directions, and in this one.
        let mean = a * PI + (2.0 * PI - 5.6) / 3.0 * b;
        let color = color.map(|c| c.clamp(0.0, 1.0));
        let bounces = color.map(|c| c * c * (mean / (1.0 - mean)) / (1.0 - c * (1.0 - mean)));
        let mut lobe = Self {
            a,
            b,
            multiple: Vec3::ZERO,
            cos_i,
            weight,
        };
        lobe.multiple = bounces * (FRAC_1_PI * (1.0 - lobe.albedo(cos_i)));
        lobe
    }

    /// The directional albedo of single scattering of a white surface at this cosine.
    #[inline(always)]
    fn albedo(&self, cos: f32) -> f32 {
        self.a * PI + self.b * angular(cos)
    }

    /// Returns BSDF × cosine. `between`: cosine between both directions; `cos`: between normal and light, above 0.
    #[inline(always)]
    pub fn eval(&self, between: f32, cos: f32) -> Vec3 {
        let mut s = between - cos * self.cos_i;
        if s > 0.0 {
            s /= cos.max(self.cos_i) + f32::MIN_POSITIVE;
        }
        let single = Vec3::splat(self.a + self.b * s);
        self.weight * (single + self.multiple * (1.0 - self.albedo(cos))) * cos
    }
}

/// The part of the albedo that grows with roughness, for a direction with this cosine.
#[inline(always)]
fn angular(cos: f32) -> f32 {
    // The tangent grows without bounds at the horizon: there the first terms of the series.
    if cos < 1e-6 {
        return (FRAC_PI_2 - 2.0 / 3.0) - cos;
    }
    let cos = cos.min(1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let tangent = sin / cos;
    sin * (cos.acos() - 2.0 / 3.0 - sin * cos) + 2.0 / 3.0 * tangent * (1.0 - sin * sin * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_roughness_the_lobe_is_lambertian() {
        let lobe = RoughDiffuse::new(1e-4, Vec3::splat(0.5), Vec3::splat(0.5), 0.7);
        for (between, cos) in [(0.9, 0.3), (-0.5, 0.8), (0.2, 1.0)] {
            assert!((lobe.eval(between, cos).x - 0.5 * cos * FRAC_1_PI).abs() < 1e-4);
        }
    }

    #[test]
    fn roughness_brightens_the_way_back_and_is_reciprocal() {
        let white = Vec3::ONE;
        let at = |i: f32| RoughDiffuse::new(0.9, white, white, i);
        // Towards the viewer the surface is brighter than to the other side.
        let back = at(0.5).eval(1.0, 0.5).x;
        let forth = at(0.5).eval(-0.5, 0.5).x;
        assert!(back > 1.3 * forth);
        for (between, i, o) in [(0.7, 0.3, 0.8), (-0.2, 0.9, 0.4)] {
            let (one, other) = (at(i).eval(between, o).x / o, at(o).eval(between, i).x / i);
            assert!((one - other).abs() < 1e-5, "{one} {other}");
        }
    }
}

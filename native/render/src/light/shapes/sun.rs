// SPDX-License-Identifier: GPL-3.0-or-later
//! Distant lights: parallel rays, spread by the angular size of the disc.

use std::f32::consts::{PI, TAU};

use crate::light::shapes::LightRay;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};

/// A distant light.
#[derive(Debug, Clone, Copy)]
pub struct Sun {
    frame: Frame,
    /// 1 - cos of half the angle, computed without cancellation.
    one_minus_cos: f32,
    /// Squared sine of half the angle.
    sin2: f32,
}

impl Sun {
    /// A sun in the unit direction `towards`. `angle`: full angle of its disc, radians.
    pub fn new(towards: Vec3, angle: f32) -> Self {
        let half = 0.5 * f64::from(angle);
        // 1 - cos x = 2 sin²(x / 2) has no cancellation.
        let (sin, sin_half) = (half.sin() as f32, (0.5 * half).sin() as f32);
        let one_minus_cos = 2.0 * sin_half * sin_half;
        Self {
            frame: Frame::around(towards),
            one_minus_cos,
            sin2: sin * sin,
        }
    }

    /// Returns the unit direction towards its middle.
    pub fn towards(&self) -> Vec3 {
        self.frame.z
    }

    /// Whether the disc is wide enough for a ray to hit it.
    pub fn has_size(&self) -> bool {
        self.one_minus_cos > 1e-12
    }

    /// Returns the radiance of a sun of irradiance 1, or for a sun without size the irradiance itself.
    pub fn radiance_of_one(&self) -> f32 {
        if self.has_size() {
            1.0 / (PI * self.sin2)
        } else {
            1.0
        }
    }

    /// Density per solid angle of a direction in the disc.
    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }

    /// Samples a direction uniformly over the disc.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<LightRay> {
        let distance = f32::INFINITY;
        if !self.has_size() {
            return Some(LightRay {
                direction: self.frame.z,
                distance,
                factor: 1.0,
                pdf: 1.0,
            });
        }
        // Uniform in 1 - cos is uniform by solid angle.
        let m = u[1] * self.one_minus_cos;
        let r = (m * (2.0 - m)).max(0.0).sqrt();
        let (sin, cos) = sin_cos_turns(u[0]);
        let direction = self.frame.to_world(vec3(r * cos, r * sin, 1.0 - m));
        Some(LightRay {
            direction,
            distance,
            factor: 1.0,
            pdf: self.pdf(),
        })
    }

    /// Whether a ray that hits nothing else points into the disc.
    #[inline]
    pub fn intersect(&self, direction: Vec3, t_max: f32) -> Option<LightRay> {
        // |d - z|² = 2 (1 - cos) has no cancellation for narrow discs.
        let inside = (direction - self.frame.z).length2() <= 2.0 * self.one_minus_cos;
        (t_max == f32::INFINITY && inside && self.has_size()).then(|| LightRay {
            direction,
            distance: f32::INFINITY,
            factor: 1.0,
            pdf: self.pdf(),
        })
    }

    /// Estimate of the irradiance per strength, see `Light::importance`.
    #[inline]
    pub fn importance(&self, normal: Vec3) -> f32 {
        if self.frame.z.dot(normal) + self.sin2.sqrt().max(self.one_minus_cos) < 0.0 {
            0.0
        } else {
            1.0
        }
    }
}

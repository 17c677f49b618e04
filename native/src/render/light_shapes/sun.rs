// SPDX-License-Identifier: GPL-3.0-or-later
//! Lights so far away that their rays are parallel, but for the size of their disc.

use std::f32::consts::{PI, TAU};

use super::super::trig::sin_cos_turns;
use super::super::vector::{Frame, Vec3, vec3};
use super::LightRay;

/// A distant light.
#[derive(Debug, Clone, Copy)]
pub struct Sun {
    frame: Frame,
    /// 1 - cos of half the angle, without cancellation.
    one_minus_cos: f32,
    sin2: f32,
}

impl Sun {
    /// `towards`: unit direction to the sun's centre; `angle`: full angle of its disc.
    pub fn new(towards: Vec3, angle: f32) -> Self {
        let half = 0.5 * f64::from(angle);
        let (sin, sin_half) = (half.sin() as f32, (0.5 * half).sin() as f32);
        let one_minus_cos = 2.0 * sin_half * sin_half;
        Self {
            frame: Frame::around(towards),
            one_minus_cos,
            sin2: sin * sin,
        }
    }

    /// Whether the disc is wide enough for a ray to meet it.
    pub fn has_size(&self) -> bool {
        self.one_minus_cos > 1e-12
    }

    /// Radiance of a sun of irradiance 1; the irradiance itself without a size.
    pub fn radiance_of_one(&self) -> f32 {
        if self.has_size() {
            1.0 / (PI * self.sin2)
        } else {
            1.0
        }
    }

    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }

    /// A direction uniform over the disc.
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

    /// Whether a ray that meets nothing else ends in the disc.
    #[inline]
    pub fn intersect(&self, direction: Vec3, t_max: f32) -> Option<LightRay> {
        // |d - z|² = 2 (1 - cos), which keeps its digits for narrow discs.
        let inside = (direction - self.frame.z).length2() <= 2.0 * self.one_minus_cos;
        (t_max == f32::INFINITY && inside && self.has_size()).then(|| LightRay {
            direction,
            distance: f32::INFINITY,
            factor: 1.0,
            pdf: self.pdf(),
        })
    }

    /// See `Light::importance`.
    #[inline]
    pub fn importance(&self, normal: Vec3) -> f32 {
        if self.frame.z.dot(normal) + self.sin2.sqrt().max(self.one_minus_cos) < 0.0 {
            0.0
        } else {
            1.0
        }
    }
}

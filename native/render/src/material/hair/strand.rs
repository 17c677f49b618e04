// SPDX-License-Identifier: GPL-3.0-or-later
//! The Hair BSDF: reflection or transmission in a cone about the hair, as in Cycles (from Open Shading Language). Both
//! angles have distributions whose integrals are known.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::math::vector::{Vec3, vec3};

/// A lobe about a hair.
#[derive(Debug, Clone, Copy)]
pub struct Strand {
    /// Whether it transmits instead of reflecting.
    pub transmits: bool,
    /// Longitudinal and azimuthal roughness, 0..1.
    roughness: [f32; 2],
    /// Shift of the cone in radians.
    shift: f32,
}

/// Distance of an inclination from a right angle below which the solid angle vanishes.
const POLE: f32 = 1e-3;

impl Strand {
    /// A lobe of this roughness and shift.
    pub fn new(transmits: bool, roughness: [f32; 2], shift: f32) -> Self {
        Self {
            transmits,
            roughness: roughness.map(|r| r.clamp(1e-3, 1.0)),
            shift: shift.clamp(-FRAC_PI_2, FRAC_PI_2),
        }
    }

    /// Returns the range of the angle whose tangent the longitudinal term samples, for a viewer's inclination.
    fn range(&self, viewer: f32) -> [f32; 2] {
        [FRAC_PI_2, -FRAC_PI_2]
            .map(|end| (((end + viewer) * 0.5 - self.shift) / self.roughness[0]).atan())
    }

    /// Returns the density of a direction, which also is BSDF × |cosine|.
    pub fn density(&self, wi: Vec3, wo: Vec3) -> f32 {
        let [along, around] = self.roughness;
        let [viewer, inclination] = [wi, wo].map(|w| w.x.clamp(-1.0, 1.0).asin());
        if FRAC_PI_2 - inclination.abs() < POLE {
            return 0.0;
        }
        let [upper, lower] = self.range(viewer);
        let t = (inclination + viewer) * 0.5 - self.shift;
        let range = 2.0 * (t * t + along * along) * (upper - lower) * inclination.cos();
        let azimuth = (-wo.y).atan2(wo.z).abs();
        let azimuthal = if self.transmits {
            let p = PI - azimuth;
            if p > FRAC_PI_2 {
                return 0.0;
            }
            let span = 2.0 * (FRAC_PI_2 / around).atan();
            around / (span * (p * p + around * around))
        } else {
            // A cosine over the part of a half turn that the roughness is.
            let scaled = azimuth / around;
            if scaled > PI {
                return 0.0;
            }
            (0.5 * scaled).cos() * 0.25 / around
        };
        azimuthal * along / range.max(1e-9)
    }

    /// Samples a direction. `u`: random numbers in [0, 1).
    pub fn sample(&self, wi: Vec3, u: [f32; 2]) -> Vec3 {
        let [along, around] = self.roughness;
        let viewer = wi.x.clamp(-1.0, 1.0).asin();
        let [upper, lower] = self.range(viewer);
        let half = along * (u[0] * (upper - lower) + lower).tan() + self.shift;
        let inclination = (2.0 * half - viewer).clamp(-FRAC_PI_2, FRAC_PI_2);
        let azimuth = if self.transmits {
            let span = 2.0 * (FRAC_PI_2 / around).atan();
            PI + around * (span * (u[1] - 0.5)).tan()
        } else {
            2.0 * (1.0 - 2.0 * u[1]).clamp(-1.0, 1.0).asin() * around
        };
        let ((sin, cos), (s, c)) = (inclination.sin_cos(), azimuth.sin_cos());
        vec3(sin, -cos * s, cos * c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    #[test]
    fn densities_integrate_to_one_and_samples_have_them() {
        for transmits in [false, true] {
            for roughness in [[0.1, 1.0], [0.5, 0.3], [1.0, 0.6]] {
                let strand = Strand::new(transmits, roughness, 0.1);
                let wi = vec3(0.4, 0.0, 0.84_f32.sqrt());
                let (n, mut total, mut mean, mut expected) = (600, 0.0, Vec3::ZERO, Vec3::ZERO);
                for i in 0..n {
                    for j in 0..n {
                        let [a, b] = [i, j].map(|k| (k as f32 + 0.5) / n as f32);
                        // The density has poles along the hair, where the inclination has none.
                        let ((s, c), phi) = ((PI * (a - 0.5)).sin_cos(), TAU * b);
                        let wo = vec3(s, c * phi.sin(), c * phi.cos());
                        let part = strand.density(wi, wo) * c * PI * TAU / (n * n) as f32;
                        total += f64::from(part);
                        expected += wo * part;
                        let sampled = strand.sample(wi, [a, b]);
                        mean += sampled * (1.0 / (n * n) as f32);
                        assert!(strand.density(wi, sampled) >= 0.0);
                    }
                }
                assert!(
                    (total - 1.0).abs() < 3e-3,
                    "{transmits} {roughness:?}: {total}"
                );
                let off = (mean - expected).length();
                assert!(
                    off < 0.01,
                    "{transmits} {roughness:?}: {mean:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn extremes_stay_finite() {
        for roughness in [[0.0; 2], [9.0; 2]] {
            for x in [-1.0, 0.0, 1.0] {
                let strand = Strand::new(true, roughness, 1e9);
                let wi = vec3(x, 0.0, 1.0 - x * x);
                let wo = strand.sample(wi, [0.999, 0.0]);
                assert!(wo.is_finite() && strand.density(wi, wo).is_finite());
            }
        }
    }
}

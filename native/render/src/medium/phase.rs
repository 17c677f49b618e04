// SPDX-License-Identifier: GPL-3.0-or-later
//! Henyey and Greenstein's phase function (1941), "Diffuse radiation in the galaxy".

use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};

/// Largest absolute anisotropy: beyond it the phase function is nearly a delta function. As in Cycles.
const MAX_ANISOTROPY: f32 = 1.0 - 1e-3;

/// Anisotropy below which scattering is sampled uniformly, where the inverse loses its digits.
const ISOTROPIC: f32 = 1e-3;

/// Returns the anisotropy within the limits.
pub fn clamped(g: f32) -> f32 {
    g.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY)
}

/// Returns the density per solid angle at this cosine between the directions before and after.
pub fn density(g: f32, cos: f32) -> f32 {
    const UNIFORM: f32 = 0.25 * std::f32::consts::FRAC_1_PI;
    let squared = (1.0 + g * g - 2.0 * g * cos).max(1e-12);
    UNIFORM * (1.0 - g * g) / (squared * squared.sqrt())
}

/// Returns a direction after scattering of the unit direction `d`. `u`: random numbers in [0, 1).
pub fn sample(g: f32, d: Vec3, u: [f32; 2]) -> Vec3 {
    // Invert the distribution of the cosine (Witt 1977).
    let cos = if g.abs() < ISOTROPIC {
        1.0 - 2.0 * u[0]
    } else {
        let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
        ((1.0 + g * g - root * root) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (s, c) = sin_cos_turns(u[1]);
    Frame::around(d)
        .to_world(vec3(sin * c, sin * s, cos))
        .normalized_or(d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_integrate_to_one_with_the_anisotropy_as_mean_cosine() {
        for g in [-0.9, -0.3, 0.0, 5e-4, 0.5, 0.95] {
            let n = 200_000;
            let (mut total, mut mean) = (0.0, 0.0);
            for i in 0..n {
                let cos = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n);
                let part = f64::from(density(g, cos as f32)) * 4.0 * std::f64::consts::PI;
                total += part / f64::from(n);
                mean += part * cos / f64::from(n);
            }
            assert!((total - 1.0).abs() < 1e-3, "{g}: {total}");
            assert!((mean - f64::from(g)).abs() < 1e-3, "{g}: {mean}");
        }
    }

    #[test]
    fn samples_have_the_density() {
        let d = vec3(0.6, 0.0, -0.8);
        for g in [-0.999, -0.7, 0.0, 5e-4, 0.3, 0.999] {
            // The mean of 1 / density is the solid angle of the sphere unless the peak hides the rest.
            let n = 1 << 12;
            let (mut mean, mut solid) = (0.0, 0.0);
            for i in 0..n {
                for j in 0..16 {
                    let u = [(i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / 16.0];
                    let cos = sample(g, d, u).dot(d);
                    mean += f64::from(cos) / f64::from(n * 16);
                    solid += 1.0 / f64::from(density(g, cos)) / f64::from(n * 16);
                }
            }
            assert!((mean - f64::from(g)).abs() < 2e-3, "{g}: {mean}");
            let sphere = 4.0 * std::f64::consts::PI;
            assert!(
                g.abs() > 0.9 || (solid / sphere - 1.0).abs() < 0.01,
                "{g}: {solid}"
            );
        }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The cone of a spot light, with the falloff of Cycles.

use std::f32::consts::FRAC_PI_2;

use crate::light::emission::Emission;
use crate::math::vector::{Vec3, matrix_column, vec3};

/// The cone of a spot light.
#[derive(Debug, Clone, Copy)]
pub struct Cone {
    /// Rows of the inverse of the light's matrix; a scaled matrix makes the cone elliptic.
    inverse: [Vec3; 3],
    /// Cosine of half the cone's angle.
    cos_half: f32,
    /// Reciprocal of the range of cosines over which the light fades.
    smooth: f32,
}

impl Cone {
    /// A cone of full angle `size`, in radians; `None` for a singular matrix. `blend`: fraction of the range of
    /// cosines over which the light fades.
    pub fn new(to_world: &[[f64; 4]; 4], size: f32, blend: f32) -> Option<Self> {
        let [x, y, z] = [0, 1, 2].map(|k| matrix_column(to_world, k));
        // Scale to 1 first, so that the determinant neither overflows nor underflows.
        let [x, y, z] = {
            let largest = [x, y, z].map(|v| v.map(f32::abs).max_component());
            let largest = largest[0].max(largest[1]).max(largest[2]);
            [x, y, z].map(|v| v * (1.0 / largest))
        };
        // Invert by cross products; the inverse need not have unit scale, because only directions pass through it.
        let determinant = x.dot(y.cross(z));
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let inverse = [y.cross(z), z.cross(x), x.cross(y)].map(|v| v * (1.0 / determinant));
        // The fade starts at the edge. Keep a minimal range, so that a hard edge does not divide by zero.
        let cos_half = (0.5 * f64::from(size)).cos() as f32;
        let smooth = 1.0 / ((1.0 - cos_half) * blend.clamp(0.0, 1.0)).max(1e-7);
        Some(Self {
            inverse,
            cos_half,
            smooth,
        })
    }

    /// Returns the bound of the directions into which light leaves.
    pub(super) fn emission(&self) -> Emission {
        // The directions that the light's matrix makes of the local cone around -z: a column is a cross product of rows of
        // the inverse, up to a common factor.
        let [x, y, z] = self.inverse;
        let [x, y, z] = [y.cross(z), z.cross(x), x.cross(y)];
        let sign = if x.dot(self.inverse[0]) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let [x, y, axis] = [x, y, z * -sign];
        let [across, along] = [x.length().max(y.length()), axis.length()];
        // A sheared cone is not symmetric about its axis.
        let sheared = x.dot(y).abs() + x.dot(axis).abs() + y.dot(axis).abs()
            > 1e-4 * across * (across + along);
        let half = self.cos_half.clamp(-1.0, 1.0).acos();
        // Half a turn, up to rounding, is the half space.
        if sheared || half > FRAC_PI_2 + 1e-6 {
            return Emission::ALL;
        }
        let reach = if half < FRAC_PI_2 - 1e-6 {
            (half.tan() * across / along).atan()
        } else {
            FRAC_PI_2
        };
        Emission::around(axis.normalized(), reach)
    }

    /// Returns the attenuation, as in Cycles, of light that leaves in this direction: a smoothstep over the cosine.
    #[inline]
    pub(super) fn attenuation(&self, direction: Vec3) -> f32 {
        let local = vec3(
            self.inverse[0].dot(direction),
            self.inverse[1].dot(direction),
            self.inverse[2].dot(direction),
        );
        let cos = -local.z / local.length().max(1e-30);
        let x = ((cos - self.cos_half) * self.smooth).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::PixelSampler;

    /// A matrix with these columns and no translation.
    fn matrix(columns: [[f64; 3]; 3]) -> [[f64; 4]; 4] {
        let row = |k: usize| [columns[0][k], columns[1][k], columns[2][k], 0.0];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    #[test]
    fn light_leaves_only_into_the_bound() {
        let (turned, wide) = ([0.6, 0.8, 0.0], [-1.6, 1.2, 0.0]);
        let matrices = [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [turned, wide, [0.0, 0.0, 3.0]],
            [turned, wide, [0.0, 0.0, -0.5]],
            [[1.0, 0.0, 0.0], [0.4, 1.0, 0.0], [0.0, 0.3, 1.0]],
        ];
        let sampler = PixelSampler::new(3, 4, 5);
        for (k, columns) in matrices.into_iter().enumerate() {
            for size in [0.1, 0.9, 2.5, 3.2] {
                let cone = Cone::new(&matrix(columns), size, 0.1).unwrap();
                let bound = cone.emission();
                let (mut lit, mut bounded) = (0, 0);
                for i in 0..4096 {
                    let [u, v] = sampler.pair(i, 0);
                    let (z, turn) = (2.0 * u - 1.0, std::f32::consts::TAU * v);
                    let r = (1.0 - z * z).sqrt();
                    let direction = vec3(r * turn.cos(), r * turn.sin(), z);
                    let within = bound.towards(direction, [0.0, 1.0]) > 0.0;
                    bounded += u32::from(within);
                    if cone.attenuation(direction) > 0.0 {
                        lit += 1;
                        assert!(within, "matrix {k}, angle {size}: {direction:?}");
                    }
                }
                // The bound is tight for cones that are no ellipses.
                assert!(k > 0 || size > 3.0 || f64::from(bounded) < 1.1 * f64::from(lit) + 8.0);
            }
        }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The cone of a spot light, with the falloff of Cycles.

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

// SPDX-License-Identifier: GPL-3.0-or-later
//! Sheen of upright fibres, and the retro-reflection of velvet.

use std::f32::consts::FRAC_1_PI;

use crate::math::vector::{Vec3, vec3};

mod table;

use table::{COEFFICIENTS, LEVELS};

/// A linearly transformed cosine, in the frame whose z axis is the normal and whose xz plane contains the viewer:
/// Zeltner, Burley and Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Microfibers {
    a: f32,
    b: f32,
}

impl Microfibers {
    /// Returns the lobe and its albedo for a viewer at this cosine; none where the fit is degenerate, as in Cycles.
    pub fn new(roughness: f32, cos: f32) -> Option<(Self, f32)> {
        let [a, b, albedo] = coefficients(roughness.clamp(1e-3, 1.0), cos.clamp(0.0, 1.0));
        (a.abs() >= 1e-5 && albedo >= 1e-5).then_some((Self { a, b }, albedo))
    }

    /// Returns the density of a direction, which is BSDF × cosine for an albedo of 1.
    pub fn density(&self, wo: Vec3) -> f32 {
        if wo.z <= 0.0 {
            return 0.0;
        }
        let stretched = vec3(self.a * wo.x + self.b * wo.z, self.a * wo.y, wo.z);
        let share = self.a / stretched.length2();
        FRAC_1_PI * wo.z * share * share
    }

    /// Transforms a direction sampled by the cosine to one of this lobe.
    pub fn transformed(&self, w: Vec3) -> Vec3 {
        vec3(w.x - self.b * w.z, w.y, self.a * w.z).normalized_or(vec3(0.0, 0.0, 1.0))
    }
}

/// Interpolates the table bilinearly.
fn coefficients(roughness: f32, cos: f32) -> [f32; 3] {
    let find = |x: f32| {
        let x = x * (LEVELS - 1) as f32;
        let i = (x as usize).min(LEVELS - 2);
        (i, x - i as f32)
    };
    let ((r, fr), (c, fc)) = (find(roughness), find(cos));
    let mut out = [0.0; 3];
    for (row, wr) in [(r, 1.0 - fr), (r + 1, fr)] {
        for (column, wc) in [(c, 1.0 - fc), (c + 1, fc)] {
            let entry = COEFFICIENTS[row * LEVELS + column];
            for k in 0..3 {
                out[k] += wr * wc * entry[k];
            }
        }
    }
    out
}

/// Returns BSDF × cosine of velvet: Ashikhmin and Premože 2007, "Distribution-based BRDFs", with the masking of
/// Ashikhmin, Premože and Shirley 2000. `roughness`: 0..1, the width of the inverted Gaussian; directions are in the
/// frame of the normal.
pub fn velvet(roughness: f32, wi: Vec3, wo: Vec3) -> f32 {
    let h = (wi + wo).normalized_or(vec3(0.0, 0.0, 1.0));
    let between = wi.dot(h).abs();
    if wo.z <= 0.0 || wi.z <= 1e-5 || h.z >= 1.0 - 1e-5 || between <= 1e-5 {
        return 0.0;
    }
    let sigma = roughness.max(0.01);
    let inverse2 = 1.0 / (sigma * sigma);
    // Density of the fibres' normals, which are rarer the closer to the surface's.
    let sin2 = 1.0 - h.z * h.z;
    let d = (-h.z * h.z / sin2 * inverse2).exp() * inverse2 * FRAC_1_PI / (sin2 * sin2);
    let ratio = (h.z / between).max(1e-5);
    let g = (2.0 * ratio * wi.z).min(2.0 * ratio * wo.z).min(1.0);
    0.25 * d * g / wi.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_sheen_shines_at_the_edge_only() {
        // The table's rows are of one roughness: fine fibres reflect nothing from above and much at the horizon.
        let albedo = |roughness, cos| Microfibers::new(roughness, cos).map_or(0.0, |(_, a)| a);
        assert!(albedo(0.15, 1.0) < 1e-3 && albedo(0.15, 0.05) > 0.05);
        assert!((albedo(1.0, 1.0) - 0.341_88).abs() < 1e-4);
        assert!((albedo(1.0, 0.0) - 0.749_73).abs() < 1e-4);
    }
}

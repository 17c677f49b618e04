// SPDX-License-Identifier: GPL-3.0-or-later
//! What one sample of one pixel gathers, for all passes.

use super::super::vector::Vec3;

/// Depth where nothing is seen, as in Blender's own engines.
const BACKGROUND_DEPTH: f32 = 1e10;

/// What one sample of one pixel gathers.
#[derive(Debug, Clone, Copy)]
pub struct PixelSample {
    /// Radiance.
    pub color: [f32; 3],
    /// Opacity.
    pub alpha: f32,
    /// Depth of the first surface.
    pub depth: f32,
    /// Its shading normal.
    pub normal: [f32; 3],
    /// Its position.
    pub position: [f32; 3],
    /// How far it is from the camera.
    pub distance: f32,
    /// Its UV and 1, or 0 where there is no surface.
    pub uv: [f32; 3],
    /// The number of its object.
    pub object: f32,
    /// The number of its material.
    pub material: f32,
    /// How much light it sends on.
    pub albedo: [f32; 3],
    /// Depth of the last leaf that the camera ray tested.
    pub leaf_depth: u32,
    /// Inner nodes visited by the camera ray.
    pub steps: u32,
    /// Triangles tested by the camera ray.
    pub tests: u32,
}

impl PixelSample {
    /// Nothing seen.
    pub const EMPTY: Self = Self {
        color: [0.0; 3],
        alpha: 0.0,
        depth: BACKGROUND_DEPTH,
        normal: [0.0; 3],
        position: [0.0; 3],
        distance: f32::INFINITY,
        uv: [0.0; 3],
        object: 0.0,
        material: 0.0,
        albedo: [0.0; 3],
        leaf_depth: 0,
        steps: 0,
        tests: 0,
    };

    /// Light arrives.
    #[inline(always)]
    pub fn add(&mut self, light: Vec3) {
        for (c, l) in self.color.iter_mut().zip(light.array()) {
            *c += l;
        }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The values of one sample of one pixel, for all passes.

use crate::math::vector::Vec3;

/// Depth of pixels without a surface, as in Blender's own engines.
const BACKGROUND_DEPTH: f32 = 1e10;

/// The values of one sample of one pixel, for all passes.
#[derive(Debug, Clone, Copy)]
pub struct PixelSample {
    /// Radiance.
    pub color: [f32; 3],
    /// Opacity.
    pub alpha: f32,
    /// Depth of the first surface.
    pub depth: f32,
    /// Shading normal of the first surface.
    pub normal: [f32; 3],
    /// Position of the first surface.
    pub position: [f32; 3],
    /// Distance of the first surface from the camera.
    pub distance: f32,
    /// UV of the first surface and 1; zeros where there is no surface.
    pub uv: [f32; 3],
    /// Index of the object.
    pub object: f32,
    /// Index of the material.
    pub material: f32,
    /// Albedo of the first surface.
    pub albedo: [f32; 3],
    /// Roughness of the first surface.
    pub roughness: f32,
    /// Depth of the last leaf whose triangles the camera ray tested.
    pub leaf_depth: u32,
    /// Number of inner nodes that the camera ray visited.
    pub steps: u32,
    /// Number of triangles that the camera ray tested.
    pub tests: u32,
}

impl PixelSample {
    /// A sample without light or surface.
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
        roughness: 0.0,
        leaf_depth: 0,
        steps: 0,
        tests: 0,
    };

    /// Adds radiance.
    #[inline(always)]
    pub fn add(&mut self, light: Vec3) {
        for (c, l) in self.color.iter_mut().zip(light.array()) {
            *c += l;
        }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The mist pass.

/// The mist pass: 0 up to `start`, 1 from `start + depth` on, as in Blender.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mist {
    /// Distance from the camera where the mist begins, in scene units.
    pub start: f32,
    /// Distance from there to full mist, in scene units.
    pub depth: f32,
    /// Curve between them.
    pub falloff: Falloff,
}

/// Curve of the mist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Falloff {
    /// Square of the distance.
    Quadratic,
    /// Linear.
    Linear,
    /// Square root of the distance.
    InverseQuadratic,
}

impl Default for Mist {
    fn default() -> Self {
        Self {
            start: 5.0,
            depth: 25.0,
            falloff: Falloff::Quadratic,
        }
    }
}

impl Mist {
    /// Returns the mist at a distance from the camera.
    #[inline]
    pub fn at(&self, distance: f32) -> f32 {
        let x = ((distance - self.start) / self.depth.max(1e-30)).clamp(0.0, 1.0);
        match self.falloff {
            Falloff::Quadratic => x * x,
            Falloff::Linear => x,
            Falloff::InverseQuadratic => x.sqrt(),
        }
    }
}

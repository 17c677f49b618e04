// SPDX-License-Identifier: GPL-3.0-or-later
//! The geometry of lights: sampling a direction towards one, and intersecting one with a ray.

mod area;
mod cone;
mod disc;
mod sphere;
mod spherical_rectangle;
mod spherical_triangle;
mod spread;
mod sun;
mod triangle;

pub use area::Area;
pub use cone::Cone;
pub use disc::Disc;
pub use sun::Sun;
pub use triangle::Triangle;

use crate::math::vector::Vec3;

/// The part of a ray from a receiver to a light.
#[derive(Debug, Clone, Copy)]
pub struct LightRay {
    /// Unit direction.
    pub direction: Vec3,
    /// Distance to the light; infinite for a sun.
    pub distance: f32,
    /// Factor on the light's strength: attenuation, and 1/d² for a point light without size.
    pub factor: f32,
    /// Density per solid angle; 1 for lights without size.
    pub pdf: f32,
}

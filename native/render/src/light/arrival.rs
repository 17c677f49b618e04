// SPDX-License-Identifier: GPL-3.0-or-later
//! A point that receives light, and a sample of the light that arrives there.

use crate::math::vector::Vec3;
use crate::values::linking::LightSets;
use crate::values::visibility::Visibility;

/// A sample of the light that arrives at a point.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Distance to the light; infinite for a sun.
    pub distance: f32,
    /// Radiance divided by the density, including the probability of the light.
    pub radiance: Vec3,
    /// Density per solid angle, including the probability of the light; infinite if no ray can hit the light.
    pub pdf: f32,
    /// Whether occluders between the point and the light count.
    pub casts_shadow: bool,
    /// The lobes that the light illuminates.
    pub visible: Visibility,
    /// The set of the objects that shade the light.
    pub blockers: u8,
    /// The light group of a lamp; 0 = none.
    pub group: u8,
    /// The emitter. Unless it is a lamp, `radiance` still has to be multiplied by that of the emitter.
    pub emitter: Emitter,
}

/// The source of the light of an [`Arrival`].
#[derive(Debug, Clone, Copy)]
pub enum Emitter {
    /// A lamp; `radiance` is complete.
    Lamp,
    /// A lamp with this number, whose program computes a factor.
    Shaded(u32),
    /// An emissive triangle, at these weights of its second and third corner.
    Triangle(u32, [f32; 2]),
    /// The background.
    World,
}

/// An emissive triangle.
#[derive(Debug, Clone, Copy)]
pub struct EmissiveTriangle {
    /// Index of the triangle.
    pub triangle: u32,
    /// The kinds of rays that see it.
    pub visible: Visibility,
    /// The sets of the objects that it shines on, and that shade it.
    pub sets: LightSets,
    /// Vertices in scene space.
    pub corners: [Vec3; 3],
    /// Estimate of the emitted radiance, mean of the channels.
    pub radiance: f32,
}

/// The part of a ray from a receiver within which lamps are looked for.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Where the ray comes from.
    pub receiver: Receiver,
    /// Unit direction.
    pub direction: Vec3,
    /// Interval of distances from the receiver.
    pub span: [f32; 2],
}

/// A point that receives light.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Position.
    pub point: Vec3,
    /// Geometric normal on the viewer's side; zero if light from behind counts too.
    pub normal: Vec3,
    /// The sets of lights that shine on the point.
    pub sets: u32,
    /// Whether several lights are sampled instead of one, see [`crate::light::Lights::sample_several`].
    pub each: bool,
    /// Number of times the path has scattered before, see [`crate::light::LightParams::max_bounces`].
    pub bounce: u16,
}

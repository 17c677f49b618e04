// SPDX-License-Identifier: GPL-3.0-or-later
//! One light: its shape, its strength and an estimate of its contribution to a point.

use crate::light::Receiver;
use crate::light::emission::Emission;
use crate::light::programs::Shader;
use crate::light::shapes::{Area, Disc, Sun, Triangle};
use crate::light::tree::BoundingSphere;
use crate::math::vector::Vec3;
use crate::values::linking::{LightSets, contains};
use crate::values::visibility::Visibility;

/// The geometry of a light.
pub(super) enum Shape {
    /// Point or spot light: a disc that faces the receiver.
    Disc(Disc),
    Sun(Sun),
    Area(Area),
    /// Number of the scene's triangle, and its shape.
    Triangle(u32, Triangle),
    /// The background.
    World,
}

/// A light prepared for sampling.
pub(super) struct Light {
    pub(super) shape: Shape,
    /// Radiance of a light with a size; intensity or irradiance of one without.
    pub(super) strength: Vec3,
    /// Estimate of the intensity (suns and background: irradiance), mean of the channels, for choosing lights.
    pub(super) brightness: f32,
    pub(super) casts_shadow: bool,
    pub(super) visible: Visibility,
    pub(super) sets: LightSets,
    /// The light group of a lamp; 0 = none.
    pub(super) group: u8,
    /// Largest number of bounces before a light sample.
    pub(super) max_bounces: u32,
    /// Computes a factor on the strength of a lamp, if that varies.
    pub(super) shader: Option<Box<Shader>>,
}

impl Light {
    /// Whether the light has a finite radiance.
    pub(super) fn has_size(&self) -> bool {
        match &self.shape {
            Shape::Disc(disc) => disc.radius > 0.0,
            Shape::Sun(sun) => sun.has_size(),
            Shape::Area(_) | Shape::Triangle(..) | Shape::World => true,
        }
    }

    /// Whether the light is infinitely far away.
    pub(super) fn is_far(&self) -> bool {
        matches!(self.shape, Shape::Sun(_) | Shape::World)
    }

    /// Whether the light lies in the plane across the axis of its emission.
    pub(super) fn is_flat(&self) -> bool {
        matches!(self.shape, Shape::Area(_))
    }

    /// Returns the bounding sphere of a light at a finite distance.
    pub(super) fn bounding_sphere(&self, light: u32) -> Option<BoundingSphere> {
        let ((centre, radius), emission) = match &self.shape {
            Shape::Disc(disc) => ((disc.centre(), disc.radius), disc.emission()),
            Shape::Area(area) => (area.bounding_sphere(), area.emission()),
            // Both sides of a triangle shine.
            Shape::Triangle(_, triangle) => (triangle.bounding_sphere(), Emission::ALL),
            Shape::Sun(_) | Shape::World => return None,
        };
        Some(BoundingSphere {
            centre,
            radius,
            brightness: self.brightness,
            emission,
            light,
        })
    }

    /// Whether rays can hit the light. A ray would stop at objects that do not shade the light; at those before a
    /// background without shadows it does, as in Cycles.
    pub(super) fn is_hittable(&self) -> bool {
        let stops = self.casts_shadow || matches!(self.shape, Shape::World);
        self.has_size() && stops && self.sets.blockers == 0
    }

    /// Whether the light shines on a receiver.
    pub(super) fn shines_on(&self, receiver: Receiver) -> bool {
        contains(receiver.sets, self.sets.receivers)
    }

    /// Estimates the irradiance at a receiver; zero only where the light cannot arrive.
    pub(super) fn importance(&self, receiver: Receiver) -> f32 {
        if !self.shines_on(receiver) {
            return 0.0;
        }
        // Zero is reserved for lights that cannot contribute, because they are never chosen.
        self.brightness
            * match &self.shape {
                Shape::Disc(disc) => disc.importance(receiver.point, receiver.normal),
                Shape::Sun(sun) => sun.importance(receiver.normal),
                Shape::Area(area) => area.importance(receiver.point, receiver.normal),
                Shape::Triangle(_, triangle) => {
                    let (centre, radius) = triangle.bounding_sphere();
                    let sphere = BoundingSphere {
                        centre,
                        radius,
                        brightness: 1.0,
                        emission: Emission::ALL,
                        light: 0,
                    };
                    sphere.importance(receiver)
                }
                Shape::World => 1.0,
            }
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! One light: its shape and strength, and roughly what it gives to a point.

use super::super::light_shapes::{Area, Disc, Sun, Triangle};
use super::super::light_tree::Ball;
use super::super::vector::Vec3;
use super::super::visibility::Visibility;
use super::Receiver;

/// What light comes from.
pub(super) enum Shape {
    Disc(Disc),
    Sun(Sun),
    Area(Area),
    Triangle(u32, Triangle),
    World,
}

/// A light, ready to be sampled.
pub(super) struct Light {
    pub(super) shape: Shape,
    /// Radiance of a light with a size, intensity or irradiance of one without.
    pub(super) strength: Vec3,
    /// Mean of power-like strength, for choosing.
    pub(super) brightness: f32,
    pub(super) casts_shadow: bool,
    pub(super) visible: Visibility,
}

impl Light {
    pub(super) fn has_size(&self) -> bool {
        match &self.shape {
            Shape::Disc(disc) => disc.radius > 0.0,
            Shape::Sun(sun) => sun.has_size(),
            Shape::Area(_) | Shape::Triangle(..) | Shape::World => true,
        }
    }

    pub(super) fn is_far(&self) -> bool {
        matches!(self.shape, Shape::Sun(_) | Shape::World)
    }

    /// A ball around a light that has a place.
    pub(super) fn ball(&self, light: u32) -> Option<Ball> {
        let (centre, radius) = match &self.shape {
            Shape::Disc(disc) => (disc.centre(), disc.radius),
            Shape::Area(area) => area.ball(),
            Shape::Triangle(_, triangle) => triangle.ball(),
            Shape::Sun(_) | Shape::World => return None,
        };
        Some(Ball {
            centre,
            radius,
            brightness: self.brightness,
            light,
        })
    }

    pub(super) fn can_be_met(&self) -> bool {
        self.has_size() && self.casts_shadow
    }

    /// Roughly the irradiance the light could give; zero only where it gives none.
    pub(super) fn importance(&self, receiver: Receiver) -> f32 {
        self.brightness
            * match &self.shape {
                Shape::Disc(disc) => disc.importance(receiver.point, receiver.normal),
                Shape::Sun(sun) => sun.importance(receiver.normal),
                Shape::Area(area) => area.importance(receiver.point, receiver.normal),
                Shape::Triangle(_, triangle) => {
                    let (centre, radius) = triangle.ball();
                    let ball = Ball {
                        centre,
                        radius,
                        brightness: 1.0,
                        light: 0,
                    };
                    ball.importance(receiver)
                }
                Shape::World => 1.0,
            }
    }
}

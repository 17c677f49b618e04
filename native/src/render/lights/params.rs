// SPDX-License-Identifier: GPL-3.0-or-later
//! Lights as their user describes them.

use super::super::visibility::Visibility;

/// Outline of an area light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AreaShape {
    /// `size` × `size`.
    Square,
    /// `size` × `size_y`.
    Rectangle,
    /// A circle of diameter `size`.
    Disk,
    /// An ellipse with diameters `size` and `size_y`.
    Ellipse,
}

/// What kind of light, with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines in all directions.
    Point {
        /// Soft size, scene units; 0 allowed.
        radius: f32,
    },
    /// A point light with a cone.
    Spot {
        /// Soft size, scene units; 0 allowed.
        radius: f32,
        /// Full angle of the cone, radians.
        size: f32,
        /// Share of the cone over which it fades, 0..1.
        blend: f32,
    },
    /// Infinitely far.
    Sun {
        /// Full angle of its disc, radians.
        angle: f32,
    },
    /// A flat emitter.
    Area {
        /// Outline.
        shape: AreaShape,
        /// Extent along the light's X before `to_world`.
        size: f32,
        /// Extent along the light's Y before `to_world`.
        size_y: f32,
    },
}

/// A light as its user describes it. It shines along its own -Z.
#[derive(Debug, Clone, PartialEq)]
pub struct LightParams {
    /// Kind and shape.
    pub kind: LightKind,
    /// Light to scene frame; rows, column vectors.
    pub to_world: [[f64; 4]; 4],
    /// Watts (sun: W/m²) per colour, linear.
    pub power: [f32; 3],
    /// Whether surfaces block it.
    pub casts_shadow: bool,
    /// Which rays see it.
    pub visible: Visibility,
}

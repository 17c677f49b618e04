// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of lights.

use crate::values::linking::LightSets;
use crate::values::program::{Operand, Step};
use crate::values::varying::ObjectFrame;
use crate::values::visibility::Visibility;

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

/// ClosureKind of a light and its dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Emits in all directions.
    Point {
        /// Radius in scene units; may be 0.
        radius: f32,
    },
    /// A point light with a cone.
    Spot {
        /// Radius in scene units; may be 0.
        radius: f32,
        /// Full angle of the cone, radians.
        size: f32,
        /// Fraction of the cone over which the light fades, 0..1.
        blend: f32,
    },
    /// A light at infinite distance.
    Sun {
        /// Full angle of the disc, radians.
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
        /// Full angle of the cone into which each point shines, radians; π is all of the half space.
        spread: f32,
    },
}

/// Parameters of a light, which shines along its own -Z.
#[derive(Debug, Clone)]
pub struct LightParams {
    /// ClosureKind and dimensions.
    pub kind: LightKind,
    /// Light to scene transform: rows of a matrix applied to column vectors.
    pub to_world: [[f64; 4]; 4],
    /// Watts (sun: W/m²) per linear colour channel.
    pub power: [f32; 3],
    /// Whether a point or spot light with a radius is a sphere; otherwise a disc that faces the receiver.
    pub sphere: bool,
    /// Whether surfaces block the light.
    pub casts_shadow: bool,
    /// The kinds of rays that see the light.
    pub visible: Visibility,
    /// The objects that it shines on, and those that shade it.
    pub sets: LightSets,
    /// Light group, counted from 1; 0 = none.
    pub group: u8,
    /// Largest number of times that a path has scattered before its light samples see the light. Rays that meet the
    /// light see it in any case, as in Cycles.
    pub max_bounces: u32,
    /// Computes a factor on the power from the direction and the point of the light.
    pub program: Option<LampProgram>,
}

/// A program of a light.
#[derive(Debug, Clone)]
pub struct LampProgram {
    /// The steps.
    pub steps: Vec<Step>,
    /// The result: a colour.
    pub radiance: Operand,
    /// The light's own space, which may be scaled, and its values.
    pub frame: ObjectFrame,
}

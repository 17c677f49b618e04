// SPDX-License-Identifier: GPL-3.0-or-later
//! What the steps of a program compute.

use std::sync::Arc;

use super::super::image::{Extension, Interpolation};
use super::super::node_math::{Blend, Math, VectorMath};
use super::Value;

/// Where on the surface, as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// The object's box as 0..1.
    Generated,
    /// The object's own space.
    Object,
    /// The shading normal in the object's own space.
    ObjectNormal,
    /// Position in the world.
    Position,
    /// Shading normal in the world.
    Normal,
    /// The triangle's normal.
    TrueNormal,
    /// Direction to the viewer.
    Incoming,
    /// The viewer's direction mirrored at the surface.
    Reflection,
    /// 1 on the back.
    Backfacing,
    /// 1 for camera rays.
    CameraRay,
    /// 1 for shadow rays.
    ShadowRay,
    /// 1 after a diffuse bounce.
    DiffuseRay,
    /// 1 after a glossy reflection or a mirror.
    GlossyRay,
    /// 1 after a refraction.
    TransmissionRay,
}

/// What a gradient texture looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are Blender's")]
pub enum Gradient {
    Linear,
    Quadratic,
    Easing,
    Diagonal,
    Radial,
    QuadraticSphere,
    Spherical,
}

/// How Map Range goes from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ease {
    /// Evenly.
    Linear,
    /// As a cubic.
    Smooth,
    /// As a polynomial of degree five.
    Smoother,
}

/// What a step computes.
#[derive(Debug, Clone)]
pub enum Op {
    /// Colour and alpha of an image at a place (u, v).
    Image {
        /// Which.
        image: u16,
        /// Between texels.
        interpolation: Interpolation,
        /// Outside.
        extension: Extension,
        /// Divide the colour by alpha.
        unassociate: bool,
        /// The place is a direction, the image a map of all directions.
        panorama: bool,
    },
    /// An attribute of the corners: a UV map or a colour.
    Attribute(u16),
    /// See [`Coordinate`].
    Coordinate(Coordinate),
    /// Fourth number of the argument.
    Alpha,
    /// One channel of the argument.
    Channel(u8),
    /// Three numbers as one vector.
    Combine,
    /// Brightness of a colour.
    Luminance,
    /// Mean of a vector.
    Mean,
    /// The Math node.
    Math(Math, bool),
    /// The Vector Math node.
    VectorMath(VectorMath),
    /// The Mix node: factor, a, b; whether factor and result are clamped.
    Mix(Blend, bool, bool),
    /// An affine map, rows.
    Matrix([[f32; 4]; 3]),
    /// The same, for directions: the result has unit length.
    Unit,
    /// A table over 0..1; whether it is interpolated.
    Ramp(Arc<[Value]>, bool),
    /// Three tables, one for each channel, mixed in by the second argument.
    Curves(Arc<[Value]>),
    /// Checker: place, first colour, second colour, scale. With `true`: which of them as a number.
    Checker(bool),
    /// Noise: place, scale, detail, roughness, lacunarity; `true`: as a colour; then normalize.
    Noise(bool, bool),
    /// Gradient at a place.
    Gradient(Gradient),
    /// Factor, colour.
    Invert,
    /// Colour, exponent.
    Gamma,
    /// Colour, brightness, contrast.
    BrightContrast,
    /// Colour, hue, saturation, value, factor.
    HueSaturation,
    /// Value, from min, from max, to min, to max; whether the result is clamped.
    MapRange(Ease, bool),
    /// Value, min, max.
    Clamp,
    /// Index of refraction.
    Fresnel,
    /// Blend.
    LayerFresnel,
    /// Blend.
    LayerFacing,
    /// Colour and strength of a tangent-space normal map, over the tangents of an attribute.
    NormalMap(u16),
    /// Colour and strength of a normal map in object space (`true`) or in the world.
    NormalMapSpace(bool),
}

impl Op {
    /// Whether the value depends on the arguments alone.
    pub(super) fn is_pure(&self) -> bool {
        !matches!(
            self,
            Self::Image { .. }
                | Self::Attribute(_)
                | Self::Coordinate(_)
                | Self::Fresnel
                | Self::LayerFresnel
                | Self::LayerFacing
                | Self::NormalMap(_)
                | Self::NormalMapSpace(_)
        )
    }

    /// How many arguments it takes.
    pub fn arity(&self) -> usize {
        match self {
            Self::Attribute(_) | Self::Coordinate(_) => 0,
            Self::Image { .. }
            | Self::Alpha
            | Self::Channel(_)
            | Self::Luminance
            | Self::Mean
            | Self::Matrix(_)
            | Self::Unit
            | Self::Ramp(..)
            | Self::Gradient(_)
            | Self::Fresnel
            | Self::LayerFresnel
            | Self::LayerFacing => 1,
            Self::Invert
            | Self::Gamma
            | Self::Curves(_)
            | Self::NormalMap(_)
            | Self::NormalMapSpace(_) => 2,
            Self::Math(..)
            | Self::VectorMath(_)
            | Self::Mix(..)
            | Self::Combine
            | Self::BrightContrast
            | Self::Clamp => 3,
            Self::Checker(_) => 4,
            Self::Noise(..) | Self::HueSaturation | Self::MapRange(..) => 5,
        }
    }
}

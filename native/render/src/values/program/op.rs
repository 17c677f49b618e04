// SPDX-License-Identifier: GPL-3.0-or-later
//! The operations of program steps.

use std::sync::Arc;

use crate::values::image::{Extension, Interpolation};
use crate::values::math_nodes::{Blend, Math, VectorMath};
use crate::values::program::Value;

/// Coordinates of the point to be shaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// Position in the object's box, scaled to 0..1.
    Generated,
    /// Position in object space.
    Object,
    /// Shading normal in object space.
    ObjectNormal,
    /// Position in world space.
    Position,
    /// Shading normal in world space.
    Normal,
    /// Geometric normal in world space.
    TrueNormal,
    /// Direction towards the viewer.
    Incoming,
    /// Direction towards the viewer, mirrored at the shading normal.
    Reflection,
    /// 1 on the back of a triangle.
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

/// Shape of a gradient texture.
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

/// Interpolation of the Map Range node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ease {
    /// Linear.
    Linear,
    /// Cubic.
    Smooth,
    /// Polynomial of degree five.
    Smoother,
}

/// The operation of a step.
#[derive(Debug, Clone)]
pub enum Op {
    /// Colour and alpha of an image at (u, v).
    Image {
        /// Index of the image.
        image: u16,
        /// Interpolation between texels.
        interpolation: Interpolation,
        /// Continuation outside of the image.
        extension: Extension,
        /// Whether to divide the colour by alpha.
        unassociate: bool,
        /// Whether the argument is a direction and the image an equirectangular map.
        panorama: bool,
    },
    /// Attribute of the corners: a UV map or a colour.
    Attribute(u16),
    /// Coordinate of the point, see [`Coordinate`].
    Coordinate(Coordinate),
    /// Fourth component of the argument.
    Alpha,
    /// One component of the argument.
    Channel(u8),
    /// Three numbers combined to a vector.
    Combine,
    /// Luminance of a colour.
    Luminance,
    /// Mean of a vector's components.
    Mean,
    /// The Math node; whether the result is clamped to 0..1.
    Math(Math, bool),
    /// The Vector Math node.
    VectorMath(VectorMath),
    /// The Mix node with arguments factor, a, b; whether factor and result are clamped.
    Mix(Blend, bool, bool),
    /// Affine map; rows.
    Matrix([[f32; 4]; 3]),
    /// Normalization to unit length.
    Unit,
    /// Table over 0..1; whether to interpolate.
    Ramp(Arc<[Value]>, bool),
    /// One table per channel, blended in by the second argument.
    Curves(Arc<[Value]>),
    /// Checker of position, first colour, second colour, scale; `true`: returns the factor instead of a colour.
    Checker(bool),
    /// Noise of position, scale, detail, roughness, lacunarity; whether it returns a colour, and whether it is
    /// normalized.
    Noise(bool, bool),
    /// Gradient at a position.
    Gradient(Gradient),
    /// Inverts: factor, colour.
    Invert,
    /// Gamma: colour, exponent.
    Gamma,
    /// Bright/Contrast: colour, brightness, contrast.
    BrightContrast,
    /// Hue/Saturation/Value: colour, hue, saturation, value, factor.
    HueSaturation,
    /// Map Range: value, from min, from max, to min, to max; whether the result is clamped.
    MapRange(Ease, bool),
    /// Clamp: value, min, max.
    Clamp,
    /// Fresnel: index of refraction.
    Fresnel,
    /// Layer Weight, Fresnel: blend.
    LayerFresnel,
    /// Layer Weight, Facing: blend.
    LayerFacing,
    /// Tangent-space normal map: colour and strength, with the tangents of a layer.
    NormalMap(u16),
    /// Normal map in object space (`true`) or world space: colour and strength.
    NormalMapSpace(bool),
}

impl Op {
    /// Whether the result depends on the arguments only.
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

    /// Returns the number of arguments.
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

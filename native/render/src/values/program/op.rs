// SPDX-License-Identifier: GPL-3.0-or-later
//! The operations of program steps.

use std::sync::Arc;

use crate::values::ies::Ies;
use crate::values::image::projection::Projection;
use crate::values::image::{Extension, Interpolation};
use crate::values::math_nodes::{Blend, Math, VectorMath, named};
use crate::values::program::Value;
use crate::values::rays::{Occlusion, Raycast};
use crate::values::texture::fractal::NoiseKind;
use crate::values::texture::gabor::GaborOutput;
use crate::values::texture::pattern::{Profile, Rows, WaveShape};
use crate::values::texture::radial::RadialOutput;
use crate::values::texture::voronoi::{Feature, Metric};

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
    /// 1 after a glossy reflection, a mirror or a refraction.
    GlossyRay,
    /// 1 after light has gone through a surface, scattered or refracted.
    TransmissionRay,
    /// 1 after a reflection, diffuse or glossy.
    ReflectionRay,
    /// 1 after a mirror or a clear refraction.
    SingularRay,
    /// 1 after scattering in a volume.
    VolumeRay,
    /// Length of the ray since it scattered.
    RayLength,
    /// Number of times that the path scattered.
    RayDepth,
    /// Number of its diffuse bounces.
    DiffuseDepth,
    /// Number of its glossy bounces.
    GlossyDepth,
    /// Number of its refractions.
    TransmissionDepth,
    /// Number of transparent surfaces that it passed.
    TransparentDepth,
    /// Number of portals that it passed.
    PortalDepth,
    /// Direction around the X axis of the object's box, perpendicular to the shading normal.
    TangentX,
    /// The same around Y.
    TangentY,
    /// The same around Z.
    TangentZ,
    /// Edge of the triangle from its first to its second corner, negated on its back.
    EdgeU,
    /// The same to its third corner.
    EdgeV,
    /// Barycentric weights of the triangle's first two corners.
    Parametric,
    /// Position in camera space, with Z along the view.
    Camera,
    /// Unit vector from the camera to the point, in camera space.
    ViewVector,
    /// Depth of the point behind the camera's plane.
    ViewDepth,
    /// Distance of the point from the camera.
    ViewDistance,
    /// Position in the picture, from 0 to 1 along each side.
    Window,
}

/// Where a value is computed: at the shaded point, or next to it for the differences of heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Shift {
    /// At the point.
    #[default]
    None,
    /// This share of a pixel's width along the first axis of the surface.
    X(f32),
    /// The same along the second axis.
    Y(f32),
}

/// Settings of a bump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    /// Share of a pixel's width between the heights.
    pub width: f32,
    /// Whether heights lower the surface.
    pub invert: bool,
    /// Whether heights are lengths in the object's space instead of the world's.
    pub object: bool,
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
    /// Linear, in a number of equal steps.
    Stepped,
}

/// A model of colours other than RGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorModel {
    /// Hue, saturation, value.
    Hsv,
    /// Hue, saturation, lightness.
    Hsl,
}

/// A space that vectors are given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// Blender's world.
    World,
    /// The space of the object that is shaded.
    Object,
    /// The camera's, with Z along the view.
    Camera,
}

/// Kind of a vector that is transformed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorKind {
    /// A position.
    Point,
    /// A direction and its length.
    Vector,
    /// A normal, which is returned with unit length.
    Normal,
}

/// Number of coordinates that a texture uses, and what it returns. One coordinate is the fourth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spread {
    /// 1 to 4.
    pub dimensions: u8,
    /// Whether it returns a colour instead of a number.
    pub color: bool,
}

/// Fractal noise of position, fourth coordinate, scale, detail, roughness, lacunarity, offset, gain, distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Coordinates and result.
    pub spread: Spread,
    /// How octaves are combined.
    pub kind: NoiseKind,
    /// Whether the sum of octaves is scaled to 0..1.
    pub normalize: bool,
}

named! {
    /// Outputs of the Voronoi texture.
    CellOutput {
        Distance = "Distance", Color = "Color", Position = "Position", W = "W", Radius = "Radius",
    }
}

/// Voronoi cells of position, fourth coordinate, scale, detail, roughness, lacunarity, smoothness, exponent,
/// randomness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cells {
    /// 1 to 4.
    pub dimensions: u8,
    /// Measured quantity.
    pub feature: Feature,
    /// How distances are measured.
    pub metric: Metric,
    /// Whether distances and colours are scaled to 0..1.
    pub normalize: bool,
    /// Returned quantity.
    pub output: CellOutput,
    /// Whether points and colours are those of Blender before 5.0.
    pub earlier: bool,
}

/// The operation of a step.
#[derive(Debug, Clone)]
pub enum Op {
    /// Colour and alpha of an image for a vector and, in a box, a normal.
    Image {
        /// Index of the image.
        image: u16,
        /// Interpolation between texels.
        interpolation: Interpolation,
        /// Continuation outside of the image.
        extension: Extension,
        /// Whether to divide the colour by alpha.
        unassociate: bool,
        /// How the vector becomes a place on the image.
        projection: Projection,
    },
    /// Attribute of the corners: a UV map or a colour; at the point, or next to it.
    Attribute(u16, Shift),
    /// Coordinate of the point, see [`Coordinate`], or of one next to it.
    Coordinate(Coordinate, Shift),
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
    /// One table per channel, blended in by the second argument; `true`: continued beyond its ends.
    Curves(Arc<[Value]>, bool),
    /// Checker of position, first colour, second colour, scale; `true`: returns the factor instead of a colour.
    Checker(bool),
    /// Fractal noise.
    Noise(Noise),
    /// White noise of position and fourth coordinate.
    WhiteNoise(Spread),
    /// Voronoi cells.
    Voronoi(Cells),
    /// Gabor noise of position, scale, frequency, anisotropy, and angle or direction; `true`: of three dimensions.
    Gabor(GaborOutput, bool),
    /// Wave of position, scale, distortion, detail, detail scale, detail roughness, phase.
    Wave(WaveShape, Profile),
    /// Magic texture of this depth, of position, scale, distortion: a colour.
    Magic(u32),
    /// Bricks of position, two colours, mortar's colour, scale, mortar's size and smoothness, bias, width, height;
    /// `true`: returns the share of mortar instead of a colour.
    Brick(Rows, bool),
    /// Gradient at a position.
    Gradient(Gradient),
    /// Radial Tiling of position, sides, roundness; `true`: positions along the sides are 0..1.
    RadialTiling(RadialOutput, bool),
    /// Inverts: factor, colour.
    Invert,
    /// Gamma: colour, exponent.
    Gamma,
    /// Bright/Contrast: colour, brightness, contrast.
    BrightContrast,
    /// Hue/Saturation/Value: colour, hue, saturation, value, factor.
    HueSaturation,
    /// Map Range: value, from min, from max, to min, to max, steps; whether the result is clamped.
    MapRange(Ease, bool),
    /// Map Range of each component of vectors.
    MapRangeVector(Ease, bool),
    /// Conversion of a colour from RGB to a model (`true`), or back.
    Convert(ColorModel, bool),
    /// Colour of a black body: temperature.
    Blackbody,
    /// Colour of a wavelength, nm.
    Wavelength,
    /// Intensity of a photometric table in a direction.
    Ies(Arc<Ies>),
    /// Rotation of a vector around a centre, an axis and an angle.
    RotateAxis,
    /// Rotation of a vector around a centre by Euler angles; `true`: inverted.
    RotateEuler(bool),
    /// Value of the object that is shaded, see [`ObjectFrame::values`](crate::values::varying::ObjectFrame).
    ObjectValue(u16),
    /// The value of the voxels with this number, counted from 1, at a position in object space; the third argument for
    /// the number 0. The largest value nearby where a volume is probed.
    Voxels,
    /// Vector Transform between two spaces.
    Transform(VectorKind, Space, Space),
    /// Clamp: value, min, max.
    Clamp,
    /// Fresnel: index of refraction.
    Fresnel,
    /// Layer Weight, Fresnel: blend.
    LayerFresnel,
    /// Layer Weight, Facing: blend.
    LayerFacing,
    /// 1 near the edges of triangles: width of the lines; `true`: in pixels instead of scene units.
    Wireframe(bool),
    /// Tangent-space normal map: colour and strength, with the tangents of a layer.
    NormalMap(u16),
    /// Normal map in object space (`true`) or world space: colour and strength.
    NormalMapSpace(bool),
    /// Bump of the heights at the point, and next to it along both axes; strength, distance, and normal.
    Bump(Bump),
    /// Share of directions without anything near: distance, and normal; 0 = that of the point.
    Occlusion(Occlusion),
    /// Mean normal within a radius, from this number of rays.
    Bevel(u8),
    /// Hit of a ray: position, direction, length.
    Raycast(Raycast),
}

impl Op {
    /// Whether the result depends on the arguments only.
    pub(super) fn is_pure(&self) -> bool {
        !matches!(
            self,
            Self::Image { .. }
                | Self::Attribute(..)
                | Self::Coordinate(..)
                | Self::ObjectValue(_)
                | Self::Voxels
                | Self::Transform(..)
                | Self::Fresnel
                | Self::LayerFresnel
                | Self::LayerFacing
                | Self::Wireframe(_)
                | Self::NormalMap(_)
                | Self::NormalMapSpace(_)
                | Self::Bump(_)
                | Self::Occlusion(_)
                | Self::Bevel(_)
                | Self::Raycast(_)
        )
    }

    /// Whether the operation traces rays where the point has surroundings.
    pub fn traces_rays(&self) -> bool {
        matches!(self, Self::Occlusion(_) | Self::Bevel(_) | Self::Raycast(_))
    }

    /// Whether the operation reads the number of transparent surfaces that the ray has passed.
    pub fn counts_passed(&self) -> bool {
        matches!(self, Self::Coordinate(Coordinate::TransparentDepth, _))
    }

    /// Returns the number of arguments.
    pub fn arity(&self) -> usize {
        match self {
            Self::Attribute(..) | Self::Coordinate(..) | Self::ObjectValue(_) => 0,
            Self::Image {
                projection: Projection::Box(_),
                ..
            } => 2,
            Self::Image { .. }
            | Self::Alpha
            | Self::Channel(_)
            | Self::Luminance
            | Self::Mean
            | Self::Matrix(_)
            | Self::Unit
            | Self::Convert(..)
            | Self::Blackbody
            | Self::Wavelength
            | Self::Ies(_)
            | Self::Transform(..)
            | Self::Ramp(..)
            | Self::Gradient(_)
            | Self::Wireframe(_)
            | Self::Bevel(_)
            | Self::Fresnel
            | Self::LayerFresnel
            | Self::LayerFacing => 1,
            Self::Invert
            | Self::Gamma
            | Self::Curves(..)
            | Self::NormalMap(_)
            | Self::NormalMapSpace(_)
            | Self::Occlusion(_)
            | Self::WhiteNoise(_) => 2,
            Self::Math(..)
            | Self::VectorMath(_)
            | Self::Mix(..)
            | Self::Combine
            | Self::BrightContrast
            | Self::Magic(_)
            | Self::RotateEuler(_)
            | Self::Clamp
            | Self::RadialTiling(..)
            | Self::Raycast(_)
            | Self::Voxels => 3,
            Self::Checker(_) | Self::RotateAxis => 4,
            Self::HueSaturation | Self::Gabor(..) => 5,
            Self::Bump(_) | Self::MapRange(..) | Self::MapRangeVector(..) => 6,
            Self::Wave(..) => 7,
            Self::Noise(_) | Self::Voronoi(_) => 9,
            Self::Brick(..) => 10,
        }
    }
}

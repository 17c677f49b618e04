// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of closures.

use crate::material::microfacets::Distribution;
use crate::medium::inversion::Inversion;
use crate::values::program::Operand;

/// The shader node of a closure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClosureKind {
    /// Principled BSDF.
    Principled,
    /// Diffuse BSDF.
    Diffuse,
    /// Translucent BSDF.
    Translucent,
    /// Glossy BSDF.
    Glossy,
    /// Glass BSDF.
    Glass,
    /// Refraction BSDF.
    Refraction,
    /// Transparent BSDF.
    Transparent,
    /// Emission.
    Emission,
    /// Metallic BSDF with indices of refraction per channel.
    Conductor,
    /// Sheen BSDF of microfibres.
    Sheen,
    /// Sheen BSDF after Ashikhmin.
    Velvet,
    /// Toon BSDF, diffuse.
    ToonDiffuse,
    /// Toon BSDF, glossy.
    ToonGlossy,
    /// Subsurface Scattering.
    Subsurface,
    /// Principled Hair BSDF.
    Hair,
    /// Hair BSDF, reflection.
    HairReflection,
    /// Hair BSDF, transmission.
    HairTransmission,
    /// Holdout: a hole in the picture.
    Holdout,
}

/// The inputs of a closure that other nodes can drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Weight within the material: the product of the mix factors above it.
    Weight,
    /// Colour.
    Color,
    /// Share of metal, 0..1.
    Metallic,
    /// 0 = mirror, 1 = fully rough.
    Roughness,
    /// Index of refraction.
    Ior,
    /// Share of glass in what is not metal, 0..1.
    Transmission,
    /// "IOR level": scales the reflectance at normal incidence; 0.5 leaves what `ior` gives.
    Specular,
    /// Colour of the dielectric's reflection, and of the metal's edge.
    SpecularTint,
    /// Emitted radiance, on both sides.
    Emission,
    /// Opacity.
    Alpha,
    /// Weight of the clear coat.
    CoatWeight,
    /// Roughness of the clear coat.
    CoatRoughness,
    /// Index of refraction of the clear coat.
    CoatIor,
    /// Transmittance of the clear coat's absorption at normal incidence.
    CoatTint,
    /// Roughness of the diffuse base, 0..1; 0 = Lambertian.
    DiffuseRoughness,
    /// How much facets are stretched along or across the tangent; 0 = not at all.
    Anisotropy,
    /// Rotation of the tangent about the normal, in turns.
    Rotation,
    /// Tangent of stretched facets, or direction along the hair, in scene space; 0 = any.
    Tangent,
    /// Normal of the coat in scene space; 0 = the surface's.
    CoatNormal,
    /// Normal of the closure in scene space; 0 = the surface's. Set where closures have several.
    Normal,
    /// Weight of the sheen on top of everything.
    SheenWeight,
    /// Roughness of the sheen.
    SheenRoughness,
    /// Colour of the sheen.
    SheenTint,
    /// Width of the soft edge of a toon lobe, 0..1; its `Roughness` is the size.
    Smooth,
    /// Extinction coefficients of a conductor, whose `Color` are the indices of refraction.
    Extinction,
    /// Thickness of a thin film in nm; 0 = none.
    FilmThickness,
    /// Index of refraction of the thin film.
    FilmIor,
    /// Share of the diffuse base below which light walks, 0..1.
    SubsurfaceWeight,
    /// Mean free paths of light below the surface by channel, multiplied by `SubsurfaceScale`.
    SubsurfaceRadius,
    /// Length of one unit of `SubsurfaceRadius` in scene units.
    SubsurfaceScale,
    /// Index of refraction at which light enters; that of the layer for most Principled closures.
    SubsurfaceIor,
    /// Mean cosine of scattering below the surface, -1..1.
    SubsurfaceAnisotropy,
    /// Azimuthal roughness of hair.
    RadialRoughness,
    /// Tilt of the scales of hair in radians.
    Offset,
    /// Share of melanin in hair, 0..1.
    Melanin,
    /// Share of pheomelanin in it.
    Redness,
    /// Absorption coefficient of hair, to which those of melanin and `Color` are added.
    Absorption,
    /// Share of the diffuse base that sends light to the other side, 0..1.
    Translucency,
}

/// Largest number of closures of a material; more are an error.
pub const MAX_CLOSURES: usize = 8;

/// Largest number of Principled closures among them, which have several lobes each.
pub const MAX_PRINCIPLED: usize = 4;

/// Number of inputs in [`Input`].
pub const INPUTS: usize = 38;

/// Parameters of a closure.
#[derive(Debug, Clone)]
pub struct ClosureParams {
    /// The shader node.
    pub kind: ClosureKind,
    /// Values or registers, by [`Input`].
    pub inputs: [Operand; INPUTS],
    /// Shading normal; `None` = the surface's.
    pub normal: Option<Operand>,
    /// Whether rough lobes are scaled to lose no energy.
    pub multiscatter: bool,
    /// Distribution of the facets.
    pub distribution: Distribution,
    /// How light scatters below the surface.
    pub method: Inversion,
}

impl ClosureParams {
    /// A closure with Blender's default inputs.
    pub fn new(kind: ClosureKind) -> Self {
        let mut inputs = [Operand::number(0.0); INPUTS];
        let mut set = |input: Input, value: f32| inputs[input as usize] = Operand::number(value);
        set(Input::Weight, 1.0);
        set(Input::Color, 0.8);
        set(Input::Roughness, 0.5);
        set(Input::Ior, 1.5);
        set(Input::Specular, 0.5);
        set(Input::SpecularTint, 1.0);
        set(Input::Alpha, 1.0);
        set(Input::CoatRoughness, 0.03);
        set(Input::CoatIor, 1.5);
        set(Input::CoatTint, 1.0);
        set(Input::SheenRoughness, 0.5);
        set(Input::SheenTint, 1.0);
        set(Input::FilmIor, 1.33);
        set(Input::RadialRoughness, 0.3);
        set(Input::SubsurfaceScale, 0.05);
        set(Input::SubsurfaceIor, 1.4);
        inputs[Input::SubsurfaceRadius as usize] = Operand::color([1.0, 0.2, 0.1]);
        Self {
            kind,
            inputs,
            normal: None,
            multiscatter: true,
            distribution: Distribution::Ggx,
            method: Inversion::RandomWalk,
        }
    }
}

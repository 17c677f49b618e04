// SPDX-License-Identifier: GPL-3.0-or-later
//! Closures as their user describes them.

use super::super::program::Operand;

/// Which shader node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Principled BSDF.
    Principled,
    /// Diffuse BSDF.
    Diffuse,
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
}

/// The inputs of a closure that a node can drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Share of the material: the product of the mix factors above it.
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
    /// "IOR level": 0.5 leaves the reflectance as `ior` gives it.
    Specular,
    /// Colour of the dielectric's reflection, and of the metal's edge.
    SpecularTint,
    /// Emitted radiance, both sides.
    Emission,
    /// Opacity.
    Alpha,
    /// Share of the clear coat.
    CoatWeight,
    /// Its roughness.
    CoatRoughness,
    /// Its index.
    CoatIor,
    /// Its absorption.
    CoatTint,
}

/// How many there are.
pub const INPUTS: usize = 14;

/// A closure as its user describes it.
#[derive(Debug, Clone)]
pub struct ClosureParams {
    /// Which.
    pub kind: Kind,
    /// By [`Input`].
    pub inputs: [Operand; INPUTS],
    /// Shading normal; `None` = the surface's own.
    pub normal: Option<Operand>,
    /// Whether rough lobes are scaled to lose no energy.
    pub multiscatter: bool,
}

impl ClosureParams {
    /// With Blender's defaults.
    pub fn new(kind: Kind) -> Self {
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
        Self {
            kind,
            inputs,
            normal: None,
            multiscatter: true,
        }
    }
}

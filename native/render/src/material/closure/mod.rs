// SPDX-License-Identifier: GPL-3.0-or-later
//! Closures: the shader nodes of a material, each with a weight, and the lobes they consist of.
//!
//! Lobes and weights follow Cycles (Blender 5.2). Principled, from the top: a clear coat; metal with weight
//! `metallic`; of the remainder glass with weight `transmission`; of the remainder a dielectric layer of index
//! `ior`, scaled by `specular`, over a Lambertian base that receives what the layer transmits. Rough lobes are
//! scaled so that they lose no energy ("multiscatter GGX").

use crate::material::albedo::Grids;
use crate::material::microfacets::Distribution;
use crate::math::fresnel;
use crate::math::vector::Vec3;
use crate::medium::inversion::Inversion;
use crate::values::program::{Operand, Value, read, rgb};

mod layering;
mod lobe_grids;
mod lobes;
mod params;
mod reflectance;
mod special;
mod subsurface;

pub use crate::material::closure::layering::{
    ChannelAlbedo, absorbed, coat_albedos, compensation_per_channel,
};
pub use crate::material::closure::lobe_grids::LobeGrids;
pub use crate::material::closure::lobes::{Lobes, Reflector, Transmitter};
pub use crate::material::closure::params::{
    ClosureKind, ClosureParams, INPUTS, Input, MAX_CLOSURES, MAX_PRINCIPLED,
};
pub use crate::material::closure::reflectance::{Fresnel, Reflected, conductor};
pub use crate::material::closure::special::{Hair, SheenLayer, Single, Special};
pub use crate::material::closure::subsurface::Subsurface;

/// Light of a closure, or of a material, that no lobe scatters: emission and straight transmission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unscattered {
    /// Emitted radiance; may be negative, as in Cycles.
    pub emission: Vec3,
    /// Factor on light that passes straight through.
    pub transparent: Vec3,
    /// Weight of the lobes.
    pub scattering: f32,
    /// Weight of holes in the picture: light that camera rays find missing, with its opacity.
    pub holdout: f32,
}

impl Unscattered {
    /// Nothing.
    pub const NONE: Self = Self {
        emission: Vec3::ZERO,
        transparent: Vec3::ZERO,
        scattering: 0.0,
        holdout: 0.0,
    };

    /// Returns the probability with which a path passes straight through: the share of the transparent part.
    #[inline(always)]
    pub fn pass_probability(&self) -> f32 {
        let passing = self.transparent.mean();
        if passing > 0.0 {
            passing / (passing + self.scattering + self.holdout)
        } else {
            0.0
        }
    }

    /// Returns the opacity of what does not pass.
    #[inline(always)]
    pub fn opacity(&self) -> f32 {
        if self.holdout > 0.0 {
            self.scattering / (self.scattering + self.holdout)
        } else {
            1.0
        }
    }
}

/// A closure ready for shading.
#[derive(Debug, Clone)]
pub struct Closure {
    kind: ClosureKind,
    /// Constants or registers of the program, by [`Input`].
    inputs: [Operand; INPUTS],
    /// Whether rough lobes are scaled to lose no energy.
    pub multiscatter: bool,
    /// Albedos of the rough lobes.
    pub grids: LobeGrids,
    /// The lobes, if all inputs are constant.
    fixed: Option<Lobes>,
    /// Distribution of the facets.
    distribution: Distribution,
    /// How light scatters below the surface.
    method: Inversion,
    /// Whether its normal differs from that of the material.
    pub turned: bool,
    /// Whether the normal of the coat differs from that of the material.
    pub coat_apart: bool,
}

impl Closure {
    /// Prepares a closure for shading. Its operands must refer to registers of the material's compiled program.
    pub fn new(params: &ClosureParams, grids: &mut Grids) -> Self {
        // Choose the grids of albedos by what varies.
        let mut closure = Self {
            kind: params.kind,
            inputs: params.inputs,
            multiscatter: params.multiscatter,
            grids: LobeGrids::default(),
            fixed: None,
            distribution: params.distribution,
            method: params.method,
            turned: false,
            coat_apart: false,
        };
        closure.make_grids(grids);
        // Constant inputs: compute the lobes once, with the accurate mean of the Fresnel reflectance.
        if closure.varying().next().is_none() {
            closure.fixed = Some(closure.compute(&[], fresnel::dielectric_mean));
        }
        closure
    }

    /// The registers that the inputs read.
    fn varying(&self) -> impl Iterator<Item = u16> + '_ {
        self.inputs.iter().filter_map(|operand| match operand {
            Operand::Register(r) => Some(*r),
            Operand::Value(_) => None,
        })
    }

    /// The value of an input, if it is constant.
    fn constant(&self, input: Input) -> Option<Vec3> {
        self.inputs[input as usize].constant()
    }

    /// Whether an input can have another value than `from`.
    fn can_differ(&self, input: Input, from: f32) -> bool {
        self.constant(input).is_none_or(|v| v != Vec3::splat(from))
    }

    /// Whether the closure can have lobes that reflect off facets.
    pub fn may_reflect(&self) -> bool {
        // Principled reflects by metal, layer or coat; glass is handled as a boundary.
        match self.kind {
            ClosureKind::Principled => {
                self.can_differ(Input::Metallic, 0.0)
                    || self.can_differ(Input::Specular, 0.0)
                    || self.can_differ(Input::CoatWeight, 0.0)
            }
            ClosureKind::Glossy | ClosureKind::Conductor => true,
            _ => false,
        }
    }

    /// Whether the diffuse base can be rough.
    pub fn may_be_rough(&self) -> bool {
        matches!(self.kind, ClosureKind::Principled | ClosureKind::Diffuse)
            && self.can_differ(Input::DiffuseRoughness, 0.0)
    }

    /// Whether the closure scatters light to the other side without a direction.
    pub fn is_translucent(&self) -> bool {
        self.kind == ClosureKind::Translucent
            || (self.kind == ClosureKind::Principled && self.can_differ(Input::Translucency, 0.0))
    }

    /// Whether the closure can have a lobe that refracts.
    pub fn may_refract(&self) -> bool {
        match self.kind {
            ClosureKind::Principled => self.can_differ(Input::Transmission, 0.0),
            ClosureKind::Glass | ClosureKind::Refraction => true,
            _ => false,
        }
    }

    /// Whether light can pass the closure straight.
    pub fn may_be_transparent(&self) -> bool {
        match self.kind {
            ClosureKind::Principled => self.constant(Input::Alpha).is_none_or(|v| v.x < 1.0),
            ClosureKind::Transparent => true,
            _ => false,
        }
    }

    /// Whether the closure can emit light.
    pub fn may_emit(&self) -> bool {
        matches!(self.kind, ClosureKind::Principled | ClosureKind::Emission)
            && self.can_differ(Input::Emission, 0.0)
            && self.can_differ(Input::Weight, 0.0)
    }

    /// Returns the lobes for these registers of the material's program.
    #[inline(always)]
    pub fn lobes(&self, registers: &[Value]) -> Lobes {
        match &self.fixed {
            Some(lobes) => *lobes,
            None => self.compute(registers, fresnel::dielectric_mean_quick),
        }
    }

    /// The lobes, if all inputs are constant.
    #[inline(always)]
    pub fn fixed_lobes(&self) -> Option<&Lobes> {
        self.fixed.as_ref()
    }

    /// Whether the closure emits below a coat or sheen, so that its emission depends on the direction.
    pub fn dims_emission(&self) -> bool {
        self.kind == ClosureKind::Principled
            && (self.can_differ(Input::CoatWeight, 0.0) || self.can_differ(Input::SheenWeight, 0.0))
            && self.may_emit()
    }

    /// Returns what the closure emits and lets through straight, before a coat absorbs any of it.
    pub fn unscattered(&self, registers: &[Value]) -> Unscattered {
        // Alpha divides the closure into a transparent part and a scattering one, which emits and scatters.
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let weight = get(Input::Weight).x.max(0.0);
        let mut unscattered = Unscattered::NONE;
        match self.kind {
            ClosureKind::Principled => {
                let alpha = get(Input::Alpha).x.clamp(0.0, 1.0);
                unscattered.transparent = Vec3::splat(weight * (1.0 - alpha));
                unscattered.scattering = weight * alpha;
                unscattered.emission = get(Input::Emission) * unscattered.scattering;
            }
            ClosureKind::Transparent => {
                unscattered.transparent = positive(get(Input::Color)) * weight
            }
            ClosureKind::Emission => unscattered.emission = get(Input::Emission) * weight,
            ClosureKind::Holdout => unscattered.holdout = weight,
            _ => unscattered.scattering = weight,
        }
        unscattered
    }
}

/// Replaces negative components by 0.
fn positive(c: Vec3) -> Vec3 {
    c.map(|x| x.max(0.0))
}

/// Keeps optical constants of a conductor within 0..1e4, so that their fourth powers are finite.
fn optical(c: Vec3) -> Vec3 {
    c.map(|x| x.clamp(0.0, 1e4))
}

/// Keeps an index of refraction within 1e-3..1e3.
fn clamp_index(ior: f32) -> f32 {
    ior.clamp(1e-3, 1e3)
}

/// Index of the coat, never below 1, as in Cycles.
fn coat_index(ior: f32) -> f32 {
    clamp_index(ior).max(1.0)
}

/// Index of the dielectric layer. `specular` scales the reflectance at normal incidence; 0.5 leaves it unchanged.
fn layer_index(ior: f32, specular: f32) -> f32 {
    if specular == 0.5 {
        return ior;
    }
    // Scale the reflectance and convert back to an index on the same side of 1.
    let eta = fresnel::ior_from_f0(fresnel::f0_from_ior(ior) * 2.0 * specular);
    if ior < 1.0 { 1.0 / eta } else { eta }
}

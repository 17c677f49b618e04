// SPDX-License-Identifier: GPL-3.0-or-later
//! Closures: the shader nodes of a material, each with a weight, as the lobes they consist of.
//!
//! Lobes and weights follow Cycles (Blender 5.2). Principled, from the top: a clear coat; metal
//! with weight `metallic`; of the rest glass with weight `transmission`; of the rest a dielectric
//! layer of the index `ior`, scaled by `specular`, over a Lambertian base that receives what the
//! layer lets through. Rough lobes are scaled to lose no energy ("multiscatter GGX").

use super::albedo::Grids;
use super::fresnel;
use super::program::{Operand, Value, read, rgb};
use super::vector::Vec3;

mod layering;
mod lobe_grids;
mod lobes;
mod params;
mod reflectance;

pub use self::layering::{absorbed, coat_albedos, regain_each};
pub use self::lobe_grids::LobeGrids;
pub use self::lobes::{Parts, Reflector, Transmitter};
pub use self::params::{ClosureParams, INPUTS, Input, Kind};
pub use self::reflectance::{Fresnel, Reflected};

/// What a closure adds beside its lobes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Emitted radiance.
    pub emission: Vec3,
    /// What passes straight through.
    pub transparent: Vec3,
    /// Share of the lobes.
    pub solid: f32,
}

/// A closure ready for shading.
#[derive(Debug, Clone)]
pub struct Closure {
    kind: Kind,
    inputs: [Operand; INPUTS],
    /// Whether rough lobes are scaled to lose no energy.
    pub multiscatter: bool,
    /// Albedos.
    pub grids: LobeGrids,
    fixed: Option<Parts>,
}

impl Closure {
    /// Compiles; the operands must be those of the material's compiled program.
    pub fn new(params: &ClosureParams, grids: &mut Grids) -> Self {
        let mut closure = Self {
            kind: params.kind,
            inputs: params.inputs,
            multiscatter: params.multiscatter,
            grids: LobeGrids::default(),
            fixed: None,
        };
        closure.make_grids(grids);
        if closure.varying().next().is_none() {
            closure.fixed = Some(closure.compute(&[], fresnel::dielectric_mean));
        }
        closure
    }

    fn varying(&self) -> impl Iterator<Item = u16> + '_ {
        self.inputs.iter().filter_map(|operand| match operand {
            Operand::Register(r) => Some(*r),
            Operand::Value(_) => None,
        })
    }

    fn constant(&self, input: Input) -> Option<Vec3> {
        self.inputs[input as usize].constant()
    }

    /// Whether an input can be something else than this.
    fn can_differ(&self, input: Input, from: f32) -> bool {
        self.constant(input).is_none_or(|v| v != Vec3::splat(from))
    }

    /// Whether it can have lobes that reflect off facets.
    pub fn may_reflect(&self) -> bool {
        match self.kind {
            Kind::Principled => {
                self.can_differ(Input::Metallic, 0.0)
                    || self.can_differ(Input::Specular, 0.0)
                    || self.can_differ(Input::CoatWeight, 0.0)
            }
            Kind::Glossy => true,
            _ => false,
        }
    }

    /// Whether light can pass it refracted.
    pub fn may_refract(&self) -> bool {
        match self.kind {
            Kind::Principled => self.can_differ(Input::Transmission, 0.0),
            Kind::Glass | Kind::Refraction => true,
            _ => false,
        }
    }

    /// Whether light can pass it straight.
    pub fn may_be_transparent(&self) -> bool {
        match self.kind {
            Kind::Principled => self.constant(Input::Alpha).is_none_or(|v| v.x < 1.0),
            Kind::Transparent => true,
            _ => false,
        }
    }

    /// Whether it can emit.
    pub fn may_emit(&self) -> bool {
        matches!(self.kind, Kind::Principled | Kind::Emission)
            && self.can_differ(Input::Emission, 0.0)
            && self.can_differ(Input::Weight, 0.0)
    }

    /// The lobes, where the material's program has left these registers.
    #[inline(always)]
    pub fn parts(&self, registers: &[Value]) -> Parts {
        match &self.fixed {
            Some(parts) => *parts,
            None => self.compute(registers, fresnel::dielectric_mean_quick),
        }
    }

    /// Whether it emits below a coat, so that what it emits varies with the direction.
    pub fn dims_emission(&self) -> bool {
        self.kind == Kind::Principled && self.can_differ(Input::CoatWeight, 0.0) && self.may_emit()
    }

    /// Light that comes from it or passes it, without what a coat takes of it.
    pub fn look(&self, registers: &[Value]) -> Look {
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let weight = get(Input::Weight).x.max(0.0);
        let mut look = Look {
            emission: Vec3::ZERO,
            transparent: Vec3::ZERO,
            solid: 0.0,
        };
        match self.kind {
            Kind::Principled => {
                let alpha = get(Input::Alpha).x.clamp(0.0, 1.0);
                look.transparent = Vec3::splat(weight * (1.0 - alpha));
                look.solid = weight * alpha;
                look.emission = positive(get(Input::Emission)) * look.solid;
            }
            Kind::Transparent => look.transparent = positive(get(Input::Color)) * weight,
            Kind::Emission => look.emission = positive(get(Input::Emission)) * weight,
            _ => look.solid = weight,
        }
        look
    }
}

fn positive(c: Vec3) -> Vec3 {
    c.map(|x| x.max(0.0))
}

fn at_least_some(ior: f32) -> f32 {
    ior.clamp(1e-3, 1e3)
}

/// A coat is never thinner than what is around it, as in Cycles.
fn coat_index(ior: f32) -> f32 {
    at_least_some(ior).max(1.0)
}

/// Index of the dielectric layer: `specular` scales the reflectance at normal incidence.
fn layer_index(ior: f32, specular: f32) -> f32 {
    if specular == 0.5 {
        return ior;
    }
    let eta = fresnel::ior_from_f0(fresnel::f0_from_ior(ior) * 2.0 * specular);
    if ior < 1.0 { 1.0 / eta } else { eta }
}

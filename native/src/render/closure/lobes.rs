// SPDX-License-Identifier: GPL-3.0-or-later
//! The lobes of a closure, before anything is known of the viewer.

use super::super::fresnel;
use super::super::ggx::Ggx;
use super::super::program::{Operand, Value, read, rgb};
use super::super::vector::Vec3;
use super::reflectance::{Fresnel, Reflected, edge_dip};
use super::{Closure, INPUTS, Input, Kind, at_least_some, coat_index, layer_index, positive};

/// A rough or smooth reflection, before anything is known of the viewer.
#[derive(Debug, Clone, Copy)]
pub struct Reflector {
    /// Share of the closure.
    pub weight: Vec3,
    /// Facets.
    pub ggx: Ggx,
    /// Their roughness, for the grids.
    pub roughness: f32,
    /// What a facet reflects.
    pub fresnel: Fresnel,
    /// Mean of it, for light that bounces more than once.
    pub multiple: Vec3,
}

/// A rough or smooth boundary that light passes.
#[derive(Debug, Clone, Copy)]
pub struct Transmitter {
    /// Share of the closure.
    pub weight: f32,
    /// Facets.
    pub ggx: Ggx,
    /// Their roughness, for the grids.
    pub roughness: f32,
    /// Index of the inside over that of the outside.
    pub ior: f32,
    /// How what is reflected is coloured; `None` = nothing is, and all that can be is refracted.
    pub reflect: Option<Reflected>,
    /// Filter of each passage through the boundary.
    pub tint: Vec3,
}

/// The lobes of a closure, before anything is known of the viewer.
#[derive(Debug, Clone, Copy)]
pub struct Parts {
    /// Share of the material.
    pub weight: f32,
    /// Clear coat and its absorption.
    pub coat: Option<(Reflector, Vec3)>,
    /// Metal.
    pub metal: Option<Reflector>,
    /// Glass.
    pub glass: Option<Transmitter>,
    /// Dielectric layer.
    pub layer: Option<Reflector>,
    /// Albedo of the Lambertian base, before the layer takes its part.
    pub diffuse: Vec3,
}

/// Weights below this are dropped, as in Cycles.
const CUTOFF: f32 = 1e-5;

impl Closure {
    /// The lobes, by what the inputs are. `mean`: the mean reflectance of a dielectric of an index.
    pub(super) fn compute(&self, registers: &[Value], mean: fn(f32) -> f32) -> Parts {
        let inputs = Inputs {
            operands: &self.inputs,
            registers,
            mean,
        };
        let base = positive(inputs.get(Input::Color));
        let mut parts = Parts {
            weight: inputs.get(Input::Weight).x.max(0.0),
            coat: None,
            metal: None,
            glass: None,
            layer: None,
            diffuse: Vec3::ZERO,
        };
        match self.kind {
            Kind::Transparent | Kind::Emission => parts.weight = 0.0,
            Kind::Diffuse => parts.diffuse = base,
            Kind::Glossy => {
                let fresnel = Fresnel::Metal {
                    f0: base,
                    edge: base,
                    dip: Vec3::ZERO,
                };
                let roughness = inputs.share(Input::Roughness);
                parts.metal = Some(inputs.reflector(1.0, roughness, fresnel));
            }
            Kind::Glass | Kind::Refraction => {
                let roughness = inputs.share(Input::Roughness);
                parts.glass = Some(Transmitter {
                    weight: 1.0,
                    ggx: Ggx::new(roughness),
                    roughness,
                    ior: at_least_some(inputs.get(Input::Ior).x),
                    reflect: (self.kind == Kind::Glass).then_some(Reflected::Alike(base)),
                    tint: base,
                });
            }
            Kind::Principled => inputs.principled(base, &mut parts),
        }
        parts
    }
}

/// The inputs of a closure where the material's program has left these registers.
struct Inputs<'a> {
    operands: &'a [Operand; INPUTS],
    registers: &'a [Value],
    /// The mean reflectance of a dielectric of an index.
    mean: fn(f32) -> f32,
}

impl Inputs<'_> {
    #[inline(always)]
    fn get(&self, input: Input) -> Vec3 {
        rgb(read(self.operands[input as usize], self.registers))
    }

    #[inline(always)]
    fn share(&self, input: Input) -> f32 {
        self.get(input).x.clamp(0.0, 1.0)
    }

    #[inline(always)]
    fn reflector(&self, weight: f32, roughness: f32, fresnel: Fresnel) -> Reflector {
        Reflector {
            weight: Vec3::splat(weight),
            ggx: Ggx::new(roughness),
            roughness,
            fresnel,
            multiple: fresnel.mean(self.mean),
        }
    }

    /// The lobes of the Principled BSDF over a base of this colour, from the top.
    #[inline(always)]
    fn principled(&self, base: Vec3, parts: &mut Parts) {
        parts.weight *= self.share(Input::Alpha);
        let tint = positive(self.get(Input::SpecularTint));
        let clamped = base.map(|c| c.min(1.0));
        let roughness = self.share(Input::Roughness);
        parts.coat = self.coat();
        let (metallic, transmission) =
            (self.share(Input::Metallic), self.share(Input::Transmission));
        if metallic > CUTOFF {
            let fresnel = Fresnel::Metal {
                f0: clamped,
                edge: Vec3::ONE,
                dip: edge_dip(clamped, tint),
            };
            parts.metal = Some(self.reflector(metallic, roughness, fresnel));
        }
        let ior = at_least_some(self.get(Input::Ior).x);
        let glass = (1.0 - metallic) * transmission;
        if glass > CUTOFF {
            let own = fresnel::f0_from_ior(ior);
            let f0 = tint.map(|c| c.min(1.0)) * own;
            parts.glass = Some(Transmitter {
                weight: glass,
                ggx: Ggx::new(roughness),
                roughness,
                ior,
                reflect: Some(Reflected::Dielectric {
                    own,
                    least: fresnel::least(ior),
                    f0,
                }),
                tint: clamped.map(f32::sqrt),
            });
        }
        let rest = (1.0 - metallic) * (1.0 - transmission);
        let eta = layer_index(ior, self.get(Input::Specular).x.clamp(0.0, 1e3));
        if rest > CUTOFF && (eta - 1.0).abs() > 1e-6 {
            let fresnel = Fresnel::dielectric(eta, tint);
            parts.layer = Some(self.reflector(rest, roughness, fresnel));
        }
        parts.diffuse = base * rest;
    }

    /// The clear coat and its absorption.
    #[inline(always)]
    fn coat(&self) -> Option<(Reflector, Vec3)> {
        let coat = self.share(Input::CoatWeight);
        (coat > CUTOFF).then(|| {
            let eta = coat_index(self.get(Input::CoatIor).x);
            let fresnel = Fresnel::dielectric(eta, Vec3::ONE);
            let absorb = positive(self.get(Input::CoatTint)).map(|c| c.min(1.0));
            let roughness = self.share(Input::CoatRoughness);
            (self.reflector(coat, roughness, fresnel), absorb)
        })
    }
}

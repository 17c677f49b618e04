// SPDX-License-Identifier: GPL-3.0-or-later
//! The lobes of a closure before the viewing direction enters.

use crate::material::closure::reflectance::{Fresnel, Reflected, edge_dip};
use crate::material::closure::{
    Closure, ClosureKind, INPUTS, Input, clamp_index, coat_index, layer_index, optical, positive,
};
use crate::material::ggx::Ggx;
use crate::math::fresnel;
use crate::math::vector::Vec3;
use crate::values::program::{Operand, Value, read, rgb};

/// A rough or smooth reflection, independent of the viewing direction.
#[derive(Debug, Clone, Copy)]
pub struct Reflector {
    /// Weight within the closure.
    pub weight: Vec3,
    /// Distribution of the facets.
    pub ggx: Ggx,
    /// Roughness of the facets, to look up grids.
    pub roughness: f32,
    /// Reflectance of a facet.
    pub fresnel: Fresnel,
    /// Mean reflectance over the hemisphere, for light that bounces more than once.
    pub multiple: Vec3,
}

/// A rough or smooth boundary that transmits light.
#[derive(Debug, Clone, Copy)]
pub struct Transmitter {
    /// Weight within the closure.
    pub weight: f32,
    /// Distribution of the facets.
    pub ggx: Ggx,
    /// Roughness of the facets, to look up grids.
    pub roughness: f32,
    /// Index of the inside over that of the outside.
    pub ior: f32,
    /// Colour of the reflection; `None` = the boundary only refracts.
    pub reflect: Option<Reflected>,
    /// Filter of refracted light, at each passage through the boundary.
    pub tint: Vec3,
}

/// The lobes of a closure, independent of the viewing direction.
#[derive(Debug, Clone, Copy)]
pub struct Lobes {
    /// Weight within the material.
    pub weight: f32,
    /// Clear coat and the transmittance of its absorption at normal incidence.
    pub coat: Option<(Reflector, Vec3)>,
    /// Metal.
    pub metal: Option<Reflector>,
    /// Glass.
    pub glass: Option<Transmitter>,
    /// Dielectric layer.
    pub layer: Option<Reflector>,
    /// Albedo of the diffuse base, without the reflection of the layer above it.
    pub diffuse: Vec3,
    /// Roughness of the diffuse base; 0 = Lambertian.
    pub diffuse_roughness: f32,
    /// Colour of the diffuse base, for light that bounces more than once on it.
    pub diffuse_color: Vec3,
    /// Albedo of light that is scattered diffusely to the other side, without the reflection of the layer above it.
    pub translucent: Vec3,
    /// Albedo of what scatters light below the surface, without the reflection of the layer above it.
    pub subsurface: Vec3,
}

/// Lobes with less weight are dropped, as in Cycles.
const CUTOFF: f32 = 1e-5;

impl Closure {
    /// Computes the lobes from the inputs. `mean`: returns the mean reflectance of a dielectric of an index.
    pub(super) fn compute(&self, registers: &[Value], mean: fn(f32) -> f32) -> Lobes {
        let inputs = Inputs {
            operands: &self.inputs,
            registers,
            mean,
        };
        // Start without lobes; each kind of node adds its own.
        let base = positive(inputs.get(Input::Color));
        let mut lobes = Lobes {
            weight: inputs.get(Input::Weight).x.max(0.0),
            coat: None,
            metal: None,
            glass: None,
            layer: None,
            diffuse: Vec3::ZERO,
            diffuse_roughness: 0.0,
            diffuse_color: base,
            translucent: Vec3::ZERO,
            subsurface: Vec3::ZERO,
        };
        match self.kind {
            ClosureKind::Transparent | ClosureKind::Emission | ClosureKind::Holdout => {
                lobes.weight = 0.0;
            }
            // The lobe of these depends on the frame: see `Closure::special`.
            ClosureKind::Hair
            | ClosureKind::HairReflection
            | ClosureKind::HairTransmission
            | ClosureKind::Sheen
            | ClosureKind::Velvet
            | ClosureKind::ToonDiffuse
            | ClosureKind::ToonGlossy => {}
            ClosureKind::Conductor => {
                let [n, k] = [Input::Color, Input::Extinction].map(|i| optical(inputs.get(i)));
                let roughness = inputs.share(Input::Roughness);
                lobes.metal = Some(inputs.reflector(1.0, roughness, Fresnel::like_conductor(n, k)));
            }
            ClosureKind::Diffuse => {
                lobes.diffuse = base;
                lobes.diffuse_roughness = inputs.diffuse_roughness();
            }
            ClosureKind::Translucent => lobes.translucent = base,
            ClosureKind::Subsurface => lobes.subsurface = base.map(|c| c.min(1.0)),
            ClosureKind::Glossy => {
                let fresnel = Fresnel::Metal {
                    f0: base,
                    edge: base,
                    dip: Vec3::ZERO,
                };
                let roughness = inputs.share(Input::Roughness);
                lobes.metal = Some(inputs.reflector(1.0, roughness, fresnel));
            }
            ClosureKind::Glass | ClosureKind::Refraction => {
                let roughness = inputs.share(Input::Roughness);
                lobes.glass = Some(Transmitter {
                    weight: 1.0,
                    ggx: Ggx::new(roughness),
                    roughness,
                    ior: clamp_index(inputs.get(Input::Ior).x),
                    reflect: (self.kind == ClosureKind::Glass).then_some(Reflected::Alike(base)),
                    tint: base,
                });
            }
            ClosureKind::Principled => inputs.principled(base, &mut lobes),
        }
        lobes
    }
}

/// The inputs of a closure, read with the registers of the material's program.
struct Inputs<'a> {
    operands: &'a [Operand; INPUTS],
    registers: &'a [Value],
    /// Returns the mean reflectance of a dielectric of an index.
    mean: fn(f32) -> f32,
}

impl Inputs<'_> {
    /// The value of an input.
    #[inline(always)]
    fn get(&self, input: Input) -> Vec3 {
        rgb(read(self.operands[input as usize], self.registers))
    }

    /// The value of an input, clamped to 0..1.
    #[inline(always)]
    fn share(&self, input: Input) -> f32 {
        self.get(input).x.clamp(0.0, 1.0)
    }

    /// A reflecting lobe and its mean reflectance.
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

    /// Adds the lobes of the Principled BSDF with base colour `base`, from the top.
    #[inline(always)]
    fn principled(&self, base: Vec3, lobes: &mut Lobes) {
        lobes.weight *= self.share(Input::Alpha);
        // Read the inputs in Blender's ranges: shares and roughness in 0..1, colours at least 0.
        let tint = positive(self.get(Input::SpecularTint));
        let clamped = base.map(|c| c.min(1.0));
        let roughness = self.share(Input::Roughness);
        lobes.coat = self.coat();
        // Metal: Schlick's curve with the F82 tint at the edge.
        let (metallic, transmission) =
            (self.share(Input::Metallic), self.share(Input::Transmission));
        if metallic > CUTOFF {
            let fresnel = Fresnel::Metal {
                f0: clamped,
                edge: Vec3::ONE,
                dip: edge_dip(clamped, tint),
            };
            lobes.metal = Some(self.reflector(metallic, roughness, fresnel));
        }
        // Glass in what is not metal. Light that crosses it enters and leaves, so each passage takes the square
        // root of the colour.
        let ior = clamp_index(self.get(Input::Ior).x);
        let glass = (1.0 - metallic) * transmission;
        if glass > CUTOFF {
            let own = fresnel::f0_from_ior(ior);
            let f0 = tint.map(|c| c.min(1.0)) * own;
            lobes.glass = Some(Transmitter {
                weight: glass,
                ggx: Ggx::new(roughness),
                roughness,
                ior,
                reflect: Some(Reflected::Dielectric {
                    own,
                    lower_bound: fresnel::min_reflectance(ior),
                    f0,
                }),
                tint: clamped.map(f32::sqrt),
            });
        }
        // Dielectric layer over the diffuse base, in what is neither metal nor glass.
        let rest = (1.0 - metallic) * (1.0 - transmission);
        let eta = layer_index(ior, self.get(Input::Specular).x.clamp(0.0, 1e3));
        if rest > CUTOFF && (eta - 1.0).abs() > 1e-6 {
            let fresnel = Fresnel::dielectric(eta, tint);
            lobes.layer = Some(self.reflector(rest, roughness, fresnel));
        }
        let below = self.share(Input::SubsurfaceWeight);
        let below = if below > CUTOFF { below } else { 0.0 };
        let through = self.share(Input::Translucency);
        lobes.diffuse = base * (rest * (1.0 - below) * (1.0 - through));
        lobes.translucent = base * (rest * (1.0 - below) * through);
        lobes.subsurface = clamped * (rest * below);
        lobes.diffuse_roughness = self.diffuse_roughness();
    }

    /// The roughness of the diffuse base; 0 where it is so small that the base is Lambertian, as in Cycles.
    #[inline(always)]
    fn diffuse_roughness(&self) -> f32 {
        let roughness = self.share(Input::DiffuseRoughness);
        if roughness < CUTOFF { 0.0 } else { roughness }
    }

    /// The clear coat and its absorption, if its weight counts.
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

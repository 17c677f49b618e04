// SPDX-License-Identifier: GPL-3.0-or-later
//! Closures: the shader nodes of a material, each with a weight, as the lobes they consist of.
//!
//! Lobes and weights follow Cycles (Blender 5.2). Principled, from the top: a clear coat; metal
//! with weight `metallic`; of the rest glass with weight `transmission`; of the rest a dielectric
//! layer of the index `ior`, scaled by `specular`, over a Lambertian base that receives what the
//! layer lets through. Rough lobes are scaled to lose no energy ("multiscatter GGX").

use std::sync::Arc;

use super::albedo::{Axis, Grid, Grids, Lobe};
use super::fresnel;
use super::ggx::Ggx;
use super::program::{Operand, Value, read, rgb};
use super::vector::{Vec3, vec3};

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

/// How much a facet reflects.
#[derive(Debug, Clone, Copy)]
pub enum Fresnel {
    /// f0 + (edge - f0) (1 - c)⁵ - dip c (1 - c)⁶.
    Metal {
        /// At normal incidence.
        f0: Vec3,
        /// At grazing incidence.
        edge: Vec3,
        /// What an edge tint takes away between.
        dip: Vec3,
    },
    /// A dielectric boundary of this relative index, with the reflectance `f0` at normal incidence
    /// in place of its own, `own`.
    Dielectric {
        /// Index.
        eta: f32,
        /// Its own normal reflectance.
        own: f32,
        /// The normal reflectance wanted.
        f0: Vec3,
    },
}

impl Fresnel {
    fn dielectric(eta: f32, tint: Vec3) -> Self {
        let own = fresnel::f0_from_ior(eta);
        Self::Dielectric {
            eta,
            own,
            f0: tint * own,
        }
    }

    /// Reflectance at a cosine.
    #[inline(always)]
    pub fn at(&self, c: f32) -> Vec3 {
        match *self {
            Self::Metal { f0, edge, dip } => {
                let m = (1.0 - c).clamp(0.0, 1.0);
                let m5 = m * m * m * m * m;
                f0 + (edge - f0) * m5 - dip * (c * m5 * m)
            }
            Self::Dielectric { eta, own, f0 } => {
                let f = fresnel::dielectric(c, eta).0;
                tinted(f, own, f0)
            }
        }
    }

    /// Cosine-weighted mean over the hemisphere.
    fn mean(&self, of_index: impl Fn(f32) -> f32) -> Vec3 {
        match *self {
            // The integrals of 2 c (1 - c)⁵ and 2 c² (1 - c)⁶ are 1/21 and 1/126.
            Self::Metal { f0, edge, dip } => f0 + (edge - f0) * (1.0 / 21.0) - dip * (1.0 / 126.0),
            Self::Dielectric { eta, own, f0 } => tinted(of_index(eta), own, f0),
        }
    }
}

/// A dielectric's reflectance `f` with its value at normal incidence, `own`, replaced by `f0`, and
/// 1 kept. Linear in `f`, so it holds for means of it as well.
#[inline(always)]
fn tinted(f: f32, own: f32, f0: Vec3) -> Vec3 {
    let rest = (f - own) / (1.0 - own).max(1e-6);
    f0 * (1.0 - rest) + Vec3::splat(rest)
}

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

/// How the light is coloured that a boundary reflects.
#[derive(Debug, Clone, Copy)]
pub enum Reflected {
    /// All of it alike; what passes is not changed by that.
    Alike(Vec3),
    /// As a dielectric's, by the reflectance `f0` at normal incidence in place of its own, `own`; what is not reflected
    /// passes.
    Dielectric {
        /// Its own normal reflectance.
        own: f32,
        /// The normal reflectance wanted.
        f0: Vec3,
    },
}

impl Reflected {
    /// What is reflected where the boundary's own reflectance is this.
    #[inline(always)]
    pub fn at(&self, reflectance: f32) -> Vec3 {
        match *self {
            Self::Alike(color) => color * reflectance,
            // High indices reflect less between than at normal incidence, of which a tint must not make less than nothing.
            Self::Dielectric { own, f0 } => tinted(reflectance, own, f0).map(|x| x.max(0.0)),
        }
    }

    /// What is left to pass.
    #[inline(always)]
    pub fn rest(&self, reflectance: f32) -> Vec3 {
        match self {
            Self::Alike(_) => Vec3::splat(1.0 - reflectance),
            Self::Dielectric { .. } => Vec3::ONE - self.at(reflectance),
        }
    }
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

/// Albedo of a closure's rough lobes.
#[derive(Debug, Clone, Default)]
pub struct LobeGrids {
    /// Facets that reflect everything.
    pub reflection: Option<Arc<Grid>>,
    /// Dielectric layer.
    pub layer: Option<Arc<Grid>>,
    /// Coat: facets, and the dielectric.
    pub coat: Option<[Arc<Grid>; 2]>,
    /// Glass from outside and from inside.
    pub glass: Option<[Arc<Grid>; 2]>,
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

/// Weights below this are dropped, as in Cycles.
const CUTOFF: f32 = 1e-5;

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

    fn make_grids(&mut self, grids: &mut Grids) {
        let rough = |input: Input, this: &Self| {
            this.constant(input)
                .map_or(Axis::roughness(), |v| Axis::fixed(v.x.clamp(0.0, 1.0)))
        };
        let roughness = rough(Input::Roughness, self);
        let ior = self.constant(Input::Ior).map(|v| at_least_some(v.x));
        let boundary = ior.map_or(Axis::index(0.5), Axis::fixed);
        if self.may_reflect() {
            self.grids.reflection = Some(grids.get(Lobe::Reflection, roughness, Axis::fixed(1.0)));
        }
        if self.kind == Kind::Principled && self.can_differ(Input::Specular, 0.0) {
            let index = match (ior, self.constant(Input::Specular)) {
                (Some(ior), Some(specular)) => Axis::fixed(layer_index(ior, specular.x)),
                (Some(ior), None) => Axis::index((2.0 * fresnel::f0_from_ior(ior)).sqrt()),
                (None, _) => Axis::index(0.6),
            };
            self.grids.layer = Some(grids.get(Lobe::Dielectric, roughness, index));
        }
        if self.kind == Kind::Principled && self.can_differ(Input::CoatWeight, 0.0) {
            let roughness = rough(Input::CoatRoughness, self);
            let index = self
                .constant(Input::CoatIor)
                .map_or(Axis::index(0.5), |v| Axis::fixed(at_least_some(v.x)));
            self.grids.coat = Some([
                grids.get(Lobe::Reflection, roughness, index),
                grids.get(Lobe::Dielectric, roughness, index),
            ]);
        }
        if self.may_refract() && self.kind != Kind::Refraction {
            self.grids.glass = Some([
                grids.get(Lobe::Glass, roughness, boundary),
                grids.get(Lobe::GlassInside, roughness, boundary),
            ]);
        }
    }

    /// The lobes, where the material's program has left these registers.
    #[inline(always)]
    pub fn parts(&self, registers: &[Value]) -> Parts {
        match &self.fixed {
            Some(parts) => *parts,
            None => self.compute(registers, fresnel::dielectric_mean_quick),
        }
    }

    /// Light that comes from it or passes it.
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

    fn compute(&self, registers: &[Value], mean: fn(f32) -> f32) -> Parts {
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let share = |input: Input| get(input).x.clamp(0.0, 1.0);
        let base = positive(get(Input::Color));
        let clamped = base.map(|c| c.min(1.0));
        let roughness = share(Input::Roughness);
        let ggx = Ggx::new(roughness);
        let reflector = |weight: f32, roughness: f32, fresnel: Fresnel| Reflector {
            weight: Vec3::splat(weight),
            ggx: Ggx::new(roughness),
            roughness,
            fresnel,
            multiple: fresnel.mean(mean),
        };
        let mut parts = Parts {
            weight: get(Input::Weight).x.max(0.0),
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
                parts.metal = Some(reflector(1.0, roughness, fresnel));
            }
            Kind::Glass | Kind::Refraction => {
                parts.glass = Some(Transmitter {
                    weight: 1.0,
                    ggx,
                    roughness,
                    ior: at_least_some(get(Input::Ior).x),
                    reflect: (self.kind == Kind::Glass).then_some(Reflected::Alike(base)),
                    tint: base,
                });
            }
            Kind::Principled => {
                parts.weight *= share(Input::Alpha);
                let tint = positive(get(Input::SpecularTint));
                let coat = share(Input::CoatWeight);
                if coat > CUTOFF {
                    let eta = at_least_some(get(Input::CoatIor).x);
                    let fresnel = Fresnel::dielectric(eta, Vec3::ONE);
                    let absorb = positive(get(Input::CoatTint)).map(|c| c.min(1.0));
                    parts.coat = Some((
                        reflector(coat, share(Input::CoatRoughness), fresnel),
                        absorb,
                    ));
                }
                let (metallic, transmission) = (share(Input::Metallic), share(Input::Transmission));
                if metallic > CUTOFF {
                    let fresnel = Fresnel::Metal {
                        f0: clamped,
                        edge: Vec3::ONE,
                        dip: edge_dip(clamped, tint),
                    };
                    parts.metal = Some(reflector(metallic, roughness, fresnel));
                }
                let ior = at_least_some(get(Input::Ior).x);
                let glass = (1.0 - metallic) * transmission;
                if glass > CUTOFF {
                    let own = fresnel::f0_from_ior(ior);
                    let f0 = tint.map(|c| c.min(1.0)) * own;
                    parts.glass = Some(Transmitter {
                        weight: glass,
                        ggx,
                        roughness,
                        ior,
                        reflect: Some(Reflected::Dielectric { own, f0 }),
                        tint: clamped.map(f32::sqrt),
                    });
                }
                let rest = (1.0 - metallic) * (1.0 - transmission);
                let eta = layer_index(ior, get(Input::Specular).x.clamp(0.0, 1e3));
                if rest > CUTOFF && (eta - 1.0).abs() > 1e-6 {
                    let fresnel = Fresnel::dielectric(eta, tint);
                    parts.layer = Some(reflector(rest, roughness, fresnel));
                }
                parts.diffuse = base * rest;
            }
        }
        parts
    }
}

fn positive(c: Vec3) -> Vec3 {
    c.map(|x| x.max(0.0))
}

fn at_least_some(ior: f32) -> f32 {
    ior.clamp(1e-3, 1e3)
}

/// Index of the dielectric layer: `specular` scales the reflectance at normal incidence.
fn layer_index(ior: f32, specular: f32) -> f32 {
    if specular == 0.5 {
        return ior;
    }
    let eta = fresnel::ior_from_f0(fresnel::f0_from_ior(ior) * 2.0 * specular);
    if ior < 1.0 { 1.0 / eta } else { eta }
}

/// What Schlick's curve loses so that at the angle of cosine 1/7 (82°) it has `tint` of its value:
/// Kutz, Hašan and Edmondson 2021, "Novel aspects of the Adobe Standard Material", §F82.
fn edge_dip(f0: Vec3, tint: Vec3) -> Vec3 {
    let f = 6.0_f32 / 7.0;
    let f5 = f * f * f * f * f;
    let channel =
        |f0: f32, tint: f32| (f0 + (1.0 - f0) * f5) * 7.0 / (f5 * f) * (1.0 - tint.min(1.0));
    vec3(
        channel(f0.x, tint.x),
        channel(f0.y, tint.y),
        channel(f0.z, tint.z),
    )
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! Parts of closures that only lobes with frames or shapes of their own can render: computed only in scenes where a
//! material needs such lobes.

use crate::material::closure::{Closure, ClosureKind, Input, Subsurface, optical, positive};
use crate::material::film::THINNEST;
use crate::material::hair::fiber::FiberInputs;
use crate::material::hair::strand::Strand;
use crate::material::microfacets::Distribution;
use crate::math::vector::Vec3;
use crate::values::program::{Value, read, rgb};

/// Sheen on top of a Principled BSDF.
#[derive(Debug, Clone, Copy)]
pub struct SheenLayer {
    /// Weight multiplied by the tint.
    pub color: Vec3,
    /// Its roughness, 0..1.
    pub roughness: f32,
}

/// A closure that consists of one lobe that is no mirror, boundary or base.
#[derive(Debug, Clone, Copy)]
pub enum Single {
    /// Sheen of microfibres of this roughness.
    Microfibers(f32),
    /// Velvet of this roughness.
    Velvet(f32),
    /// A cone about the normal: size and soft edge, 0..1 for a quarter turn.
    ToonDiffuse([f32; 2]),
    /// A cone about the mirror direction.
    ToonGlossy([f32; 2]),
}

/// Scattering about a hair.
#[derive(Debug, Clone, Copy)]
pub enum Hair {
    /// A fibre.
    Fiber(FiberInputs),
    /// A lobe of the Hair BSDF, with its colour.
    Strand(Strand, Vec3),
}

/// The inputs of a closure for lobes of their own frame or shape.
#[derive(Debug, Clone, Copy)]
pub struct Special {
    /// Distribution of the facets.
    pub distribution: Distribution,
    /// Factors on the facets' width along the tangent and across.
    pub stretch: [f32; 2],
    /// Rotation of the tangent about the normal, in turns, 0..1.
    pub rotation: f32,
    /// Tangent in scene space; 0 = any.
    pub tangent: Vec3,
    /// Normal in scene space; 0 = the surface's.
    pub normal: Vec3,
    /// Normal of the coat in scene space; 0 = the surface's.
    pub coat_normal: Vec3,
    /// Sheen on top.
    pub sheen: Option<SheenLayer>,
    /// The only lobe of the closure.
    pub single: Option<Single>,
    /// Colour of the only lobe.
    pub color: Vec3,
    /// Indices of refraction and extinction coefficients of a conductor.
    pub conductor: Option<[Vec3; 2]>,
    /// A thin film over what is below the coat: thickness in nm and index of refraction.
    pub film: Option<[f32; 2]>,
    /// The medium below the base.
    pub subsurface: Option<Subsurface>,
    /// The lobe about a hair.
    pub hair: Option<Hair>,
}

/// Sheen of less weight is dropped, as in Cycles.
const CUTOFF: f32 = 1e-5;

impl Closure {
    /// Whether the closure needs lobes with frames or shapes of their own.
    pub fn needs_lobes(&self) -> bool {
        use ClosureKind::{
            Conductor, Glass, Glossy, Hair, HairReflection, HairTransmission, Principled,
            Refraction, Sheen, Subsurface, ToonDiffuse, ToonGlossy, Velvet,
        };
        let stretched = self.can_differ(Input::Anisotropy, 0.0);
        let other =
            self.distribution != Distribution::Ggx || self.can_differ(Input::FilmThickness, 0.0);
        match self.kind {
            Hair | HairReflection | HairTransmission => true,
            Conductor | Sheen | Subsurface | Velvet | ToonDiffuse | ToonGlossy => true,
            Principled => {
                let coated = self.can_differ(Input::CoatWeight, 0.0);
                let sheen = self.can_differ(Input::SheenWeight, 0.0);
                let apart = self.turned || (coated && self.coat_apart);
                stretched || other || sheen || apart || self.may_walk()
            }
            Glossy => stretched || other || self.turned,
            Glass | Refraction => other || self.turned,
            _ => self.turned,
        }
    }

    /// Returns the sheen on top, for these registers of the material's program.
    pub(super) fn sheen(&self, registers: &[Value]) -> Option<SheenLayer> {
        if self.kind != ClosureKind::Principled {
            return None;
        }
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let weight = get(Input::SheenWeight).x.clamp(0.0, 1.0);
        (weight > CUTOFF).then(|| SheenLayer {
            color: positive(get(Input::SheenTint)) * weight,
            roughness: get(Input::SheenRoughness).x.clamp(0.0, 1.0),
        })
    }

    /// Returns the inputs for lobes of their own, for these registers of the material's program.
    pub fn special(&self, registers: &[Value]) -> Special {
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let share = |input: Input| get(input).x.clamp(0.0, 1.0);
        let rotation = get(Input::Rotation).x;
        let thickness = get(Input::FilmThickness).x;
        let (rough, smooth) = (share(Input::Roughness), share(Input::Smooth));
        Special {
            distribution: self.distribution,
            stretch: self.stretch(get(Input::Anisotropy).x),
            // Fractions of huge numbers are 0.
            rotation: rotation - rotation.floor(),
            tangent: get(Input::Tangent),
            normal: get(Input::Normal),
            coat_normal: get(Input::CoatNormal),
            sheen: self.sheen(registers),
            single: match self.kind {
                ClosureKind::Sheen => Some(Single::Microfibers(rough)),
                ClosureKind::Velvet => Some(Single::Velvet(rough)),
                ClosureKind::ToonDiffuse => Some(Single::ToonDiffuse([rough, smooth])),
                ClosureKind::ToonGlossy => Some(Single::ToonGlossy([rough, smooth])),
                _ => None,
            },
            color: positive(get(Input::Color)),
            conductor: (self.kind == ClosureKind::Conductor)
                .then(|| [Input::Color, Input::Extinction].map(|input| optical(get(input)))),
            film: (thickness > THINNEST).then(|| [thickness, get(Input::FilmIor).x]),
            subsurface: self.subsurface(registers),
            hair: self.hair(registers),
        }
    }

    /// Whether the closure scatters about a hair.
    pub fn is_hair(&self) -> bool {
        use ClosureKind::{Hair, HairReflection, HairTransmission};
        matches!(self.kind, Hair | HairReflection | HairTransmission)
    }

    /// Returns the lobe about a hair, for these registers of the material's program.
    fn hair(&self, registers: &[Value]) -> Option<Hair> {
        if !self.is_hair() {
            return None;
        }
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let number = |input: Input| get(input).x;
        let roughness = [Input::Roughness, Input::RadialRoughness].map(number);
        let tilt = number(Input::Offset);
        Some(match self.kind {
            ClosureKind::Hair => Hair::Fiber(FiberInputs {
                absorption: get(Input::Absorption),
                color: get(Input::Color),
                melanin: number(Input::Melanin),
                redness: number(Input::Redness),
                roughness,
                coat: number(Input::CoatWeight),
                ior: number(Input::Ior),
                tilt,
            }),
            // The cone is shifted against the tilt of the scales.
            kind => {
                let transmits = kind == ClosureKind::HairTransmission;
                let strand = Strand::new(transmits, roughness, -tilt);
                Hair::Strand(strand, positive(get(Input::Color)))
            }
        })
    }

    /// Returns the factors on the widths of facets along the tangent and across. Cycles stretches the facets of the
    /// Principled and Metallic BSDF along the tangent, those of the Glossy BSDF across.
    fn stretch(&self, anisotropy: f32) -> [f32; 2] {
        match self.kind {
            ClosureKind::Principled | ClosureKind::Conductor => {
                let aspect = (1.0 - 0.9 * anisotropy.clamp(0.0, 1.0)).sqrt();
                [1.0 / aspect, aspect]
            }
            ClosureKind::Glossy => {
                let a = anisotropy.clamp(-0.99, 0.99);
                if a < 0.0 {
                    [1.0 / (1.0 + a), 1.0 + a]
                } else {
                    [1.0 - a, 1.0 / (1.0 - a)]
                }
            }
            _ => [1.0; 2],
        }
    }
}

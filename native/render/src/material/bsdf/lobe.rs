// SPDX-License-Identifier: GPL-3.0-or-later
//! A lobe with a frame of its own: stretched facets, other distributions than GGX, sheen, toon, and lobes of closures
//! whose normal differs from that of the material.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, TAU};

use crate::material::bsdf::facets::{facet, reflected, refracted};
use crate::material::bsdf::rough::RoughDiffuse;
use crate::material::bsdf::{Interface, Normals, cosine_direction};
use crate::material::bump::bump_shadow;
use crate::material::closure::{Fresnel, MAX_CLOSURES, MAX_PRINCIPLED, Subsurface, conductor};
use crate::material::film::Film;
use crate::material::hair::fiber::Fiber;
use crate::material::hair::strand::Strand;
use crate::material::microfacets::Microfacets;
use crate::material::sheen::{Microfibers, velvet};
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};
use crate::values::visibility::{RayKind, Visibility};

/// Largest number of lobes with a frame of their own: sheen, coat, metal, glass, layer, base and subsurface of a
/// Principled closure, one of every other.
pub const MAX_LOBES: usize = 7 * MAX_PRINCIPLED + (MAX_CLOSURES - MAX_PRINCIPLED);

/// The z axis.
pub(super) const UP: Vec3 = vec3(0.0, 0.0, 1.0);

/// The identity.
pub(super) const STRAIGHT: Frame = Frame {
    x: vec3(1.0, 0.0, 0.0),
    y: vec3(0.0, 1.0, 0.0),
    z: UP,
};

/// Reflectance of the facets of a lobe.
#[derive(Debug, Clone, Copy)]
pub enum Reflectance {
    /// That of other lobes.
    Plain(Fresnel),
    /// A conductor with these indices of refraction and extinction coefficients.
    Conductor([Vec3; 2]),
    /// A conductor below a thin film.
    FilmOnConductor(Film, [Vec3; 2]),
    /// A dielectric boundary of this index below a thin film, and its tint.
    FilmOnDielectric(Film, f32, Vec3),
}

impl Reflectance {
    /// Returns the reflectance at a cosine.
    pub fn at(&self, c: f32) -> Vec3 {
        match self {
            Self::Plain(fresnel) => fresnel.at(c),
            Self::Conductor([n, k]) => conductor(c, *n, *k),
            Self::FilmOnConductor(film, [n, k]) => film.over_conductor(c, *n, *k),
            Self::FilmOnDielectric(film, eta, tint) => film.tinted(c, *eta, *tint),
        }
    }
}

/// Scattering of a lobe, in its own frame.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// Reflecting facets.
    Facets(Microfacets, Reflectance),
    /// Facets that reflect and refract.
    Boundary(Microfacets, Interface),
    /// A Lambertian base.
    Lambert,
    /// A rough base; its weight includes the lobe's.
    Rough(RoughDiffuse),
    /// Diffuse transmission.
    Translucent,
    /// The entrance to a walk below the surface, which no direction evaluates.
    Subsurface(Subsurface),
    /// A fibre of hair, along the x axis.
    Fiber(Fiber),
    /// A lobe of the Hair BSDF, along the x axis.
    Strand(Strand),
    /// Sheen.
    Fibers(Microfibers),
    /// Velvet of this roughness.
    Velvet(f32),
    /// Light within a cone about the normal.
    ToonDiffuse(Cone),
    /// Light within a cone about the mirror direction.
    ToonGlossy(Cone),
}

/// A cone of constant radiance with a soft edge; angles in radians.
#[derive(Debug, Clone, Copy)]
pub struct Cone {
    full: f32,
    soft: f32,
    outer: f32,
}

impl Cone {
    /// A cone of this size and softness, both 0..1 for a quarter turn.
    pub fn new([size, smooth]: [f32; 2]) -> Self {
        let (full, soft) = (size * FRAC_PI_2, smooth * FRAC_PI_2);
        Self {
            full,
            soft,
            outer: (full + soft).clamp(1e-4, FRAC_PI_2),
        }
    }

    /// Returns the density of a uniform direction within the cone.
    fn density(&self) -> f32 {
        1.0 / (TAU * (1.0 - self.outer.cos()).max(1e-9))
    }

    /// Returns BSDF × cosine and the density for a direction at this cosine from the axis.
    fn eval(&self, cos: f32) -> (f32, f32) {
        let angle = cos.clamp(-1.0, 1.0).acos();
        if angle > self.outer {
            return (0.0, 0.0);
        }
        let inside = if angle <= self.full || self.soft <= 0.0 {
            1.0
        } else {
            (1.0 - (angle - self.full) / self.soft).max(0.0)
        };
        let density = self.density();
        (inside * density, density)
    }

    /// Samples a direction about the z axis.
    fn sample(&self, u: [f32; 2]) -> Vec3 {
        let z = 1.0 - u[1] * (1.0 - self.outer.cos());
        let (s, c) = sin_cos_turns(u[0]);
        let r = (1.0 - z * z).max(0.0).sqrt();
        vec3(r * c, r * s, z)
    }
}

/// A lobe with a frame of its own, for one viewing direction.
#[derive(Debug, Clone, Copy)]
pub struct Lobe {
    /// The lobe's frame in the shading frame; its z axis is the lobe's normal.
    pub frame: Frame,
    /// The viewer in the lobe's frame.
    pub wi: Vec3,
    /// Its scattering.
    pub shape: Shape,
    /// Factor on its BSDF.
    pub scale: Vec3,
    /// Probability of sampling it.
    pub p: f32,
}

/// A direction that a lobe sampled, in the shading frame.
pub struct Direction {
    /// Direction in which the path goes on.
    pub wo: Vec3,
    /// Kind of the scattered ray.
    pub kind: RayKind,
    /// Whether the path passes to the other side of the surface.
    pub through: bool,
    /// For mirrors and windows the factor on the throughput, and the relative index of a window.
    pub single: Option<(Vec3, f32)>,
    /// BSDF × |cosine| and density, with the lobe's factor and probability, that the evaluation of all lobes leaves out
    /// at a direction about a hair.
    pub kept: Option<(Vec3, f32)>,
}

impl Direction {
    /// A direction of a finite density.
    #[inline(always)]
    pub fn rough(wo: Vec3, kind: RayKind, through: bool) -> Self {
        Self {
            wo,
            kind,
            through,
            single: None,
            kept: None,
        }
    }
}

impl Lobe {
    /// An empty slot.
    pub const NONE: Self = Self {
        frame: STRAIGHT,
        wi: UP,
        shape: Shape::Lambert,
        scale: Vec3::ZERO,
        p: 0.0,
    };

    /// Whether the lobe is a mirror or window, or the entrance to a walk: it has no density.
    pub fn is_smooth(&self) -> bool {
        match &self.shape {
            Shape::Facets(facets, _) => facets.is_smooth(),
            Shape::Boundary(facets, interface) => facets.is_smooth() || interface.is_window(),
            Shape::Subsurface(_) => true,
            _ => false,
        }
    }

    /// Whether the lobe transmits light to the other side.
    pub fn transmits(&self) -> bool {
        match &self.shape {
            Shape::Boundary(..) | Shape::Translucent | Shape::Fiber(_) => true,
            Shape::Strand(strand) => strand.transmits,
            _ => false,
        }
    }

    /// Whether the lobe reflects off facets.
    pub fn reflects(&self) -> bool {
        matches!(self.shape, Shape::Facets(..))
    }

    /// Returns the kind of a ray that the lobe scatters to this side.
    fn kind(&self, above: bool) -> RayKind {
        match self.shape {
            Shape::Facets(..) | Shape::ToonGlossy(_) | Shape::Fiber(_) => RayKind::Glossy,
            Shape::Strand(strand) if strand.transmits => RayKind::Transmission,
            Shape::Strand(_) => RayKind::Glossy,
            Shape::Boundary(..) if above => RayKind::Glossy,
            Shape::Boundary(..) => RayKind::Transmission,
            _ => RayKind::Diffuse,
        }
    }

    /// Returns BSDF × |cosine| for a direction in the shading frame, and the density of [`Self::sample`] there, each
    /// without the lobe's probability. Only lights visible to the scattered ray count. `lit`: for a light sample.
    pub fn eval(&self, wo: Vec3, normals: &Normals, visible: Visibility, lit: bool) -> (Vec3, f32) {
        const DARK: (Vec3, f32) = (Vec3::ZERO, 0.0);
        let local = self.frame.to_local(wo);
        if self.is_smooth() || !visible.to(self.kind(local.z > 0.0)) {
            return DARK;
        }
        let own = normals.own();
        let shadow = match self.shape {
            // A fibre scatters to all sides; the Hair BSDF divides them by the normal.
            Shape::Fiber(_) => 1.0,
            Shape::Strand(strand) => f32::from(u8::from((own.dot(wo) < 0.0) == strand.transmits)),
            // The diffuse base sees bumps shadow it; facets end where normals disagree about the side.
            Shape::Facets(..) | Shape::Boundary(..) | Shape::Velvet(_) | Shape::ToonGlossy(_) => {
                let above = normals.geometric.dot(wo) >= 0.0;
                if above != (local.z > 0.0) || (lit && (own.dot(wo) >= 0.0) != above) {
                    return DARK;
                }
                1.0
            }
            _ => bump_shadow(own, self.frame.z, wo),
        };
        if shadow <= 0.0 {
            return DARK;
        }
        let (f, pdf) = self.value(local);
        (f * self.scale * shadow, pdf)
    }

    /// Returns BSDF × |cosine| and the density in the lobe's frame.
    pub(super) fn value(&self, wo: Vec3) -> (Vec3, f32) {
        let alike = |value: f32| (Vec3::splat(value), value);
        let cos = wo.z.max(0.0);
        match &self.shape {
            Shape::Facets(facets, reflectance) => {
                reflected(facets, self.wi, wo, |c| (reflectance.at(c), 1.0))
            }
            Shape::Boundary(facets, interface) if wo.z > 0.0 => {
                reflected(facets, self.wi, wo, |c| {
                    let split = interface.split(c);
                    (split.reflected, split.reflect_probability())
                })
            }
            Shape::Boundary(facets, interface) => refracted(facets, interface, self.wi, wo),
            Shape::Lambert => alike(cos * FRAC_1_PI),
            Shape::Rough(rough) if cos > 0.0 => (rough.eval(self.wi.dot(wo), cos), cos * FRAC_1_PI),
            Shape::Rough(_) | Shape::Subsurface(_) => alike(0.0),
            Shape::Fiber(fiber) => fiber.eval(wo),
            Shape::Strand(strand) => alike(strand.density(self.wi, wo)),
            Shape::Translucent => alike((-wo.z).max(0.0) * FRAC_1_PI),
            Shape::Fibers(fibers) => alike(fibers.density(around_viewer(self.wi).to_local(wo))),
            Shape::Velvet(_) if wo.z <= 0.0 => alike(0.0),
            Shape::Velvet(roughness) => (Vec3::splat(velvet(*roughness, self.wi, wo)), 1.0 / TAU),
            Shape::ToonDiffuse(_) | Shape::ToonGlossy(_) if wo.z <= 0.0 => alike(0.0),
            Shape::ToonDiffuse(cone) => {
                let (value, pdf) = cone.eval(wo.z);
                (Vec3::splat(value), pdf)
            }
            Shape::ToonGlossy(cone) => {
                let (value, pdf) = cone.eval(mirrored(self.wi).dot(wo));
                (Vec3::splat(value), pdf)
            }
        }
    }

    /// Samples a direction; none if it is lost. `choice` in [0, 1) selects reflection or refraction.
    #[inline(never)]
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Option<Direction> {
        let about = cosine_direction(u);
        let mut through = false;
        let local = match &self.shape {
            Shape::Facets(facets, reflectance) => {
                if facets.is_smooth() {
                    let factor = reflectance.at(self.wi.z) * self.scale;
                    return self.single(mirrored(self.wi), false, factor, 1.0);
                }
                mirrored_at(self.wi, facet(facets, self.wi, u))
            }
            Shape::Boundary(facets, interface) => {
                return self.sample_boundary(facets, interface, choice, u);
            }
            Shape::Lambert | Shape::Rough(_) => about,
            Shape::Fiber(fiber) => {
                let (local, reflected) = fiber.sample(choice, u);
                return self.around_hair(local, reflected);
            }
            Shape::Strand(strand) => {
                return self.around_hair(strand.sample(self.wi, u), !strand.transmits);
            }
            Shape::Subsurface(_) => return None,
            Shape::Translucent => {
                through = true;
                -about
            }
            Shape::Fibers(fibers) => around_viewer(self.wi).to_world(fibers.transformed(about)),
            Shape::Velvet(_) => {
                let (s, c) = sin_cos_turns(u[0]);
                let r = (1.0 - u[1] * u[1]).max(0.0).sqrt();
                vec3(r * c, r * s, u[1])
            }
            Shape::ToonDiffuse(cone) => cone.sample(u),
            Shape::ToonGlossy(cone) => Frame::around(mirrored(self.wi)).to_world(cone.sample(u)),
        };
        if through != (local.z < 0.0) {
            return None;
        }
        Some(Direction {
            wo: self.frame.to_world(local),
            kind: self.kind(!through),
            through,
            single: None,
            kept: None,
        })
    }

    /// Returns a direction about a hair, which may leave to any side of the surface.
    fn around_hair(&self, local: Vec3, reflected: bool) -> Option<Direction> {
        Some(Direction {
            wo: self.frame.to_world(local),
            kind: if reflected {
                RayKind::Glossy
            } else {
                RayKind::Transmission
            },
            through: !reflected,
            single: None,
            kept: None,
        })
    }

    /// Whether the lobe scatters about a hair.
    pub fn is_hair(&self) -> bool {
        matches!(self.shape, Shape::Fiber(_) | Shape::Strand(_))
    }

    /// Samples a lobe that reflects and refracts.
    fn sample_boundary(
        &self,
        facets: &Microfacets,
        interface: &Interface,
        choice: f32,
        u: [f32; 2],
    ) -> Option<Direction> {
        let smooth = self.is_smooth();
        let h = if smooth {
            UP
        } else {
            facet(facets, self.wi, u)
        };
        let c = self.wi.dot(h);
        let split = interface.split(c);
        let share = split.reflect_probability();
        let through = choice >= share;
        // Reflect or refract about the facet; total reflection of a boundary that only refracts is lost.
        let local = if !through {
            mirrored_at(self.wi, h)
        } else if split.cos_t > 0.0 {
            h * (c / interface.eta - split.cos_t) - self.wi * (1.0 / interface.eta)
        } else {
            return None;
        };
        if smooth {
            return if through {
                let factor = self.scale * split.passed * (1.0 / (1.0 - share));
                self.single(local, true, factor, interface.eta)
            } else {
                let factor = self.scale * split.reflected * (1.0 / share);
                self.single(local, false, factor, 1.0)
            };
        }
        (through == (local.z < 0.0)).then(|| Direction {
            wo: self.frame.to_world(local),
            kind: self.kind(!through),
            through,
            single: None,
            kept: None,
        })
    }

    /// The only direction of a mirror or window. `factor`: on the throughput, without the lobe's probability.
    fn single(&self, local: Vec3, through: bool, factor: Vec3, eta: f32) -> Option<Direction> {
        Some(Direction {
            wo: self.frame.to_world(local),
            kind: self.kind(!through),
            through,
            single: Some((factor * (1.0 / self.p), eta)),
            kept: None,
        })
    }
}

/// The mirror direction of `wi` about the z axis.
fn mirrored(wi: Vec3) -> Vec3 {
    vec3(-wi.x, -wi.y, wi.z)
}

/// The mirror direction of `wi` about a facet's normal.
fn mirrored_at(wi: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * wi.dot(h)) - wi
}

/// The frame about the z axis whose xz plane contains the viewer.
fn around_viewer(wi: Vec3) -> Frame {
    let x = vec3(wi.x, wi.y, 0.0).normalized_or(vec3(1.0, 0.0, 0.0));
    Frame {
        x,
        y: UP.cross(x),
        z: UP,
    }
}

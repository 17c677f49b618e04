// SPDX-License-Identifier: GPL-3.0-or-later
//! The medium below the base of a closure, and how light enters it.

use crate::material::bsdf::cosine_direction;
use crate::material::closure::{Closure, ClosureKind, Input, clamp_index, layer_index, positive};
use crate::material::ggx::Ggx;
use crate::math::vector::{Vec3, vec3};
use crate::medium::inversion::Inversion;
use crate::values::program::{Value, read, rgb};

/// Mean free paths below which a channel is diffuse, as in Cycles.
const MIN_RADIUS: f32 = 1e-8;

/// Least and largest index of refraction at which light enters, as in Cycles.
const INDICES: [f32; 2] = [1.01, 3.8];

/// The medium below a surface.
#[derive(Debug, Clone, Copy)]
pub struct Subsurface {
    /// Radius by channel, in scene units; the method makes it a mean free path.
    pub radius: Vec3,
    /// Share of light that leaves again by channel: the colour of the surface.
    pub color: Vec3,
    /// Mean cosine of scattering.
    pub anisotropy: f32,
    /// Index of refraction of the boundary.
    pub ior: f32,
    /// How the medium follows from radius and colour.
    pub method: Inversion,
    /// Roughness² of the facets through which light enters.
    width: f32,
}

impl Subsurface {
    /// Returns 1 for channels in which light has a way below the surface, 0 for others.
    pub fn open(&self) -> Vec3 {
        // A radius that is not a number is none.
        let open = |r: f32| f32::from(u8::from(r >= MIN_RADIUS && r.is_finite()));
        self.radius.map(open)
    }

    /// Samples the direction in which light from `wi` enters, in the frame of the lobe. `choice`, `u`: random numbers
    /// in [0, 1). Half of the light of the skin method enters diffusely.
    pub fn enter(&self, wi: Vec3, choice: f32, u: [f32; 2]) -> Vec3 {
        if self.method == Inversion::Skin && choice < 0.5 {
            return -cosine_direction(u);
        }
        // Refract at a visible facet. No light is reflected: the lobes above the base stand for that.
        let facets = Ggx::MIRROR.widened(self.width);
        let h = if facets.is_smooth() {
            vec3(0.0, 0.0, 1.0)
        } else {
            facets.sample_visible(wi, u)
        };
        let c = wi.dot(h);
        let inverse = 1.0 / self.ior;
        let cos_t = (1.0 - inverse * inverse * (1.0 - c * c)).max(0.0).sqrt();
        let wo = h * (inverse * c - cos_t) - wi * inverse;
        wo.normalized_or(vec3(0.0, 0.0, -1.0))
    }
}

impl Closure {
    /// Whether light can scatter below the surface.
    pub fn may_walk(&self) -> bool {
        match self.kind {
            ClosureKind::Subsurface => true,
            ClosureKind::Principled => self.can_differ(Input::SubsurfaceWeight, 0.0),
            _ => false,
        }
    }

    /// Returns the medium below the base, for these registers of the material's program.
    pub(super) fn subsurface(&self, registers: &[Value]) -> Option<Subsurface> {
        if !self.may_walk() {
            return None;
        }
        let get = |input: Input| rgb(read(self.inputs[input as usize], registers));
        let roughness = get(Input::Roughness).x.clamp(0.0, 1.0);
        let skin = self.method == Inversion::Skin;
        // Light enters a Principled closure through the facets of its layer, but for the skin method.
        let (own, width) = if self.kind == ClosureKind::Principled {
            let specular = get(Input::Specular).x.clamp(0.0, 1e3);
            let layer = layer_index(clamp_index(get(Input::Ior).x), specular);
            (layer, roughness * roughness)
        } else {
            (get(Input::SubsurfaceIor).x, roughness)
        };
        let ior = if skin {
            get(Input::SubsurfaceIor).x
        } else {
            own
        };
        let most = if self.method == Inversion::RandomWalk {
            0.99
        } else {
            0.9
        };
        let [least, largest] = INDICES;
        Some(Subsurface {
            radius: positive(get(Input::SubsurfaceRadius) * get(Input::SubsurfaceScale).x),
            color: positive(get(Input::Color)).map(|c| c.min(1.0)),
            anisotropy: get(Input::SubsurfaceAnisotropy).x.clamp(-0.99, most),
            ior: ior.clamp(least, largest),
            method: self.method,
            width: if skin { 1.0 } else { width },
        })
    }
}

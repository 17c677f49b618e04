// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow rays of a wavefront, and the light that they bring if nothing is in their way.

use super::calls::{Calls, Stopped};
use super::film::PixelSample;
use super::integrator::Context;
use super::path::{MOST_PASSED, MOST_UNSEEN};
use super::place::RayKind;
use super::program::Value;
use super::surface::Surface;
use super::vector::Vec3;
use crate::traverse::{Hit, Ray};

/// What a shadow ray brings, and to which pixel sample of the tile's batch.
#[derive(Clone, Copy)]
struct Light {
    slot: u32,
    value: Vec3,
    /// Transparent surfaces passed so far.
    transparent: u16,
    /// Surfaces passed so far that are hidden from shadow rays.
    unseen: u16,
}

/// Shadow rays, each with what it brings.
#[derive(Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    light: Vec<Light>,
    blocked: Vec<bool>,
    hits: Vec<Hit>,
    /// What a material's program computes, from point to point.
    registers: Vec<Value>,
}

impl ShadowRays {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.light.clear();
    }

    /// Takes a ray, and what it brings to which pixel sample.
    #[inline(always)]
    pub fn push(&mut self, ray: Ray, slot: u32, value: Vec3) {
        self.rays.push(ray);
        self.light.push(Light {
            slot,
            value,
            transparent: 0,
            unseen: 0,
        });
    }

    /// Adds the light of all that arrive, and forgets them. Returns how many rays were cast.
    ///
    /// # Errors
    /// [`Stopped`] when told to.
    pub fn cast(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut [PixelSample],
    ) -> Result<u64, Stopped> {
        let cast = if context.scene.features().transparency {
            self.cast_through(context, calls, samples)?
        } else {
            self.cast_opaque(context, calls, samples)?
        };
        self.clear();
        Ok(cast)
    }

    fn cast_opaque(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut [PixelSample],
    ) -> Result<u64, Stopped> {
        let Self {
            rays,
            light,
            blocked,
            ..
        } = self;
        let tracer = &*context.scene.tracer;
        blocked.clear();
        blocked.resize(rays.len(), false);
        calls.cover(rays.len(), context.stop, |range| {
            tracer.occluded(&rays[range.clone()], &mut blocked[range], None);
        })?;
        for (light, _) in light.iter().zip(blocked.iter()).filter(|(_, b)| !**b) {
            samples[light.slot as usize].add(light.value);
        }
        Ok(rays.len() as u64)
    }

    /// The same where surfaces may be partly transparent: each one met takes its part.
    fn cast_through(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut [PixelSample],
    ) -> Result<u64, Stopped> {
        let Self {
            rays,
            light,
            hits,
            registers,
            ..
        } = self;
        let scene = context.scene;
        let mut cast = 0;
        while !rays.is_empty() {
            cast += rays.len() as u64;
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            calls.cover(rays.len(), context.stop, |range| {
                scene
                    .tracer
                    .closest(&rays[range.clone()], &mut hits[range], None);
            })?;
            let mut kept = 0;
            for i in 0..rays.len() {
                let (ray, hit, mut carried) = (rays[i], hits[i], light[i]);
                if !hit.is_hit() {
                    samples[carried.slot as usize].add(carried.value);
                    continue;
                }
                // As long as the way to the light: what is seen must not depend on that.
                let d = Vec3::from(ray.d).normalized();
                let surface = Surface::of(scene, &hit, d);
                if surface.material.visible.to(RayKind::Shadow) {
                    let place = || surface.place(scene, d, RayKind::Shadow);
                    let look = surface.material.look(&scene.images, place, registers);
                    carried.value = carried.value * look.transparent;
                    carried.transparent += 1;
                } else {
                    carried.unseen += 1;
                }
                if carried.transparent < MOST_PASSED
                    && carried.unseen < MOST_UNSEEN
                    && carried.value.max_component() > 0.0
                    && ray.t_max > hit.t
                {
                    rays[kept] = surface.beyond(&ray, &hit);
                    light[kept] = carried;
                    kept += 1;
                }
            }
            rays.truncate(kept);
            light.truncate(kept);
        }
        Ok(cast)
    }
}

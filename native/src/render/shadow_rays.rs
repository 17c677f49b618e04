// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow rays of a wavefront, and the light that they bring if nothing is in their way.

use super::calls::{Calls, Stopped};
use super::film::PixelSample;
use super::integrator::Context;
use super::path::MOST_PASSED;
use super::place::RayKind;
use super::program::Value;
use super::surface::Surface;
use super::vector::Vec3;
use crate::traverse::{Hit, Ray};

/// Shadow rays, each with a pixel sample and the light that it brings there.
#[derive(Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    light: Vec<(u32, Vec3)>,
    blocked: Vec<bool>,
    hits: Vec<Hit>,
    /// What a material's program computes, from point to point.
    registers: Vec<Value>,
}

impl ShadowRays {
    /// Takes a ray, and what it brings to which pixel sample.
    #[inline(always)]
    pub fn push(&mut self, ray: Ray, slot: u32, light: Vec3) {
        self.rays.push(ray);
        self.light.push((slot, light));
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
        self.rays.clear();
        self.light.clear();
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
        for ((slot, light), _) in light.iter().zip(blocked.iter()).filter(|(_, b)| !**b) {
            samples[*slot as usize].add(*light);
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
        for _ in 0..MOST_PASSED {
            if rays.is_empty() {
                break;
            }
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
                let (slot, value) = light[i];
                let (ray, hit) = (rays[i], hits[i]);
                if !hit.is_hit() {
                    samples[slot as usize].add(value);
                    continue;
                }
                let d = Vec3::from(ray.d);
                let surface = Surface::at::<true>(scene, &hit, d);
                let place = || surface.place(scene, d.normalized(), RayKind::Shadow);
                let passing = if surface.material.visible.to(RayKind::Shadow) {
                    surface
                        .material
                        .look(&scene.images, place, registers)
                        .transparent
                } else {
                    Vec3::ONE
                };
                let value = value * passing;
                if value.max_component() > 0.0 && ray.t_max > hit.t {
                    rays[kept] = surface.beyond(&ray, &hit);
                    light[kept] = (slot, value);
                    kept += 1;
                }
            }
            rays.truncate(kept);
            light.truncate(kept);
        }
        Ok(cast)
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow rays of a wavefront, each with the light that arrives if nothing occludes it.

use crate::film::{LightParts, PixelSample, Shares};
use crate::math::vector::Vec3;
use crate::path::calls::{Calls, Cancelled};
use crate::path::state::{MAX_INVISIBLE, MAX_TRANSPARENT, Path};
use crate::path::wavefront::Context;
use crate::scene::surface::Surface;
use crate::values::program::Value;
use crate::values::view::History;
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

/// The light of a shadow ray and the pixel sample of the tile's batch it belongs to.
#[derive(Clone, Copy)]
struct Light {
    slot: u32,
    value: Vec3,
    /// The path from which the ray starts, and the transparent surfaces passed since.
    history: History,
    /// Number of surfaces passed that are invisible to shadow rays.
    invisible: u16,
    /// The set of the objects that block the ray.
    blockers: u8,
}

/// The samples that shadow rays add their light to.
pub struct Samples<'a> {
    /// The samples of the tile's batch.
    pub pixels: &'a mut [PixelSample],
    /// Their light by light pass; empty without such passes.
    pub parts: &'a mut [LightParts],
    /// Their light by light group, empty without such passes.
    pub groups: &'a mut [[f32; 3]],
    /// Number of light groups.
    pub group_count: usize,
}

impl Samples<'_> {
    /// Adds light to a sample, and by the shares of the first surface's lobes to its light passes.
    #[inline(always)]
    fn add(&mut self, light: &Light, scattered: Option<&Scattered>) {
        let slot = light.slot as usize;
        self.pixels[slot].add(light.value);
        let Some(of) = scattered else {
            return;
        };
        if let Some(parts) = self.parts.get_mut(slot) {
            parts.add_scattered(light.value, &of.shares, of.indirect);
        }
        let groups = slot * self.group_count..(slot + 1) * self.group_count;
        add_to_group(&mut self.groups[groups], of.group, light.value);
    }
}

/// Adds light to its group, counted from 1.
pub fn add_to_group(groups: &mut [[f32; 3]], group: u8, light: Vec3) {
    let index = usize::from(group).wrapping_sub(1);
    if let Some(sum) = groups.get_mut(index) {
        for (sum, value) in sum.iter_mut().zip(light.array()) {
            *sum += value;
        }
    }
}

/// What the light passes and light groups need of the light of a shadow ray.
#[derive(Clone, Copy)]
pub struct Scattered {
    /// Shares of the lobes of the first surface.
    pub shares: Shares,
    /// Whether another surface scattered the light before.
    pub indirect: bool,
    /// The light group of the emitter, counted from 1; 0 = none.
    pub group: u8,
}

/// Shadow rays with their light.
#[derive(Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    light: Vec<Light>,
    /// For light passes, one per ray; empty without such passes.
    scattered: Vec<Scattered>,
    blocked: Vec<bool>,
    hits: Vec<Hit>,
    /// Registers of a material's program, reused from point to point.
    registers: Vec<Value>,
}

impl ShadowRays {
    /// Removes all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.light.clear();
        self.scattered.clear();
    }

    /// Adds a ray from a vertex of `path`. `value`: the light it brings to the path's pixel sample; `scattered`: for all
    /// rays if light passes or light groups are filled, else for none.
    #[inline(always)]
    pub fn push(&mut self, ray: Ray, path: &Path, value: Vec3, scattered: Option<Scattered>) {
        self.push_blocked_by(ray, path, value, scattered, 0);
    }

    /// Adds a ray that only the objects of a set of blockers stop.
    #[inline(always)]
    pub fn push_blocked_by(
        &mut self,
        ray: Ray,
        path: &Path,
        value: Vec3,
        scattered: Option<Scattered>,
        blockers: u8,
    ) {
        self.rays.push(ray);
        self.light.push(Light {
            slot: path.slot,
            value,
            history: path.shadow_history(),
            invisible: 0,
            blockers,
        });
        if let Some(scattered) = scattered {
            self.scattered.push(scattered);
        }
    }

    /// Traces all rays, adds the light of those that are not occluded, and removes them. Returns the number of rays
    /// traced; a ray counts again for each surface behind which it continues.
    ///
    /// # Errors
    /// [`Cancelled`] if the render is cancelled.
    pub fn cast(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut Samples<'_>,
    ) -> Result<u64, Cancelled> {
        // Any-hit traversal is faster, but cannot see what it passes.
        let cast = if context.scene.features().transparency {
            self.cast_through(context, calls, samples)?
        } else {
            self.cast_opaque(context, calls, samples)?
        };
        self.clear();
        Ok(cast)
    }

    /// Any-hit traversal: every surface is opaque.
    fn cast_opaque(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut Samples<'_>,
    ) -> Result<u64, Cancelled> {
        let Self {
            rays,
            light,
            scattered,
            blocked,
            ..
        } = self;
        let tracer = &*context.scene.tracer;
        // Trace all rays, then add the light of those that arrive.
        blocked.clear();
        blocked.resize(rays.len(), false);
        calls.cover(rays.len(), context.stop, |range| {
            tracer.occluded(&rays[range.clone()], &mut blocked[range], None);
        })?;
        for (i, light) in light.iter().enumerate().filter(|&(i, _)| !blocked[i]) {
            samples.add(light, scattered.get(i));
        }
        Ok(rays.len() as u64)
    }

    /// Nearest-hit traversal, repeated from surface to surface: each one multiplies the light by its transparency.
    fn cast_through(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut Samples<'_>,
    ) -> Result<u64, Cancelled> {
        let Self {
            rays,
            light,
            scattered,
            hits,
            registers,
            ..
        } = self;
        let scene = context.scene;
        let mut cast = 0;
        // Trace all remaining rays; keep those that continue behind their hit.
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
                // Add the remaining light of a ray without a hit.
                let (ray, hit, mut carried) = (rays[i], hits[i], light[i]);
                if !hit.is_hit() {
                    samples.add(&carried, scattered.get(i));
                    continue;
                }
                // Normalize: the direction's length is the distance to the light, which the program must not depend
                // on.
                let d = Vec3::from(ray.d).normalized();
                let surface = Surface::of(scene, &hit, d);
                carried.history.length += hit.t * Vec3::from(ray.d).length();
                // Filter the light by the surface, unless shadow rays do not see it or it is no blocker.
                let material = surface.material;
                if material.visible.to(RayKind::Shadow) && material.sets.shades(carried.blockers) {
                    let point = || {
                        let mut point = surface.shading_point(scene, d, RayKind::Shadow);
                        point.view = Some(context.camera.view());
                        point.history = carried.history;
                        point
                    };
                    let unscattered =
                        surface
                            .material
                            .unscattered_reduced(&scene.images, point, registers);
                    carried.value = carried.value * unscattered.transparent;
                    carried.history.transparent += 1;
                } else {
                    carried.invisible += 1;
                }
                // Continue while some light is left and the interval is not exhausted.
                if carried.history.transparent < MAX_TRANSPARENT
                    && carried.invisible < MAX_INVISIBLE
                    && carried.value.max_abs() > 0.0
                    && ray.t_max > hit.t
                {
                    rays[kept] = surface.continued(&ray, &hit);
                    light[kept] = carried;
                    if !scattered.is_empty() {
                        scattered[kept] = scattered[i];
                    }
                    kept += 1;
                }
            }
            rays.truncate(kept);
            light.truncate(kept);
            scattered.truncate(kept);
        }
        Ok(cast)
    }
}

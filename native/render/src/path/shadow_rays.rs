// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow rays of a wavefront, each with the light that arrives if nothing occludes it.

use crate::film::catcher::{Catch, Caught};
use crate::film::{LightParts, PixelSample, Shares};
use crate::light::{Arrival, Emitter};
use crate::math::sampler::Stream;
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::calls::{Calls, Cancelled};
use crate::path::media::{Scratch, Through};
use crate::path::record::{Purpose, Recorder};
use crate::path::state::{MAX_INVISIBLE, Path};
use crate::path::wavefront::Context;
use crate::scene::media::MediumRay;
use crate::scene::surface::Surface;
use crate::values::program::Value;
use crate::values::view::History;
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

mod passed;

use passed::PassedSurfaces;

/// The light of a shadow ray and the pixel sample of the tile's batch it belongs to.
#[derive(Clone, Copy)]
struct Light {
    slot: u32,
    value: Vec3,
    /// The path from which the ray starts, and the transparent surfaces passed since.
    history: History,
    /// Number of transparent surfaces that path and ray have passed.
    passed: u16,
    /// Number of surfaces passed that are invisible to shadow rays.
    invisible: u16,
    /// Blockers and target of the ray.
    aim: Aim,
    /// The triangle that the ray has left, or [`Hit::NONE`].
    left: u32,
    /// Whether only shadow catchers block the ray.
    catchers_alone: bool,
}

/// Blockers and target of a shadow ray.
#[derive(Clone, Copy)]
pub struct Aim {
    /// The set of the objects that stop it.
    pub blockers: u8,
    /// The emissive triangle that it goes to, or [`Hit::NONE`].
    pub emitter: u32,
}

impl Aim {
    /// A ray that every object stops, to no triangle.
    pub const FREE: Self = Self {
        blockers: 0,
        emitter: Hit::NONE,
    };

    /// That of a ray to a light sample.
    pub fn at(light: &Arrival) -> Self {
        let emitter = match light.emitter {
            Emitter::Triangle(triangle, _) => triangle,
            _ => Hit::NONE,
        };
        Self {
            blockers: light.blockers,
            emitter,
        }
    }
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
    /// Values of their shadow catchers; empty without shadow catchers.
    pub caught: &'a mut [Caught],
}

impl Samples<'_> {
    /// Adds light to a sample, and by the shares of the first surface's lobes to its light passes.
    #[inline(always)]
    fn add(&mut self, light: &Light, scattered: Option<&Scattered>) {
        let slot = light.slot as usize;
        let Some(of) = scattered else {
            self.pixels[slot].add(light.value);
            return;
        };
        if of.catch != Catch::OnlyCatchers {
            self.pixels[slot].add(light.value);
        }
        // Light of catchers is in no light pass or group.
        if of.catch != Catch::None {
            return self.caught[slot].add(of.catch, light.value);
        }
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

/// Shares of the light of a shadow ray for light passes, light groups and shadow catchers.
#[derive(Clone, Copy)]
pub struct Scattered {
    /// Shares of the lobes of the first surface.
    pub shares: Shares,
    /// Whether another surface scattered the light before.
    pub indirect: bool,
    /// The light group of the emitter, counted from 1; 0 = none.
    pub group: u8,
    /// The sum of a shadow catcher that the light belongs to.
    pub catch: Catch,
}

/// The media that a shadow ray is in, and its random numbers for them.
#[derive(Clone, Copy)]
pub struct Passing {
    /// The media.
    pub stack: Stack,
    stream: Stream,
}

impl Passing {
    /// Returns the state of a ray that starts in these media. `seed`: that of the ray's path.
    pub fn new(stack: Stack, seed: u32) -> Self {
        let stream = Stream::new(Stream::new(seed).fork(1));
        Self { stack, stream }
    }
}

/// Shadow rays with their light.
#[derive(Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    /// The rays to lights at a finite distance, then those to suns and the background.
    apart: Vec<Ray>,
    light: Vec<Light>,
    /// For light passes and shadow catchers, one per ray; empty without any.
    scattered: Vec<Scattered>,
    blocked: Vec<bool>,
    hits: Vec<Hit>,
    passed: PassedSurfaces,
    /// The media of each ray; empty if the scene has none.
    media: Vec<Passing>,
    scratch: Scratch,
    /// Registers of a material's program, reused from point to point.
    registers: Vec<Value>,
}

impl ShadowRays {
    /// Removes all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.light.clear();
        self.scattered.clear();
        self.media.clear();
    }

    /// Sets the media of the ray added last; either all rays have some or none.
    #[inline(always)]
    pub fn push_media(&mut self, passing: Passing) {
        self.media.push(passing);
    }

    /// Adds a ray from a vertex of `path`. `value`: the light it brings to the path's pixel sample; `scattered`: for all
    /// rays if light passes or light groups are filled or there are shadow catchers, else for none; `left`: the triangle
    /// that the ray leaves, or [`Hit::NONE`].
    #[inline(always)]
    pub fn push(
        &mut self,
        ray: Ray,
        path: &Path,
        value: Vec3,
        scattered: Option<Scattered>,
        aim: Aim,
        left: u32,
    ) {
        self.rays.push(ray);
        self.light.push(Light {
            slot: path.slot,
            value,
            history: path.shadow_history(),
            passed: path.passed_surfaces(),
            invisible: 0,
            aim,
            left,
            catchers_alone: path.catch == Catch::OnlyCatchers,
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
        let (scene, features) = (context.scene, context.scene.features());
        let in_media = !self.media.is_empty();
        let cast = if !features.transparency && !in_media {
            self.cast_opaque(context, calls, samples)?
        } else if in_media || scene.touches() || features.counts_passed {
            self.cast_through(context, calls, samples)?
        } else {
            self.cast_filtered(context, calls, samples)?
        };
        self.clear();
        Ok(cast)
    }

    /// Any-hit traversal: every surface is opaque. Rays to near and to far lights go apart, because those of one kind
    /// often go the same way.
    fn cast_opaque(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut Samples<'_>,
    ) -> Result<u64, Cancelled> {
        let Self {
            rays,
            apart,
            light,
            scattered,
            blocked,
            ..
        } = self;
        record(context.recorder, rays, light, true);
        let tracer = &*context.scene.tracer;
        let is_far = |ray: &Ray| ray.t_max == f32::INFINITY;
        apart.clear();
        apart.extend(rays.iter().filter(|ray| !is_far(ray)));
        let near = apart.len();
        apart.extend(rays.iter().filter(|ray| is_far(ray)));
        // Trace all rays, then add the light of those that arrive.
        blocked.clear();
        blocked.resize(rays.len(), false);
        for kind in [0..near, near..rays.len()] {
            let (rays, blocked) = (&apart[kind.clone()], &mut blocked[kind]);
            calls.cover(rays.len(), context.stop, |range| {
                tracer.occluded(&rays[range.clone()], &mut blocked[range], None);
            })?;
        }
        // The rays of each kind kept their order.
        let mut next = [0, near];
        for (i, (ray, light)) in rays.iter().zip(&*light).enumerate() {
            let answer = &mut next[usize::from(is_far(ray))];
            // Surfaces on that which the ray leaves are before its interval.
            let at_once = || {
                let hit = context.scene.first(ray, Hit::MISS, light.left);
                hit.is_hit()
            };
            if !blocked[*answer] && !at_once() {
                samples.add(light, scattered.get(i));
            }
            *answer += 1;
        }
        Ok(rays.len() as u64)
    }

    /// One traversal of each ray, which asks at each surface whether light passes, see [`passed`].
    fn cast_filtered(
        &mut self,
        context: &Context<'_>,
        calls: &mut Calls,
        samples: &mut Samples<'_>,
    ) -> Result<u64, Cancelled> {
        let Self {
            rays,
            light,
            scattered,
            passed,
            ..
        } = self;
        record(context.recorder, rays, light, false);
        calls.cover(rays.len(), context.stop, |range| {
            passed.trace(context, &rays[range.clone()], &light[range.clone()]);
            for (i, at) in range.enumerate() {
                if let Some(value) = passed.arriving(i, light[at].value) {
                    let arrived = Light { value, ..light[at] };
                    samples.add(&arrived, scattered.get(at));
                }
            }
        })?;
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
            media,
            scratch,
            registers,
            ..
        } = self;
        let scene = context.scene;
        let mut cast = 0;
        // Trace all remaining rays; keep those that continue behind their hit.
        while !rays.is_empty() {
            record(context.recorder, rays, light, false);
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
                let (ray, mut carried) = (rays[i], light[i]);
                let hit = scene.first(&ray, hits[i], carried.left);
                let mut passing = media.get(i).copied();
                if let Some(passing) = &mut passing {
                    carried.value =
                        carried.value * passing.transmittance(context, &ray, &hit, scratch);
                }
                let arrives = hit.triangle == carried.aim.emitter;
                if arrives || !hit.is_hit() {
                    samples.add(&carried, scattered.get(i));
                    continue;
                }
                let next = carried.pass(context, &ray, &hit, passing.as_mut(), registers);
                if let Some(next) = next {
                    rays[kept] = next;
                    light[kept] = carried;
                    if !scattered.is_empty() {
                        scattered[kept] = scattered[i];
                    }
                    if let Some(passing) = passing {
                        media[kept] = passing;
                    }
                    kept += 1;
                }
            }
            rays.truncate(kept);
            light.truncate(kept);
            scattered.truncate(kept);
            media.truncate(kept);
        }
        Ok(cast)
    }
}

/// Records rays that are about to be traced. `any`: whether any hit answers them.
fn record(recorder: Option<&Recorder>, rays: &[Ray], light: &[Light], any: bool) {
    let Some(recorder) = recorder else {
        return;
    };
    // The history's length grows only behind surfaces that the ray has passed.
    let purposes = light
        .iter()
        .map(|of| Purpose::of_shadow(of.history.bounces.all, of.history.length > 0.0, any));
    recorder.take(purposes.zip(rays));
}

impl Light {
    /// Passes the surface of a hit. Returns the rest of the ray while some light is left.
    fn pass(
        &mut self,
        context: &Context<'_>,
        ray: &Ray,
        hit: &Hit,
        passing: Option<&mut Passing>,
        registers: &mut Vec<Value>,
    ) -> Option<Ray> {
        let scene = context.scene;
        // Normalize: the direction's length is the distance to the light, which the program must not depend on.
        let d = Vec3::from(ray.d).normalized();
        let surface = Surface::of(scene, hit, d, Some(ray));
        self.history.length += hit.t * Vec3::from(ray.d).length();
        let visible = !surface.is_passed(scene, RayKind::Shadow)
            && (surface.material.catcher || !self.catchers_alone);
        let in_media = passing.is_some();
        if let Some(passing) = passing.filter(|_| visible) {
            passing.stack.cross(surface.medium_behind(), surface.inside);
        }
        // Filter the light by the surface, unless shadow rays do not see it or it is no blocker.
        let blocks = visible && surface.material.sets.shades(self.aim.blockers);
        if blocks && surface.material.opaque_shadow {
            return None;
        }
        if blocks && !(in_media && surface.material.boundary) {
            let transparent = self.transparency(context, &surface, d, self.history, registers);
            self.value = self.value * transparent;
            self.history.transparent += 1;
            self.passed += 1;
        } else {
            self.invisible += 1;
        }
        self.left = hit.triangle;
        // Continue while some light is left and the interval is not exhausted.
        let goes_on = u32::from(self.passed) <= context.settings.transparent_bounces
            && self.invisible < MAX_INVISIBLE
            && self.value.max_abs() > 0.0
            && ray.t_max > hit.t;
        goes_on.then(|| surface.continued(ray, hit))
    }

    /// Returns the transparency of a surface seen along the unit direction `d`.
    fn transparency(
        &self,
        context: &Context<'_>,
        surface: &Surface<'_>,
        d: Vec3,
        history: History,
        registers: &mut Vec<Value>,
    ) -> Vec3 {
        let scene = context.scene;
        let point = || {
            let mut point = surface.shading_point(scene, d, RayKind::Shadow);
            point.view = Some(context.camera.view());
            point.history = history;
            point
        };
        let material = surface.material;
        let unscattered = material.unscattered_reduced(&scene.images, point, registers);
        unscattered.transparent
    }
}

impl Passing {
    /// Returns the transmittance of the media up to a hit, or to the end of the ray.
    fn transmittance(
        &mut self,
        context: &Context<'_>,
        ray: &Ray,
        hit: &Hit,
        scratch: &mut Scratch,
    ) -> Vec3 {
        if self.stack.is_empty() {
            return Vec3::ONE;
        }
        // The direction's length is a distance, of which the interval is a fraction.
        let d = Vec3::from(ray.d);
        let length = d.length();
        let end = if hit.is_hit() { hit.t } else { ray.t_max };
        let through = Through {
            scene: context.scene,
            stack: &self.stack,
            ray: MediumRay {
                origin: Vec3::from(ray.o),
                direction: d.normalized(),
                kind: RayKind::Shadow,
                view: Some(context.camera.view()),
                probes: 0,
            },
        };
        let span = [ray.t_min * length, end * length];
        // Each ray has its own numbers, which go on from segment to segment.
        scratch.stream = self.stream;
        let transmittance = through.transmittance(span, scratch);
        self.stream = scratch.stream;
        transmittance
    }
}

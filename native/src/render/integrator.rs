// SPDX-License-Identifier: GPL-3.0-or-later
//! The path tracer, as a wavefront: all camera rays of a tile, then all their shadow rays, then
//! all next bounces, so that a structure always receives many rays at once.
//!
//! Light samples and scattered rays that meet lights are combined by multiple importance sampling
//! (Veach and Guibas 1995), paths end by Russian roulette: unbiased up to `max_bounces`, which cuts the
//! rest off. `clamp_indirect` and adaptive sampling are biased on purpose. The scene's features choose one of the compiled variants of [`super::shade`] once per render.

use std::sync::atomic::AtomicBool;

use super::calls::{Calls, Stopped};
use super::camera::Camera;
use super::features::Features;
use super::film::{Film, PixelSample, TileArea};
use super::filter::Filter;
use super::path::Path;
use super::program::Value;
use super::sampler::PixelSampler;
use super::scene::RenderScene;
use super::settings::{Pass, Settings};
use super::shade::{self, Shade};
use super::shadow_rays::ShadowRays;
use super::work::Work;
use crate::traverse::{Hit, Order as RayOrder, Ray, RayCounters};

/// What a tile is rendered with; the same for all tiles of a render.
pub struct Context<'a> {
    /// Scene.
    pub scene: &'a RenderScene,
    /// Camera.
    pub camera: &'a Camera,
    /// Pixel filter.
    pub filter: &'a Filter,
    /// Settings.
    pub settings: &'a Settings,
    /// What the samples are for.
    pub film: &'a Film,
    /// Raised to stop.
    pub stop: &'a AtomicBool,
}

/// The rays and paths of one worker.
pub struct Wavefront {
    pub(super) rays: Vec<Ray>,
    pub(super) hits: Vec<Hit>,
    counters: Vec<RayCounters>,
    depths: Vec<u32>,
    pub(super) paths: Vec<Path>,
    pub(super) shadows: ShadowRays,
    pub(super) samples: Vec<PixelSample>,
    /// What a material's program computes, from point to point.
    pub(super) registers: Vec<Value>,
    pub(super) light_registers: Vec<Value>,
    calls: Calls,
    shade: Shade,
    /// Sum of what this worker did.
    pub work: Work,
}

impl Wavefront {
    /// For scenes with these features.
    pub fn new(features: Features) -> Self {
        Self {
            rays: Vec::new(),
            hits: Vec::new(),
            counters: Vec::new(),
            depths: Vec::new(),
            paths: Vec::new(),
            shadows: ShadowRays::default(),
            samples: Vec::new(),
            registers: Vec::new(),
            light_registers: Vec::new(),
            calls: Calls::default(),
            shade: shade::choose(features),
            work: Work::default(),
        }
    }

    /// Renders samples `first..first + count` of the active blocks of a tile. Returns them sample by sample, each with
    /// all pixels row by row.
    ///
    /// # Errors
    /// [`Stopped`] when told to; nothing is returned then.
    pub fn render(
        &mut self,
        context: &Context<'_>,
        area: TileArea,
        active: &[bool],
        first: u32,
        count: u32,
    ) -> Result<&[PixelSample], Stopped> {
        self.samples.clear();
        self.samples
            .resize(area.pixels() * count as usize, PixelSample::EMPTY);
        for index in 0..count {
            let base = index as usize * area.pixels();
            self.start(context, area, active, first + index, base);
            let mut primary = true;
            while !self.rays.is_empty() {
                self.trace(context, primary)?;
                primary = false;
                (self.shade)(self, context, first + index);
                self.work.rays_shadow +=
                    self.shadows
                        .cast(context, &mut self.calls, &mut self.samples)?;
            }
        }
        Ok(&self.samples)
    }

    /// Fills the wavefront with the camera rays of one sample.
    fn start(
        &mut self,
        context: &Context<'_>,
        area: TileArea,
        active: &[bool],
        sample: u32,
        base: usize,
    ) {
        let Context {
            camera,
            filter,
            settings,
            ..
        } = context;
        self.rays.clear();
        self.paths.clear();
        // Left over where a render was stopped.
        self.shadows.clear();
        for (dx, dy) in area.in_blocks(active) {
            let (x, y) = (area.x + dx, area.y + dy);
            let sampler = PixelSampler::new(x, y, settings.seed);
            let [u, v] = sampler.pair(sample, 0);
            let ray = camera.ray(
                x as f32 + 0.5 + filter.offset(u),
                y as f32 + 0.5 + filter.offset(v),
                || sampler.pair(sample, 1),
            );
            self.rays.push(ray);
            let slot = base + (dy * area.width + dx) as usize;
            self.paths
                .push(Path::from_camera(ray.o, sampler, slot as u32));
        }
        self.work.rays_primary += self.rays.len() as u64;
    }

    /// The nearest hits of all rays.
    fn trace(&mut self, context: &Context<'_>, primary: bool) -> Result<(), Stopped> {
        let n = self.rays.len();
        let tracer = &*context.scene.tracer;
        self.hits.clear();
        self.hits.resize(n, Hit::MISS);
        if !primary {
            self.work.rays_secondary += n as u64;
        }
        let counts = primary && context.film.counts();
        if counts {
            self.counters.clear();
            self.counters.resize(n, RayCounters::default());
        }
        // Camera rays come in blocks of 8 x 8. What a beam does for all its rays cannot be told
        // apart by pixel, so where pixels are counted each ray goes singly. Through a lens they have no
        // common origin.
        let order = if primary && !counts && context.camera.is_sharp() {
            RayOrder::Tiles
        } else {
            RayOrder::None
        };
        self.calls.cover(n, context.stop, |range| {
            let counters = counts.then(|| &mut self.counters[range.clone()]);
            tracer.closest_ordered(
                &self.rays[range.clone()],
                &mut self.hits[range],
                counters,
                order,
            );
        })?;
        if counts {
            for (path, c) in self.paths.iter().zip(&self.counters) {
                let sample = &mut self.samples[path.slot as usize];
                sample.steps = c.steps_axis + c.steps_oblique;
                sample.tests = c.tests;
                self.work.steps += u64::from(sample.steps);
                self.work.tests += u64::from(sample.tests);
            }
        }
        if primary && context.film.wants(Pass::LeafDepth) {
            self.depths.resize(n, 0);
            self.calls.cover(n, context.stop, |range| {
                tracer.leaf_depths(&self.rays[range.clone()], &mut self.depths[range]);
            })?;
            for (path, depth) in self.paths.iter().zip(&self.depths) {
                self.samples[path.slot as usize].leaf_depth = *depth;
            }
        }
        Ok(())
    }
}

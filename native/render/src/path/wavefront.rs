// SPDX-License-Identifier: GPL-3.0-or-later
//! The path tracer, as a wavefront: the camera rays of several samples of a tile, then all their shadow rays, then all
//! next bounces, so that a structure always receives many rays at once.
//!
//! Light samples and scattered rays that hit lights are combined by multiple importance sampling (Veach and Guibas
//! 1995), and paths end by Russian roulette: unbiased up to `max_bounces`, which truncates them. `clamp_indirect`,
//! `clamp_direct`, `filter_glossy`, caustics that are switched off, and adaptive sampling are biased on purpose. The
//! scene's features select one of the compiled variants of [`crate::path::shade`] once per wavefront.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::camera::Camera;
use crate::camera::filter::Filter;
use crate::film::{Batch, Film, Shares, TileArea};
use crate::math::sampler::PixelSampler;
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::beams::groups::Groups;
use crate::path::beams::polygons::Polygons;
use crate::path::beams::source::Source;
use crate::path::calls::{Calls, Cancelled};
use crate::path::media::{Scratch, enclosure};
use crate::path::points::Points;
use crate::path::record::{Purpose, Recorder};
use crate::path::shade::{self, Buffers, Shade};
use crate::path::shadow_rays::{Samples, ShadowRays};
use crate::path::state::Path;
use crate::path::walk::RandomWalk;
use crate::path::work::Work;
use crate::scene::RenderScene;
use crate::scene::features::Features;
use crate::settings::{Integrator, Pass, Settings};
use crate::values::program::Value;
use halfspace_ray::selection::Filtered;
use halfspace_ray::{Hit, Order as RayOrder, Ray, RayCounters};

/// 2³² divided by the golden ratio.
const GOLDEN: u32 = 0x9e37_79b9;

/// The inputs of rendering a tile, the same for all tiles of a render but for what depends on the sample's time.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Scene at the time of the current sample.
    pub scene: &'a RenderScene,
    /// Its number in `scenes`.
    pub moment: usize,
    /// The scene at equal intervals of time while the shutter is open.
    pub scenes: &'a [Arc<RenderScene>],
    /// Camera.
    pub camera: &'a Camera,
    /// Pixel filter.
    pub filter: &'a Filter,
    /// Settings.
    pub settings: &'a Settings,
    /// The film that the samples are for.
    pub film: &'a Film,
    /// The polygons that mirror and refract beams, if secondary rays go as beams.
    pub polygons: Option<&'a Polygons>,
    /// The same for each scene.
    pub all_polygons: &'a [Polygons],
    /// The points of surfaces that the pixels show, in place of what the camera sees.
    pub points: Option<&'a Points>,
    /// Records rays, if they are to be recorded.
    pub recorder: Option<&'a Recorder>,
    /// Set to cancel the render.
    pub stop: &'a AtomicBool,
}

impl Context<'_> {
    /// Returns the moment of a sample: every run of as many samples as there are scenes takes each scene once, in the
    /// order of van der Corput's sequence, so that few samples are spread over the whole time, too. The seed turns the
    /// order, so that pictures of few samples with different seeds show different moments.
    fn moment(&self, sample: u32) -> usize {
        let count = self.scenes.len() as u32;
        if count < 2 {
            return 0;
        }
        // Reverse the bits of the numbers below the next power of two, and leave out those that are no scene.
        let size = count.next_power_of_two();
        let place = (0..size)
            .map(|i| i.reverse_bits() >> (size.leading_zeros() + 1))
            .filter(|&scene| scene < count)
            .nth((sample % count) as usize)
            .unwrap_or(0);
        // Turn by the golden ratio, which spreads consecutive seeds.
        let turned = u64::from(self.settings.seed.wrapping_mul(GOLDEN)) * u64::from(count);
        (place as usize + (turned >> 32) as usize) % self.scenes.len()
    }

    /// Returns the context of the samples of a moment.
    fn at(&self, moment: usize) -> Self {
        Self {
            scene: &self.scenes[moment],
            moment,
            polygons: self.all_polygons.get(moment),
            ..*self
        }
    }

    /// Returns the samples `first..first + count` of a tile in runs that are traced together, each with its moment: the
    /// following ones of one moment, or with a rolling shutter those of all pixels that show a moment.
    fn runs(&self, area: TileArea, first: u32, count: u32) -> Vec<(usize, Range<u32>)> {
        if self.points.is_none()
            && let Some(rolling) = self.camera.rolling()
        {
            // The top row begins first, and the bottom one ends last.
            let top = self.shown(rolling.time(area.y + area.height - 1, 0.0));
            let bottom = self.shown(rolling.time(area.y, 1.0));
            return (top..=bottom).map(|moment| (moment, 0..count)).collect();
        }
        let moments: Vec<_> = (0..count).map(|i| self.moment(first + i)).collect();
        let mut begun = 0;
        let runs = moments.chunk_by(|a, b| a == b).map(|run| {
            let samples = begun..begun + run.len() as u32;
            begun = samples.end;
            (run[0], samples)
        });
        runs.collect()
    }

    /// Returns the moment that shows a time from 0 to 1 of the shutter's opening.
    fn shown(&self, time: f32) -> usize {
        ((time * self.scenes.len() as f32) as usize).min(self.scenes.len() - 1)
    }

    /// Returns the time from 0 to 1 of the shutter's opening of a sample of a row, for a random number in [0, 1); `None`
    /// if that row of a rolling shutter shows another moment then.
    fn time(&self, sample: u32, row: u32, u: f32) -> Option<f32> {
        let scenes = self.scenes.len() as f32;
        let Some(rolling) = self.camera.rolling() else {
            return Some((self.moment as f32 + u) / scenes);
        };
        let time = rolling.time(row, (self.moment(sample) as f32 + u) / scenes);
        (self.shown(time) == self.moment).then_some(time)
    }
}

/// The rays and paths of one worker thread.
pub struct Wavefront {
    /// The rays to trace next, one per path.
    pub(super) rays: Vec<Ray>,
    /// The nearest hits of the rays.
    pub(super) hits: Vec<Hit>,
    counters: Vec<RayCounters>,
    depths: Vec<u32>,
    /// The paths that continue.
    pub(super) paths: Vec<Path>,
    /// The beam of each ray; empty unless secondary rays go as beams.
    pub(super) sources: Vec<Source>,
    /// The shares of the lobes of each path's first surface; empty without light passes.
    pub(super) shares: Vec<Shares>,
    /// The media that each ray is in; empty if the scene has none.
    pub(super) media: Vec<Stack>,
    /// The walks below surfaces that the rays are part of; empty if the scene has none.
    pub(super) walks: Vec<Option<RandomWalk>>,
    pub(super) scratch: Scratch,
    /// The media around the pinhole in one of the scenes, once known.
    around: Option<(usize, Stack)>,
    groups: Groups,
    pub(super) shadows: ShadowRays,
    /// The samples of the tile.
    pub(super) batch: Batch,
    /// Registers of a material's program, reused from point to point.
    pub(super) registers: Vec<Value>,
    /// Registers of the programs of emitters and transparent surfaces.
    pub(super) light_registers: Vec<Value>,
    calls: Calls,
    pub(super) programs: Buffers,
    /// The compiled variant of shading for the scene's features.
    shade: Shade,
    /// Counts of rays and traversal work so far.
    pub work: Work,
}

impl Wavefront {
    /// A wavefront for scenes with these features. `extra`: whether passes that are rarely filled are.
    pub fn new(features: Features, extra: bool) -> Self {
        Self {
            rays: Vec::new(),
            hits: Vec::new(),
            counters: Vec::new(),
            depths: Vec::new(),
            paths: Vec::new(),
            sources: Vec::new(),
            shares: Vec::new(),
            media: Vec::new(),
            walks: Vec::new(),
            scratch: Scratch::default(),
            around: None,
            groups: Groups::default(),
            shadows: ShadowRays::default(),
            batch: Batch::default(),
            registers: Vec::new(),
            light_registers: Vec::new(),
            calls: Calls::default(),
            programs: Buffers::default(),
            shade: shade::choose(features, extra),
            work: Work::default(),
        }
    }

    /// Renders samples `first..first + count` of the active blocks of a tile.
    ///
    /// # Errors
    /// [`Cancelled`] if the render is cancelled; the samples are then incomplete and not returned.
    pub fn render(
        &mut self,
        context: &Context<'_>,
        area: TileArea,
        active: &[bool],
        first: u32,
        count: u32,
    ) -> Result<&Batch, Cancelled> {
        self.batch
            .reset(context.film, area.pixels() * count as usize);
        for (moment, samples) in context.runs(area, first, count) {
            let context = &context.at(moment);
            self.shade = shade::choose(context.scene.features(), context.film.wants_extra());
            self.start(context, area, active, first, samples);
            self.enclose(context)?;
            // Trace, shade and test shadows until all paths have ended.
            let mut primary = true;
            while !self.rays.is_empty() {
                self.trace(context, primary)?;
                primary = false;
                (self.shade)(self, context)?;
                let mut samples = Samples {
                    pixels: &mut self.batch.samples,
                    parts: &mut self.batch.parts,
                    groups: &mut self.batch.groups,
                    group_count: context.film.groups(),
                    caught: &mut self.batch.caught,
                };
                self.work.rays_shadow +=
                    self.shadows.cast(context, &mut self.calls, &mut samples)?;
            }
        }
        Ok(&self.batch)
    }

    /// Fills the wavefront with the camera rays of these samples of all active pixels, counted from sample `first`.
    fn start(
        &mut self,
        context: &Context<'_>,
        area: TileArea,
        active: &[bool],
        first: u32,
        samples: Range<u32>,
    ) {
        let Context {
            camera,
            filter,
            settings,
            ..
        } = context;
        self.rays.clear();
        self.hits.clear();
        self.paths.clear();
        // A cancelled render leaves shadow rays behind.
        self.shadows.clear();
        for index in samples {
            // Each sample index has its own range of slots.
            let (sample, base) = (first + index, index as usize * area.pixels());
            for (dx, dy) in area.in_blocks(active) {
                // Jitter each ray by the pixel filter, and by the lens if there is one.
                let (x, y) = (area.x + dx, area.y + dy);
                let sampler = PixelSampler::new(x, y, settings.seed);
                let random @ [u, v] = sampler.pair(sample, 0);
                // The slot is the pixel's sample in the tile's batch.
                let slot = base + (dy * area.width + dx) as usize;
                if let Some(points) = context.points {
                    let pixel = (y * settings.width + x) as usize;
                    // The first sample is at the centre, whose data are those of the passes of one sample. As in Cycles.
                    let random = if sample == 0 { [0.5; 2] } else { random };
                    if let Some((ray, hit)) = points.ray(pixel, random, context.scene, camera) {
                        let path = Path::from_camera(&ray, sampler, sample, slot as u32);
                        self.paths.push(path);
                        self.rays.push(ray);
                        self.hits.push(hit);
                    }
                    continue;
                }
                // Only a rolling shutter needs the time before the ray.
                let drawn = || context.time(sample, y, sampler.pair(sample, 2)[0]);
                let known = camera.rolling().map(|_| drawn());
                if known == Some(None) {
                    continue;
                }
                let ray = camera.ray_at(
                    x as f32 + 0.5 + filter.offset(u),
                    y as f32 + 0.5 + filter.offset(v),
                    || sampler.pair(sample, 1),
                    || known.unwrap_or_else(drawn).unwrap_or(0.0),
                );
                if !camera.sees(&ray) {
                    // Outside the circle of a panorama the picture is black and opaque, as in Cycles.
                    self.batch.samples[slot].alpha = 1.0;
                    continue;
                }
                let path = Path::from_camera(&ray, sampler, sample, slot as u32);
                self.rays.push(ray);
                self.paths.push(path);
            }
        }
        self.work.rays_primary += self.rays.len() as u64;
        self.shares.clear();
        if !self.batch.parts.is_empty() {
            self.shares.resize(self.rays.len(), Shares::DIFFUSE);
        }
        self.walks.clear();
        if context.scene.features().subsurface {
            self.walks.resize(self.rays.len(), None);
        }
        // Camera rays share their pinhole or their direction.
        self.sources.clear();
        if context.polygons.is_some() {
            self.sources.resize(self.rays.len(), camera.source());
        }
    }

    /// Finds the media that the camera rays start in.
    fn enclose(&mut self, context: &Context<'_>) -> Result<(), Cancelled> {
        self.media.clear();
        // Only path tracing renders media.
        if !context.scene.features().media || context.settings.integrator != Integrator::Path {
            return Ok(());
        }
        let (scene, stop) = (context.scene, context.stop);
        // Camera rays begin on the near clipping plane, as in Cycles.
        let begin = |ray: &Ray| (Vec3::from(ray.o) + Vec3::from(ray.d) * ray.t_min).array();
        let shared = context.points.is_none().then(|| context.camera.source());
        let Some(Source::Point(pinhole)) = shared else {
            let points: Vec<_> = self.rays.iter().map(begin).collect();
            self.media = enclosure::media_at(scene, &points, &mut self.calls, stop)?;
            return Ok(());
        };
        // The rays of a pinhole share their media, but for those that cross a surface before that plane.
        let around = match self.around {
            Some((moment, around)) if moment == context.moment => around,
            _ => enclosure::media_at(scene, &[pinhole.array()], &mut self.calls, stop)?[0],
        };
        self.around = Some((context.moment, around));
        self.media.resize(self.rays.len(), around);
        let before: Vec<_> = self
            .rays
            .iter()
            .map(|ray| Ray {
                t_min: 0.0,
                t_max: ray.t_min,
                ..*ray
            })
            .collect();
        let mut crosses = vec![false; before.len()];
        self.calls.cover(before.len(), stop, |range| {
            let (rays, crosses) = (&before[range.clone()], &mut crosses[range]);
            scene.tracer.occluded(rays, crosses, None);
        })?;
        let rays = (0..before.len()).filter(|&i| crosses[i]);
        let points: Vec<_> = rays.clone().map(|i| begin(&self.rays[i])).collect();
        let found = enclosure::media_at(scene, &points, &mut self.calls, stop)?;
        rays.zip(found).for_each(|(i, stack)| self.media[i] = stack);
        Ok(())
    }

    /// Drops all but the first paths.
    pub(super) fn truncate(&mut self, kept: usize) {
        self.rays.truncate(kept);
        self.paths.truncate(kept);
        self.sources.truncate(kept);
        self.shares.truncate(kept);
        self.media.truncate(kept);
        self.walks.truncate(kept);
    }

    /// Finds the nearest hits of all rays. `primary`: whether they are camera rays.
    fn trace(&mut self, context: &Context<'_>, primary: bool) -> Result<(), Cancelled> {
        let n = self.rays.len();
        let tracer = &*context.scene.tracer;
        // Points of surfaces are known.
        if primary && context.points.is_some() {
            return Ok(());
        }
        if let Some(recorder) = context.recorder {
            self.record(recorder);
        }
        // Reset the outputs; only camera rays are ever counted.
        self.hits.clear();
        self.hits.resize(n, Hit::MISS);
        if !primary {
            self.work.rays_secondary += n as u64;
            if context.polygons.is_some() {
                self.trace_beams(context)?;
                self.settle(context);
                return Ok(());
            }
            if self.walks.iter().any(Option::is_some) {
                self.trace_walks(context)?;
                self.settle(context);
                return Ok(());
            }
        }
        let counts = primary && context.film.counts();
        if counts {
            self.counters.clear();
            self.counters.resize(n, RayCounters::default());
        }
        // Camera rays come in blocks of 8 × 8, ordered for traversal in tiles. Counted rays are traced one by one,
        // because the work of a tile cannot be attributed to single pixels; rays through a lens have no common
        // origin; a rolling shutter leaves gaps in the blocks.
        let whole = context.camera.is_sharp() && context.camera.rolling().is_none();
        let order = if primary && !counts && whole {
            RayOrder::Tiles
        } else {
            RayOrder::None
        };
        self.calls.cover(n, context.stop, |range| {
            if counts {
                for i in range {
                    let own = Some(&mut self.counters[i..=i]);
                    tracer.closest(&self.rays[i..=i], &mut self.hits[i..=i], own);
                }
            } else {
                let (rays, hits) = (&self.rays[range.clone()], &mut self.hits[range]);
                tracer.closest_ordered(rays, hits, None, order);
            }
        })?;
        self.settle(context);
        // Attribute the counters to the pixels.
        if counts {
            for (path, c) in self.paths.iter().zip(&self.counters) {
                let sample = &mut self.batch.samples[path.slot as usize];
                sample.steps = c.steps();
                sample.tests = c.tests;
                self.work.steps += u64::from(sample.steps);
                self.work.tests += u64::from(sample.tests);
            }
        }
        // Find the depth of the last leaf that each ray tests.
        if primary && context.film.fills(Pass::LeafDepth) {
            self.depths.resize(n, 0);
            self.calls.cover(n, context.stop, |range| {
                tracer.leaf_depths(&self.rays[range.clone()], &mut self.depths[range]);
            })?;
            for (path, depth) in self.paths.iter().zip(&self.depths) {
                self.batch.samples[path.slot as usize].leaf_depth = *depth;
            }
        }
        Ok(())
    }

    /// Records all rays.
    fn record(&self, recorder: &Recorder) {
        let purposes = self.paths.iter().enumerate().map(|(i, path)| {
            let walks = self.walks.get(i).is_some_and(Option::is_some);
            // The ray starts away from the last vertex only behind surfaces that the path has passed.
            Purpose::of_path(path.kind, path.bounce, path.passed > 0.0, walks)
        });
        recorder.take(purposes.zip(&self.rays));
    }

    /// Orders surfaces that lie on each other.
    fn settle(&mut self, context: &Context<'_>) {
        let scene = context.scene;
        if scene.touches() {
            for ((ray, hit), path) in self.rays.iter().zip(&mut self.hits).zip(&self.paths) {
                *hit = scene.first(ray, *hit, path.left);
            }
        }
    }

    /// Finds the nearest hits of rays of which some are parts of walks: those meet their object alone.
    fn trace_walks(&mut self, context: &Context<'_>) -> Result<(), Cancelled> {
        let (scene, stop) = (context.scene, context.stop);
        let Self {
            rays, walks, hits, ..
        } = self;
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..rays.len()).partition(|&i| walks[i].is_some());
        for (indices, walk) in [(inside, true), (outside, false)] {
            let rays: Vec<_> = indices.iter().map(|&i| rays[i]).collect();
            let mut found = vec![Hit::MISS; rays.len()];
            self.calls.cover(rays.len(), stop, |range| {
                let first = range.start;
                let (rays, found) = (&rays[range.clone()], &mut found[range]);
                if !walk {
                    return scene.tracer.closest(rays, found, None);
                }
                scene.tracer.sift(rays, found, &|i, hit| {
                    let object = scene.attributes.at(hit.triangle).object();
                    match &walks[indices[first + i]] {
                        Some(walk) if walk.object != object => Filtered::Passed,
                        _ => Filtered::Kept,
                    }
                });
            })?;
            for (&i, found) in indices.iter().zip(found) {
                hits[i] = found;
            }
        }
        Ok(())
    }

    /// Finds the nearest hits of secondary rays, beam by beam, those in no beam together. Reorders rays and paths.
    fn trace_beams(&mut self, context: &Context<'_>) -> Result<(), Cancelled> {
        let tracer = &*context.scene.tracer;
        let groups = self.groups.sort(
            &mut self.rays,
            &mut self.paths,
            &mut self.shares,
            &mut self.sources,
        );
        for group in groups {
            let (rays, hits) = (
                &self.rays[group.rays.clone()],
                &mut self.hits[group.rays.clone()],
            );
            self.calls.cover(rays.len(), context.stop, |range| {
                tracer.closest_ordered(&rays[range.clone()], &mut hits[range], None, group.order);
            })?;
            // Count only what the structure does trace in groups.
            if group.order == RayOrder::Tiles && tracer.takes_tiles() {
                self.work.beams += 1;
                self.work.rays_beams += rays.len() as u64;
            }
        }
        Ok(())
    }
}

// SPDX-License-Identifier: GPL-3.0-or-later
//! The path tracer, as a wavefront: all camera rays of a tile, then all their shadow rays, then
//! all next bounces, so that a structure always receives many rays at once.
//!
//! Unbiased: light samples and scattered rays that meet lights are combined by multiple importance
//! sampling (Veach and Guibas 1995), paths end by Russian roulette or after `max_bounces`. The
//! scene's features choose one of the compiled variants of [`shade`] once per render.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::bsdf::{Bsdf, cosine_direction};
use super::camera::Camera;
use super::features::Features;
use super::film::{Film, PixelSample, TileArea};
use super::filter::Filter;
use super::lights::{Arrival, Emitter, Receiver, power_heuristic};
use super::place::RayKind;
use super::program::Value;
use super::sampler::PixelSampler;
use super::scene::RenderScene;
use super::settings::{Integrator, Pass, Settings};
use super::surface::Surface;
use super::vector::Vec3;
use crate::traverse::{Hit, Order as RayOrder, Ray, RayCounters};

/// What happened during a render. Also the proof of what was left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Work {
    /// Camera rays.
    pub rays_primary: u64,
    /// Shadow rays, continued ones included.
    pub rays_shadow: u64,
    /// Rays after a bounce or through a transparent surface.
    pub rays_secondary: u64,
    /// Inner nodes visited by camera rays, when counted.
    pub steps: u64,
    /// Triangles tested by camera rays, when counted.
    pub tests: u64,
    /// Surface points with a glass lobe.
    pub shaded_glass: u64,
    /// Surface points whose material's program ran.
    pub shaded_textures: u64,
    /// Surface points with a lobe that reflects off facets.
    pub shaded_glossy: u64,
    /// Interpolated normals.
    pub normals_fetched: u64,
    /// Rays put to the lights, to see which they meet.
    pub lights_asked: u64,
}

impl Work {
    /// Adds another worker's.
    pub fn add(&mut self, other: &Self) {
        self.rays_primary += other.rays_primary;
        self.rays_shadow += other.rays_shadow;
        self.rays_secondary += other.rays_secondary;
        self.steps += other.steps;
        self.tests += other.tests;
        self.shaded_glass += other.shaded_glass;
        self.shaded_textures += other.shaded_textures;
        self.shaded_glossy += other.shaded_glossy;
        self.normals_fetched += other.normals_fetched;
        self.lights_asked += other.lights_asked;
    }

    /// All rays.
    pub fn rays(&self) -> u64 {
        self.rays_primary + self.rays_shadow + self.rays_secondary
    }
}

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

/// The render was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

#[derive(Clone, Copy)]
struct Path {
    throughput: Vec3,
    /// Density of the last direction; infinite after a mirror.
    pdf: f32,
    /// Where the path scattered last.
    receiver: Receiver,
    /// Distance from there to the ray's origin: surfaces passed through.
    passed: f32,
    sampler: PixelSampler,
    /// Which pixel sample of the tile's batch.
    slot: u32,
    bounce: u16,
    /// Surfaces met, scattered or passed: each has its own random numbers.
    vertex: u16,
    /// Transparent surfaces passed so far.
    transparent: u16,
    /// Surfaces passed so far that are not there for its rays.
    unseen: u16,
    /// Nothing has scattered yet.
    camera: bool,
    /// How it scattered last.
    kind: RayKind,
}

/// Random pairs of a pixel: 0 the filter, 1 the lens, 2 the time, 3 free; then four per vertex.
const FIRST_VERTEX: u32 = 4;
const PAIRS_PER_VERTEX: u32 = 4;

/// A path passes through at most this many transparent surfaces, a shadow ray likewise.
const MOST_PASSED: u16 = 64;

/// And through so many that are hidden from it.
const MOST_UNSEEN: u16 = 1000;

/// Tracing is cut into calls of about this long, so that a stop is heeded in time.
const CALL: Duration = Duration::from_millis(8);

type Shade = fn(&mut Wavefront, &Context<'_>, u32);

/// The rays and paths of one worker.
pub struct Wavefront {
    rays: Vec<Ray>,
    hits: Vec<Hit>,
    counters: Vec<RayCounters>,
    depths: Vec<u32>,
    paths: Vec<Path>,
    shadows: Shadows,
    samples: Vec<PixelSample>,
    /// What a material's program computes, from point to point.
    registers: Vec<Value>,
    light_registers: Vec<Value>,
    /// Rays per call of the structure.
    call: usize,
    shade: Shade,
    /// Sum of what this worker did.
    pub work: Work,
}

#[derive(Default)]
struct Shadows {
    rays: Vec<Ray>,
    light: Vec<(u32, Vec3)>,
    blocked: Vec<bool>,
    hits: Vec<Hit>,
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
            shadows: Shadows::default(),
            samples: Vec::new(),
            registers: Vec::new(),
            light_registers: Vec::new(),
            call: 64,
            shade: choose(features),
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
                self.cast_shadows(context)?;
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
            self.paths.push(Path {
                throughput: Vec3::ONE,
                pdf: f32::INFINITY,
                receiver: Receiver {
                    point: Vec3::from(ray.o),
                    normal: Vec3::ZERO,
                },
                passed: 0.0,
                sampler,
                slot: (base + (dy * area.width + dx) as usize) as u32,
                bounce: 0,
                vertex: 0,
                transparent: 0,
                unseen: 0,
                camera: true,
                kind: RayKind::Camera,
            });
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
        in_calls(n, &mut self.call, context.stop, |range| {
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
            in_calls(n, &mut self.call, context.stop, |range| {
                tracer.leaf_depths(&self.rays[range.clone()], &mut self.depths[range]);
            })?;
            for (path, depth) in self.paths.iter().zip(&self.depths) {
                self.samples[path.slot as usize].leaf_depth = *depth;
            }
        }
        Ok(())
    }

    /// Adds the light of all shadow rays that arrive.
    fn cast_shadows(&mut self, context: &Context<'_>) -> Result<(), Stopped> {
        if context.scene.features().transparency {
            return self.cast_transparent_shadows(context);
        }
        let Shadows {
            rays,
            light,
            blocked,
            ..
        } = &mut self.shadows;
        let tracer = &*context.scene.tracer;
        blocked.clear();
        blocked.resize(rays.len(), false);
        self.work.rays_shadow += rays.len() as u64;
        in_calls(rays.len(), &mut self.call, context.stop, |range| {
            tracer.occluded(&rays[range.clone()], &mut blocked[range], None);
        })?;
        for ((slot, light), _) in light.iter().zip(blocked.iter()).filter(|(_, b)| !**b) {
            add_color(&mut self.samples[*slot as usize], *light);
        }
        rays.clear();
        light.clear();
        Ok(())
    }

    /// The same where surfaces may be partly transparent: each one met takes its part.
    fn cast_transparent_shadows(&mut self, context: &Context<'_>) -> Result<(), Stopped> {
        let Shadows {
            rays, light, hits, ..
        } = &mut self.shadows;
        let scene = context.scene;
        for _ in 0..MOST_PASSED {
            if rays.is_empty() {
                break;
            }
            self.work.rays_shadow += rays.len() as u64;
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            in_calls(rays.len(), &mut self.call, context.stop, |range| {
                scene
                    .tracer
                    .closest(&rays[range.clone()], &mut hits[range], None);
            })?;
            let mut kept = 0;
            for i in 0..rays.len() {
                let (slot, value) = light[i];
                let (ray, hit) = (rays[i], hits[i]);
                if !hit.is_hit() {
                    add_color(&mut self.samples[slot as usize], value);
                    continue;
                }
                let d = Vec3::from(ray.d);
                let surface = Surface::at::<true>(scene, &hit, d);
                let place = || surface.place(scene, d.normalized(), RayKind::Shadow);
                let passing = if surface.material.visible.to(RayKind::Shadow) {
                    surface
                        .material
                        .look(&scene.images, place, &mut self.registers)
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
        rays.clear();
        light.clear();
        Ok(())
    }
}

/// Calls `f` on ranges that together cover `0..n`, each sized to take about [`CALL`], and heeds
/// `stop` between them. Rays do not see each other, so the cuts change no answer.
fn in_calls(
    n: usize,
    call: &mut usize,
    stop: &AtomicBool,
    mut f: impl FnMut(std::ops::Range<usize>),
) -> Result<(), Stopped> {
    let mut start = 0;
    while start < n {
        if stop.load(Ordering::Relaxed) {
            return Err(Stopped);
        }
        let end = (start + *call).min(n);
        let begun = Instant::now();
        f(start..end);
        let took = begun.elapsed();
        if took > CALL * 2 {
            *call = (*call / 2).max(1);
        } else if took < CALL && end - start == *call {
            *call = (*call * 2).min(1 << 16);
        }
        start = end;
    }
    Ok(())
}

#[inline(always)]
fn add_color(sample: &mut PixelSample, light: Vec3) {
    for (c, l) in sample.color.iter_mut().zip(light.array()) {
        *c += l;
    }
}

/// The variant of [`shade`] with exactly these features.
fn choose(features: Features) -> Shade {
    macro_rules! variant {
        ($($flag:expr),*; $($chosen:tt)*) => { variant!(@ [$($flag),*] [$($chosen)*]) };
        (@ [] [$($chosen:tt)*]) => { shade::<$($chosen)*> };
        (@ [$flag:expr $(, $rest:expr)*] [$($chosen:tt)*]) => {
            if $flag {
                variant!(@ [$($rest),*] [$($chosen)* true,])
            } else {
                variant!(@ [$($rest),*] [$($chosen)* false,])
            }
        };
    }
    variant!(features.lights, features.glossy, features.glass, features.smooth_normals;)
}

/// Shades all hits: adds what they emit, collects shadow rays, and replaces the rays by those of
/// the next bounce, in the same order.
fn shade<const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>(
    wave: &mut Wavefront,
    context: &Context<'_>,
    sample: u32,
) {
    let Context {
        scene, settings, ..
    } = *context;
    let features = scene.features();
    // Whether the ray after the last bounce can still find light.
    let lamps_seen = scene.lights.any_seen();
    let last_ray_counts = features.lights_met || features.emission || !scene.world.is_black();
    let whitted = settings.integrator == Integrator::Whitted;
    let ambient = settings.integrator == Integrator::Ambient;
    let mut registers = std::mem::take(&mut wave.registers);
    let mut light_registers = std::mem::take(&mut wave.light_registers);
    let mut kept = 0;
    for i in 0..wave.rays.len() {
        let (ray, hit, mut path) = (wave.rays[i], wave.hits[i], wave.paths[i]);
        let d = Vec3::from(ray.d);
        let out = &mut wave.samples[path.slot as usize];
        let unseen = path.camera && (!lamps_seen || (settings.film_transparent && !hit.is_hit()));
        if LIGHTS && features.lights_met && !unseen {
            wave.work.lights_asked += 1;
            let span = [path.passed, path.passed + hit.t];
            let light = scene
                .lights
                .met(path.receiver, d, span, path.pdf, path.kind);
            add_color(
                out,
                settings.clamped(path.throughput * light, path.bounce > 1),
            );
        }
        if !hit.is_hit() {
            if !scene.world.visible.to(path.kind) {
                out.alpha = 1.0;
            } else if !(path.camera && settings.film_transparent) {
                let mut light = scene.world.radiance(
                    &scene.images,
                    &scene.varying,
                    d,
                    path.kind,
                    &mut registers,
                );
                if features.world && path.pdf.is_finite() {
                    let density = scene.lights.world_pdf(path.receiver, d);
                    light *= power_heuristic(path.pdf, density);
                }
                add_color(
                    out,
                    settings.clamped(path.throughput * light, path.bounce > 1),
                );
                out.alpha = 1.0;
            }
            continue;
        }
        let mut surface = Surface::at::<SMOOTH>(scene, &hit, d);
        let material = surface.material;
        if features.hidden && !material.visible.to(path.kind) {
            path.unseen += 1;
            if path.unseen < MOST_UNSEEN {
                wave.rays[kept] = surface.beyond(&ray, &hit);
                path.passed += hit.t;
                wave.paths[kept] = path;
                kept += 1;
            }
            continue;
        }
        if !material.program.is_empty() {
            let place = surface.place(scene, d, path.kind);
            material.program.run(&scene.images, &place, &mut registers);
            wave.work.shaded_textures += 1;
            if let Some(normal) = material.normal(&registers) {
                surface.bend(normal, d);
            }
        }
        let look = material.look_here(&registers);
        if features.emission && !ambient && look.emission != Vec3::ZERO {
            let mut emission = path.throughput * look.emission;
            if path.pdf.is_finite() {
                let cos = surface.geometric.dot(d).abs();
                let distance = path.passed + hit.t;
                let density = scene
                    .lights
                    .triangle_pdf(path.receiver, hit.triangle, distance, cos);
                emission *= power_heuristic(path.pdf, density);
            }
            add_color(out, settings.clamped(emission, path.bounce > 1));
        }
        let pair = FIRST_VERTEX + PAIRS_PER_VERTEX * u32::from(path.vertex);
        path.vertex += 1;
        let random = |k: u32| path.sampler.pair(sample, pair + k);
        let [roulette, opacity] = if path.bounce > 0 || features.transparency {
            random(3)
        } else {
            [0.0; 2]
        };

        // Pass through what is not there.
        let passing = look.transparent.mean();
        let pass = if passing > 0.0 {
            passing / (passing + look.solid)
        } else {
            0.0
        };
        if features.transparency && opacity < pass {
            path.throughput = path.throughput * look.transparent * (1.0 / pass);
            path.transparent += 1;
            if path.transparent < MOST_PASSED {
                path.passed += hit.t;
                wave.rays[kept] = surface.beyond(&ray, &hit);
                wave.paths[kept] = path;
                kept += 1;
            }
            continue;
        }

        if path.camera {
            out.alpha = 1.0;
            out.depth = context.camera.depth(surface.point);
            out.distance = context.camera.distance(surface.point);
            out.normal = surface.shading.array();
            out.position = surface.point.array();
            let triangle = hit.triangle as usize;
            let material = scene.attributes.at(hit.triangle).material();
            (out.object, out.material) = scene.indices.of(triangle, material as u32);
            out.uv = scene.indices.uv(triangle, hit.u, hit.v);
        }
        if pass > 0.0 {
            path.throughput *= 1.0 / (1.0 - pass);
        }
        if u32::from(path.bounce) > settings.max_bounces {
            continue;
        }
        // End paths that carry little, in proportion; the root keeps them a little longer, which
        // suits images that are seen through a view transform (as in Cycles).
        if path.bounce > 0 {
            let survive = path.throughput.max_component().sqrt().min(1.0);
            if roulette >= survive {
                continue;
            }
            path.throughput *= 1.0 / survive;
        }

        let frame = surface.frame();
        if ambient {
            let direction = frame.to_world(cosine_direction(random(0)));
            if direction.dot(surface.geometric) > 0.0 {
                wave.shadows.rays.push(Ray {
                    o: surface.leave_to_light::<SMOOTH>(direction).array(),
                    d: direction.array(),
                    t_min: 0.0,
                    t_max: settings.ambient_distance,
                });
                wave.shadows.light.push((path.slot, path.throughput));
            }
            continue;
        }
        let mut wi = frame.to_local(-d);
        wi.z = wi.z.max(1e-4);
        let normals = surface.normals(&frame);
        let bsdf =
            Bsdf::<GLOSSY, GLASS>::new(&material.closures, &registers, wi, normals, surface.inside);
        wave.work.shaded_glossy += u64::from(bsdf.reflects());
        wave.work.shaded_glass += u64::from(bsdf.transmits());
        wave.work.normals_fetched += u64::from(SMOOTH);
        let [choose_light, choose_lobe] = random(1);
        let normal = if bsdf.transmits() {
            Vec3::ZERO
        } else {
            surface.geometric
        };
        path.receiver = Receiver {
            point: surface.point,
            normal,
        };

        // Sample a light.
        if LIGHTS
            && bsdf.has_density()
            && let Some(light) = scene.lights.sample(path.receiver, choose_light, random(2))
        {
            let (f, pdf) = bsdf.eval_lit(frame.to_local(light.direction), light.visible);
            // Whitted's rays follow mirrors only: nothing else would find the light.
            let weight = if light.pdf.is_finite() && !whitted {
                power_heuristic(light.pdf, pdf)
            } else {
                1.0
            };
            let mut value = path.throughput * f * light.radiance * weight;
            if value.max_component() > 0.0 && !matches!(light.emitter, Emitter::Lamp) {
                value = value * sent(scene, &light, &mut light_registers);
            }
            if value.max_component() > 0.0 && value.is_finite() {
                let value = settings.clamped(value, path.bounce > 0);
                if light.casts_shadow {
                    let o = surface.leave_to_light::<SMOOTH>(light.direction);
                    let (d, t_max) = if light.distance.is_finite() {
                        (
                            surface.point + light.direction * light.distance - o,
                            BEFORE_LIGHT,
                        )
                    } else {
                        (light.direction, f32::INFINITY)
                    };
                    let ray = Ray {
                        o: o.array(),
                        d: d.array(),
                        t_min: 0.0,
                        t_max,
                    };
                    wave.shadows.rays.push(ray);
                    wave.shadows.light.push((path.slot, value));
                } else {
                    add_color(out, value);
                }
            }
        }

        // What a direction chosen in proportion to the light it brings weighs is, in the mean, the albedo.
        if path.camera
            && context.film.wants(Pass::Albedo)
            && let Some(scatter) = bsdf.sample(choose_lobe, random(0))
        {
            out.albedo = scatter.weight.array();
        }

        // Scatter.
        if u32::from(path.bounce) == settings.max_bounces && !last_ray_counts {
            continue;
        }
        let Some(scatter) = bsdf.sample(choose_lobe, random(0)) else {
            continue;
        };
        if whitted && scatter.pdf.is_finite() {
            continue;
        }
        let direction = frame.to_world(scatter.wo).normalized_or(surface.geometric);
        let across = direction.dot(surface.geometric) < 0.0;
        if across != (scatter.kind == RayKind::Transmission) {
            continue;
        }
        path.throughput = path.throughput * scatter.weight;
        if path.throughput.max_component() <= 0.0 || !path.throughput.is_finite() {
            continue;
        }
        path.pdf = scatter.pdf;
        path.passed = 0.0;
        path.camera = false;
        path.kind = scatter.kind;
        path.bounce += 1;
        let o = surface.leave(direction);
        wave.rays[kept] = Ray {
            o: o.array(),
            d: direction.array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        wave.paths[kept] = path;
        kept += 1;
    }
    wave.rays.truncate(kept);
    wave.paths.truncate(kept);
    wave.registers = registers;
    wave.light_registers = light_registers;
}

/// What the emitter of an arrival that is no lamp sends towards the receiver.
fn sent(scene: &RenderScene, light: &Arrival, registers: &mut Vec<Value>) -> Vec3 {
    match light.emitter {
        Emitter::Lamp => Vec3::ONE,
        Emitter::World => scene.world.radiance(
            &scene.images,
            &scene.varying,
            light.direction,
            RayKind::Diffuse,
            registers,
        ),
        Emitter::Triangle(triangle, [u, v]) => {
            let hit = Hit {
                t: light.distance,
                triangle,
                u,
                v,
            };
            let surface = Surface::at::<true>(scene, &hit, light.direction);
            let place = || surface.place(scene, light.direction, RayKind::Diffuse);
            surface
                .material
                .look(&scene.images, place, registers)
                .emission
        }
    }
}

/// Shadow rays end a little before the light, in units of the way to it.
const BEFORE_LIGHT: f32 = 1.0 - 1e-5;

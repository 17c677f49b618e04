// SPDX-License-Identifier: GPL-3.0-or-later
//! Shading of a wavefront's hits: adds emission, collects shadow rays, and replaces the rays by those of the next
//! bounce.

use crate::film::{Identities, LightParts, PixelSample, Shares};
use crate::material::bsdf::MAX_LOBES;
use crate::math::vector::Vec3;
use crate::path::beams::source::Source;
use crate::path::shadow_rays::{Scattered, ShadowRays, add_to_group};
use crate::path::state::Path;
use crate::path::wavefront::{Context, Wavefront};
use crate::path::work::Work;
use crate::scene::RenderScene;
use crate::scene::features::Features;
use crate::scene::surface::Surface;
use crate::settings::{Integrator, LightPass, LobeKind, Settings};
use crate::values::program::Value;
use halfspace_ray::{Hit, Ray};

mod emission;
mod light_samples;
mod scatter;

/// Shades all hits of a wavefront for the sample with this index.
pub type Shade = fn(&mut Wavefront, &Context<'_>, u32);

/// Returns the variant of [`shade`] compiled for exactly these features. `extra`: whether a pass is filled for which
/// [`crate::film::Batch`] has an array of its own.
pub fn choose(features: Features, extra: bool) -> Shade {
    let Features {
        lights,
        smooth_normals,
        ..
    } = features;
    // Passes that are rarely filled have two variants, for all other features.
    if extra {
        return if smooth_normals {
            shade::<true, true, true, true, MAX_LOBES, true>
        } else {
            shade::<true, true, true, false, MAX_LOBES, true>
        };
    }
    // Lobes with frames of their own come with all other lobes: rare scenes need no code for each subset.
    if features.lobes {
        return match (lights, smooth_normals) {
            (false, false) => shade::<false, true, true, false, MAX_LOBES, false>,
            (false, true) => shade::<false, true, true, true, MAX_LOBES, false>,
            (true, false) => shade::<true, true, true, false, MAX_LOBES, false>,
            (true, true) => shade::<true, true, true, true, MAX_LOBES, false>,
        };
    }
    // Expand the flags, one by one, to the constant parameters of `shade`.
    macro_rules! variant {
        ($($flag:expr),*; $($chosen:tt)*) => { variant!(@ [$($flag),*] [$($chosen)*]) };
        (@ [] [$($chosen:tt)*]) => { shade::<$($chosen)* 0, false> };
        (@ [$flag:expr $(, $rest:expr)*] [$($chosen:tt)*]) => {
            if $flag {
                variant!(@ [$($rest),*] [$($chosen)* true,])
            } else {
                variant!(@ [$($rest),*] [$($chosen)* false,])
            }
        };
    }
    variant!(lights, features.glossy, features.glass, smooth_normals;)
}

/// Shades all hits: adds emission, collects shadow rays, and replaces the rays by those of the next bounce. Paths
/// that continue keep their order.
fn shade<
    const LIGHTS: bool,
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
>(
    wave: &mut Wavefront,
    context: &Context<'_>,
    sample: u32,
) {
    let shader = Shader::<LIGHTS, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>::new(context, sample);
    let Wavefront {
        rays,
        hits,
        paths,
        batch,
        sources,
        shares,
        shadows,
        registers,
        light_registers,
        work,
        ..
    } = wave;
    // Compact the arrays in place: path `kept` overwrites one that has been read already.
    let mut kept = 0;
    for i in 0..rays.len() {
        // Shade on a copy of the path; it is stored back only if it continues.
        let mut path = paths[i];
        let slot = path.slot as usize;
        let mut out = Output::<EXTRA> {
            sample: &mut batch.samples[slot],
            extra: EXTRA.then(|| Extra {
                parts: batch.parts.get_mut(slot),
                shares: shares.get(i).copied().unwrap_or(Shares::DIFFUSE),
                groups: part(&mut batch.groups, slot, context.film.groups()),
                identities: batch.identities.get_mut(slot),
                motion: batch.motion.get_mut(slot),
                outputs: part(&mut batch.outputs, slot, context.film.outputs()),
            }),
            shadows: &mut *shadows,
            registers: &mut *registers,
            light_registers: &mut *light_registers,
            work: &mut *work,
            source: sources.get(i).copied().unwrap_or(Source::None),
            next: Source::None,
        };
        if let Some(next) = shader.shade_hit(&rays[i], &hits[i], &mut path, &mut out) {
            rays[kept] = next;
            if !sources.is_empty() {
                sources[kept] = out.next;
            }
            if EXTRA
                && let Some(extra) = &out.extra
                && !shares.is_empty()
            {
                shares[kept] = extra.shares;
            }
            paths[kept] = path;
            kept += 1;
        }
    }
    rays.truncate(kept);
    paths.truncate(kept);
    sources.truncate(kept);
    shares.truncate(kept);
}

/// The outputs of shading.
struct Output<'a, const EXTRA: bool> {
    sample: &'a mut PixelSample,
    /// What passes that are rarely filled need, if any is.
    extra: Option<Extra<'a>>,
    shadows: &'a mut ShadowRays,
    /// Registers of a material's program, reused from point to point.
    registers: &'a mut Vec<Value>,
    /// Registers of the programs of emitters.
    light_registers: &'a mut Vec<Value>,
    work: &'a mut Work,
    /// The beam of the ray.
    source: Source,
    /// The beam of the next ray.
    next: Source,
}

/// The outputs of shading for passes that are rarely filled.
struct Extra<'a> {
    /// The light of the sample by light pass, if such passes are filled.
    parts: Option<&'a mut LightParts>,
    /// The shares of the lobes of the path's first surface, if light passes are filled and it has scattered.
    shares: Shares,
    /// The light of the sample by light group.
    groups: &'a mut [[f32; 3]],
    /// The identities of the first surface, if a matte is filled.
    identities: Option<&'a mut Identities>,
    /// The motion of the first surface, if the vector pass is filled.
    motion: Option<&'a mut [f32; 5]>,
    /// The outputs of the first surface's material.
    outputs: &'a mut [[f32; 4]],
}

/// Returns the `count` values of a slot.
fn part<T>(values: &mut [T], slot: usize, count: usize) -> &mut [T] {
    &mut values[slot * count..(slot + 1) * count]
}

impl<'a, const EXTRA: bool> Output<'a, EXTRA> {
    /// Returns what passes that are rarely filled need.
    #[inline(always)]
    fn extra(&mut self) -> Option<&mut Extra<'a>> {
        if EXTRA { self.extra.as_mut() } else { None }
    }

    /// Adds light that the path's ray meets. `seen`: the pass of light that the camera sees directly; `group`: returns
    /// the light group of the emitter, called only if such groups are filled.
    #[inline(always)]
    fn add_met(&mut self, light: Vec3, path: &Path, seen: LightPass, group: impl FnOnce() -> u8) {
        self.sample.add(light);
        let Some(extra) = self.extra() else {
            return;
        };
        if !extra.groups.is_empty() {
            add_to_group(extra.groups, group(), light);
        }
        if let Some(parts) = &mut extra.parts {
            if path.bounce == 0 {
                parts.add(seen, light);
            } else {
                parts.add_scattered(light, &extra.shares, path.bounce > 1);
            }
        }
    }

    /// Returns what the light passes and light groups need of light that the path's vertex scatters, if they are filled.
    /// `shares`: returns the shares of the vertex's lobes, which count at the first one; `group`: returns the light
    /// group of the emitter.
    #[inline(always)]
    fn scattered(
        &self,
        path: &Path,
        shares: impl FnOnce() -> Shares,
        group: impl FnOnce() -> u8,
    ) -> Option<Scattered> {
        let extra = self.extra.as_ref().filter(|_| EXTRA)?;
        let divided = extra.parts.is_some();
        if !divided && extra.groups.is_empty() {
            return None;
        }
        let indirect = path.bounce > 0;
        let first = divided && !indirect;
        Some(Scattered {
            shares: if first { shares() } else { extra.shares },
            indirect,
            group: group(),
        })
    }

    /// Adds light that the path's vertex scatters and nothing occludes.
    #[inline(always)]
    fn add_unoccluded(&mut self, light: Vec3, scattered: Option<Scattered>) {
        self.sample.add(light);
        if let (Some(extra), Some(of)) = (self.extra(), scattered) {
            add_to_group(extra.groups, of.group, light);
            if let Some(parts) = &mut extra.parts {
                parts.add_scattered(light, &of.shares, of.indirect);
            }
        }
    }

    /// Adds the colours of the path's first surface. `colors`: returns those of the kinds of lobes.
    #[inline(always)]
    fn add_colors(&mut self, throughput: Vec3, colors: impl FnOnce() -> [Vec3; 3]) {
        if let Some(extra) = self.extra()
            && let Some(parts) = &mut extra.parts
        {
            let kinds = [LobeKind::Diffuse, LobeKind::Glossy, LobeKind::Transmission];
            for (kind, color) in kinds.into_iter().zip(colors()) {
                parts.add(LightPass::Color(kind), throughput * color);
            }
        }
    }
}

/// Shading of one sample, compiled for a set of features.
struct Shader<
    'a,
    const LIGHTS: bool,
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> {
    context: &'a Context<'a>,
    scene: &'a RenderScene,
    settings: &'a Settings,
    features: Features,
    sample: u32,
    /// Whether camera rays can see lamps.
    camera_sees_lamps: bool,
    /// Whether the ray after the last bounce can still find light.
    last_ray_counts: bool,
}

impl<
    'a,
    const LIGHTS: bool,
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'a, LIGHTS, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Computes the values that are the same for all hits.
    fn new(context: &'a Context<'a>, sample: u32) -> Self {
        let Context {
            scene, settings, ..
        } = *context;
        let features = scene.features();
        Self {
            context,
            scene,
            settings,
            features,
            sample,
            camera_sees_lamps: scene.lights.any_camera_visible(),
            last_ray_counts: features.lights_hittable
                || features.emission
                || !scene.world.is_black(),
        }
    }

    /// Shades one hit. Returns the next ray if the path continues.
    #[inline(always)]
    fn shade_hit(
        &self,
        ray: &Ray,
        hit: &Hit,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let (scene, features) = (self.scene, self.features);
        // The direction has unit length.
        let d = Vec3::from(ray.d);
        // Add the light of lamps in front of the hit, and of the background.
        if LIGHTS && features.lights_hittable {
            self.add_lamps(d, hit, path, out);
        }
        if !hit.is_hit() {
            self.add_background(d, path, out);
            return None;
        }
        // Find the surface; rays to which it is invisible pass through it.
        let mut surface = Surface::at::<SMOOTH>(scene, hit, d);
        out.work.normals_fetched += u64::from(SMOOTH);
        if features.hidden && !surface.material.visible.to(path.kind) {
            return path
                .pass_invisible(hit.t)
                .then(|| surface.continued(ray, hit));
        }
        self.run_program(&mut surface, d, hit.t, path, out);
        // Add the emission of the surface.
        let material = surface.material;
        let unscattered = material.unscattered(out.registers);
        let hole = features.holes && material.hole && path.camera;
        if features.emission
            && !hole
            && !self.is(Integrator::Ambient)
            && unscattered.emission != Vec3::ZERO
        {
            let cosine = || surface.cosine(d);
            let emission = material.coated_emission(unscattered.emission, out.registers, cosine);
            self.add_emission(emission, hit, surface.geometric.dot(d).abs(), path, out);
        }
        // Draw the random numbers of this vertex.
        let random = path.next_vertex(self.sample);
        let [roulette, opacity] = if path.bounce > 0 || features.transparency {
            random.survival()
        } else {
            [0.0; 2]
        };

        // Pass through with the probability of the transparent part; scatter with the remaining probability. Dividing
        // by the probability keeps both unbiased.
        let pass = if hole {
            unscattered.transparent.mean().min(1.0)
        } else {
            unscattered.pass_probability()
        };
        if features.transparency && opacity < pass {
            path.throughput = path.throughput * unscattered.transparent * (1.0 / pass);
            return path.pass(hit.t).then(|| surface.continued(ray, hit));
        }
        // A hole hides what lies behind and shows nothing.
        if hole {
            return None;
        }
        // The first surface that is not passed makes the pixel opaque, except for holes.
        if path.camera {
            self.write_first_surface(hit, &surface, out);
            out.sample.alpha = unscattered.opacity();
        }
        if pass > 0.0 {
            path.throughput *= 1.0 / (1.0 - pass);
        }
        // End the path by length or by Russian roulette.
        if u32::from(path.bounce) > self.settings.max_bounces || !path.survives(roulette) {
            return None;
        }
        self.scatter(&surface, d, random, path, out)
    }

    /// Runs the program of the surface's material, which may also give a normal. `distance`: length of the ray.
    #[inline(always)]
    fn run_program(
        &self,
        surface: &mut Surface<'_>,
        d: Vec3,
        distance: f32,
        path: &Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        let (scene, material) = (self.scene, surface.material);
        if material.program.is_empty() {
            return;
        }
        let mut point = surface.shading_point(scene, d, path.kind);
        // Reflected rays see about as much of a surface as a camera at their origin would.
        point.footprint = self.context.camera.pixel_width(path.passed + distance);
        point.view = Some(self.context.camera.view());
        point.history = path.history(distance);
        material.program.run(&scene.images, &point, out.registers);
        out.work.shaded_textures += 1;
        if let Some(normal) = material.normal(out.registers) {
            surface.bend(normal, d);
        }
    }

    /// Whether the settings select this integrator.
    #[inline(always)]
    fn is(&self, integrator: Integrator) -> bool {
        self.settings.integrator == integrator
    }

    /// Writes the first surface's data for passes.
    #[inline(always)]
    fn write_first_surface(&self, hit: &Hit, surface: &Surface<'_>, out: &mut Output<'_, EXTRA>) {
        let (scene, camera) = (self.scene, self.context.camera);
        let sample = &mut *out.sample;
        sample.depth = camera.depth(surface.point);
        sample.distance = camera.distance(surface.point);
        sample.normal = surface.shading.array();
        sample.position = surface.point.array();
        let triangle = hit.triangle as usize;
        let material = scene.attributes.at(hit.triangle).material();
        (sample.object, sample.material) = scene.indices.of(triangle, material as u32);
        sample.uv = scene.indices.uv(triangle, hit.u, hit.v);
        let Some(extra) = out.extra.as_mut().filter(|_| EXTRA) else {
            return;
        };
        if let Some(identities) = &mut extra.identities {
            **identities = scene.indices.identities(triangle, material as u32);
        }
        if let Some(motion) = &mut extra.motion {
            let moved = scene.indices.moved(triangle, hit.u, hit.v);
            let [a, b, c, d] = camera.motion(surface.point, moved);
            **motion = [a, b, c, d, 1.0];
        }
        if !extra.outputs.is_empty() {
            surface.material.output(out.registers, extra.outputs);
        }
    }
}

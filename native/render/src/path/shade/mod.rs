// SPDX-License-Identifier: GPL-3.0-or-later
//! Shading of a wavefront's hits: adds emission, collects shadow rays, and replaces the rays by those of the next
//! bounce.

use crate::film::catcher::Catch;
use crate::film::{PixelSample, Shares};
use crate::material::bsdf::{Bsdf, MAX_LOBES};
use crate::math::vector::Vec3;
use crate::path::beams::source::Source;
use crate::path::calls::Cancelled;
use crate::path::shade::output::{Extra, Output};
use crate::path::shade::programs::{Programs, Wave};
use crate::path::shade::volume::Crossed;
use crate::path::state::Path;
use crate::path::wavefront::{Context, Wavefront};
use crate::scene::RenderScene;
use crate::scene::ahead::Ahead;
use crate::scene::features::Features;
use crate::scene::surface::Surface;
use crate::settings::{Integrator, Pass, Settings};
use halfspace_ray::{Hit, Ray};
use std::sync::atomic::Ordering;

mod around;
mod catcher;
mod emission;
mod light_samples;
mod output;
mod portal;
mod programs;
mod scatter;
mod subsurface;
mod volume;
mod volume_light;

pub use crate::path::shade::programs::Buffers;

/// Shades all hits of a wavefront; fails only if the render is cancelled.
pub type Shade = fn(&mut Wavefront, &Context<'_>) -> Result<(), Cancelled>;

/// Number of hits between two checks whether the render is cancelled.
const CHECKED: usize = 512;

/// Returns the variant of [`shade`] compiled for these features. `extra`: whether a pass is filled for which
/// [`crate::film::Batch`] has an array of its own.
pub fn choose(features: Features, extra: bool) -> Shade {
    let Features { smooth_normals, .. } = features;
    // Passes that are rarely filled, and lobes with frames of their own, come with all other features: rare scenes need
    // no code for each subset.
    if extra || features.lobes {
        return match (smooth_normals, extra) {
            (false, false) => shade::<true, true, false, MAX_LOBES, false>,
            (true, false) => shade::<true, true, true, MAX_LOBES, false>,
            (false, true) => shade::<true, true, false, MAX_LOBES, true>,
            (true, true) => shade::<true, true, true, MAX_LOBES, true>,
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
    variant!(features.glossy, features.glass, smooth_normals;)
}

/// Returns the triangle that a ray behind a hit has left, or [`Hit::NONE`]: rays that begin on a surface exclude it by
/// their interval.
#[inline(always)]
fn left_by(next: &Ray, hit: &Hit) -> u32 {
    if next.t_min > 0.0 {
        hit.triangle
    } else {
        Hit::NONE
    }
}

/// Shades all hits: adds emission, collects shadow rays, and replaces the rays by those of the next bounce. Paths
/// that continue keep their order.
///
/// # Errors
/// [`Cancelled`] if the render is cancelled.
fn shade<
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
>(
    wave: &mut Wavefront,
    context: &Context<'_>,
) -> Result<(), Cancelled> {
    let shader = Shader::<GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>::new(context);
    let Wavefront {
        rays,
        hits,
        paths,
        batch,
        sources,
        media,
        scratch,
        shares,
        walks,
        shadows,
        registers,
        light_registers,
        work,
        programs,
        ..
    } = wave;
    // Compact the arrays in place: path `kept` overwrites one that has been read already.
    let ahead = Ahead::new(context.scene);
    let mut kept = 0;
    let mut splits = Vec::new();
    let mut unseen = PixelSample::EMPTY;
    let mut bsdf = Bsdf::empty();
    let mut programs = Programs::new(context, programs);
    for i in 0..rays.len() {
        if i.is_multiple_of(CHECKED) && context.stop.load(Ordering::Relaxed) {
            return Err(Cancelled);
        }
        ahead.fetch(hits, i);
        let all = Wave {
            rays,
            hits,
            paths,
            walks,
        };
        let known = programs.ready::<SMOOTH>(context, i, all, registers);
        // Shade on a copy of the path; it is stored back only if it continues.
        let (mut path, ray) = (paths[i], rays[i]);
        let (sample, extra) = if EXTRA {
            if let Some(alone) =
                catcher::split(context, &ray, &hits[i], &mut path, batch, light_registers)
            {
                let beside = (sources.get(i), media.get(i), shares.get(i), walks.get(i));
                splits.push(catcher::Split::new(alone, ray, beside));
            }
            let shares = shares.get(i).copied().unwrap_or(Shares::DIFFUSE);
            let (sample, extra) = Extra::of(&path, shares, context.film, batch, &mut unseen);
            (sample, Some(extra))
        } else {
            (&mut batch.samples[path.slot as usize], None)
        };
        let mut out = Output::<EXTRA> {
            sample,
            extra,
            shadows: &mut *shadows,
            registers: &mut *registers,
            has_run: known.is_some(),
            light_registers: &mut *light_registers,
            work: &mut *work,
            source: sources.get(i).copied().unwrap_or(Source::None),
            next: Source::None,
            media: media.get(i).copied(),
            walk: walks.get(i).copied().flatten(),
            scratch: &mut *scratch,
            seed: 0,
        };
        if let Some(next) = shader.shade_hit(&ray, &hits[i], known, &mut path, &mut bsdf, &mut out)
        {
            path.left = left_by(&next, &hits[i]);
            rays[kept] = next;
            set(sources, kept, Some(out.next));
            set(shares, kept, out.shares());
            set(media, kept, out.media);
            set(walks, kept, Some(out.walk));
            paths[kept] = path;
            kept += 1;
        }
    }
    wave.truncate(kept);
    // Append the paths that shadow catchers split off.
    splits.into_iter().for_each(|split| split.append(wave));
    Ok(())
}

/// Stores an item of a path that continues. Does nothing if the array is empty: the wavefront has no such items.
#[inline(always)]
fn set<T>(all: &mut [T], index: usize, own: Option<T>) {
    if let Some(own) = own
        && !all.is_empty()
    {
        all[index] = own;
    }
}

/// Continues a ray behind a surface that does not exist for it.
#[inline(always)]
fn pass_invisible(surface: &Surface<'_>, ray: &Ray, hit: &Hit, path: &mut Path) -> Option<Ray> {
    path.pass_invisible(hit.t)
        .then(|| surface.continued(ray, hit))
}

/// Shading, compiled for a set of features.
struct Shader<
    'a,
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
    /// Whether camera rays can see lamps.
    camera_sees_lamps: bool,
    /// Whether the pass of the albedo is filled.
    albedo: bool,
    /// Whether the ray after the last bounce can still find light.
    last_ray_counts: bool,
    /// Whether the film is transparent behind glass.
    clear_glass: bool,
}

impl<
    'a,
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'a, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Computes the values that are the same for all hits.
    fn new(context: &'a Context<'a>) -> Self {
        let Context {
            scene, settings, ..
        } = *context;
        let features = scene.features();
        Self {
            context,
            scene,
            settings,
            features,
            camera_sees_lamps: scene.lights.any_camera_visible() && context.points.is_none(),
            albedo: context.film.fills(Pass::Albedo),
            last_ray_counts: features.lights_hittable
                || features.emission
                || !scene.world.is_black(),
            clear_glass: settings.film_transparent && settings.transparent_glass >= 0.0,
        }
    }

    /// Adds the emission of a surface, dimmed by its coats.
    #[inline(always)]
    fn add_surface_emission(
        &self,
        surface: &Surface<'_>,
        emission: Vec3,
        d: Vec3,
        hit: &Hit,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        let cosine = || surface.cosine(d);
        let emission = (surface.material).coated_emission(emission, out.registers, cosine);
        self.add_emission(emission, hit, surface.flat_cosine(d), path, out);
    }

    /// Finds the surface of a hit. Returns the ray that goes on if the surface is invisible to it, or only the boundary of
    /// a volume.
    #[inline(always)]
    fn arrive(
        &self,
        ray: &Ray,
        hit: &Hit,
        known: Option<Surface<'a>>,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Result<Surface<'a>, Option<Ray>> {
        let (scene, d) = (self.scene, Vec3::from(ray.d));
        let surface = known.unwrap_or_else(|| Surface::at::<SMOOTH>(scene, hit, d, Some(ray)));
        out.work.normals_fetched += u64::from(SMOOTH);
        if self.features.hidden && surface.is_passed(scene, path.kind) && !self.is_point(path)
            || EXTRA && path.catch == Catch::OnlyCatchers && !surface.material.catcher
        {
            return Err(pass_invisible(&surface, ray, hit, path));
        }
        if out.media.is_some() && surface.material.boundary {
            out.cross(&surface);
            return Err(pass_invisible(&surface, ray, hit, path));
        }
        Ok(surface)
    }

    /// Shades one hit. `known`: its surface, if its program has run. Returns the next ray if the path continues.
    #[inline(always)]
    fn shade_hit(
        &self,
        ray: &Ray,
        hit: &Hit,
        known: Option<Surface<'a>>,
        path: &mut Path,
        bsdf: &mut Bsdf<GLOSSY, GLASS, LOBES>,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let (scene, features) = (self.scene, self.features);
        // Rays below a surface see nothing but their object.
        if LOBES > 0
            && let Some(walk) = out.walk
        {
            return self.walk(walk, ray, hit, path, out);
        }
        // The direction has unit length.
        let d = Vec3::from(ray.d);
        // Traverse the media on the way. Add the light of lamps in front of the hit, and of the background.
        if out.media.is_some() {
            match volume::cross(self.context, ray, hit, path, out) {
                Crossed::Reached => {}
                Crossed::Scattered(next) => return Some(next),
                Crossed::Ended => return None,
            }
        } else if features.lights_hittable {
            self.add_lamps(d, hit, path, out);
        }
        if !hit.is_hit() {
            self.add_background(d, path, out);
            return None;
        }
        let mut surface = match self.arrive(ray, hit, known, path, out) {
            Ok(surface) => surface,
            Err(next) => return next,
        };
        self.run_program(&mut surface, d, hit.t, path, out);
        // Add the emission of the surface.
        let unscattered = surface.material.unscattered(out.registers);
        let hole = features.holes && surface.material.hole && path.camera;
        if features.emission
            && !hole
            && !self.is(Integrator::Ambient)
            && unscattered.emission != Vec3::ZERO
        {
            self.add_surface_emission(&surface, unscattered.emission, d, hit, path, out);
        }
        // Behind as many surfaces as a path may pass, the next one only emits.
        if path.has_passed_all(self.settings) {
            if path.camera {
                out.sample.alpha = 1.0;
                out.dim_holes(path);
            }
            return None;
        }
        // Draw the random numbers of this vertex.
        let random = path.next_vertex();
        let [roulette, mut opacity] = if path.bounce > 0 || features.transparency {
            random.survival()
        } else {
            [0.0; 2]
        };
        // Go on at another place with the probability of the portals.
        if features.portals && !hole && !surface.material.portals.is_empty() {
            match portal::pass(scene, &surface, &unscattered, d, opacity, path, out) {
                Ok(rest) => opacity = rest,
                Err(next) => return next,
            }
        }
        // Pass through with the probability of the transparent part; scatter with the remaining probability. Dividing
        // by the probability keeps both unbiased.
        let pass = if hole {
            unscattered.transparent.mean().min(1.0)
        } else {
            unscattered.pass_probability()
        };
        if features.transparency && opacity < pass {
            path.throughput = path.throughput * unscattered.transparent * (1.0 / pass);
            out.cross(&surface);
            path.pass(hit.t);
            return Some(surface.continued(ray, hit));
        }
        // A hole hides what lies behind and shows nothing but the media before it.
        if hole {
            if out.media.is_some() {
                out.sample.alpha = volume::opacity(path);
            }
            return None;
        }
        // The first surface that is not passed makes the pixel opaque, except for holes.
        if path.camera {
            self.write_first_surface(hit, &surface, out);
            out.sample.alpha = unscattered.opacity();
            out.dim_holes(path);
        }
        path.throughput *= 1.0 / (1.0 - pass);
        // End the path by length or by Russian roulette.
        if path.is_at_limit(self.settings) || !path.survives(roulette) {
            return None;
        }
        self.scatter(&surface, d, random, path, bsdf, out)
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
        // Run the program, unless the registers hold its results.
        if !out.has_run {
            let point = programs::point(self.context, surface, d, distance, path);
            if self.features.program_rays && material.traces_rays {
                around::run(self.context, path.sample(), surface, point, path, out);
            } else {
                material.program.run(&scene.images, &point, out.registers);
            }
        }
        out.work.shaded_textures += 1;
        if let Some(normal) = material.normal(out.registers) {
            surface.bend(normal, d);
        }
    }

    /// Whether the path is at the point of a surface that its pixel shows, which need not be visible.
    fn is_point(&self, path: &Path) -> bool {
        self.context.points.is_some() && path.camera
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
        let at = scene.attributes.at(hit.triangle);
        let material = at.material();
        (sample.object, sample.material) = scene.indices.of(triangle, material as u32);
        sample.uv = scene.indices.uv(at.row(), hit.u, hit.v);
        let Some(extra) = out.extra.as_mut().filter(|_| EXTRA) else {
            return;
        };
        if let Some(identities) = &mut extra.identities {
            **identities = scene.indices.identities(triangle, material as u32);
        }
        if let Some(motion) = &mut extra.motion {
            let moved = scene.indices.moved(at.row(), hit.u, hit.v);
            let [a, b, c, d] = camera.motion(surface.point, moved);
            **motion = [a, b, c, d, 1.0];
        }
        if !extra.outputs.is_empty() {
            surface.material.output(out.registers, extra.outputs);
        }
    }
}

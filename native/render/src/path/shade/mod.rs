// SPDX-License-Identifier: GPL-3.0-or-later
//! Shading of a wavefront's hits: adds emission, collects shadow rays, and replaces the rays by those of the next
//! bounce.

use crate::film::PixelSample;
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::beams::source::Source;
use crate::path::media::Scratch;
use crate::path::shade::volume::Crossed;
use crate::path::shadow_rays::{Passing, ShadowRays};
use crate::path::state::Path;
use crate::path::wavefront::{Context, Wavefront};
use crate::path::work::Work;
use crate::scene::RenderScene;
use crate::scene::features::Features;
use crate::scene::surface::Surface;
use crate::settings::{Integrator, Settings};
use crate::values::program::Value;
use halfspace_ray::{Hit, Ray};

mod emission;
mod light_samples;
mod scatter;
mod volume;

/// Shades all hits of a wavefront for the sample with this index.
pub type Shade = fn(&mut Wavefront, &Context<'_>, u32);

/// Returns the variant of [`shade`] compiled for exactly these features.
pub fn choose(features: Features) -> Shade {
    // Expand the flags, one by one, to the constant parameters of `shade`.
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

/// Shades all hits: adds emission, collects shadow rays, and replaces the rays by those of the next bounce. Paths
/// that continue keep their order.
fn shade<const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>(
    wave: &mut Wavefront,
    context: &Context<'_>,
    sample: u32,
) {
    let shader = Shader::<LIGHTS, GLOSSY, GLASS, SMOOTH>::new(context, sample);
    let Wavefront {
        rays,
        hits,
        paths,
        samples,
        sources,
        media,
        scratch,
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
        let mut out = Output {
            sample: &mut samples[path.slot as usize],
            shadows: &mut *shadows,
            registers: &mut *registers,
            light_registers: &mut *light_registers,
            work: &mut *work,
            source: sources.get(i).copied().unwrap_or(Source::None),
            next: Source::None,
            media: media.get(i).copied(),
            scratch: &mut *scratch,
            seed: 0,
        };
        if let Some(next) = shader.shade_hit(&rays[i], &hits[i], &mut path, &mut out) {
            rays[kept] = next;
            if !sources.is_empty() {
                sources[kept] = out.next;
            }
            if let Some(stack) = out.media {
                media[kept] = stack;
            }
            paths[kept] = path;
            kept += 1;
        }
    }
    rays.truncate(kept);
    paths.truncate(kept);
    sources.truncate(kept);
    media.truncate(kept);
}

/// The outputs of shading.
struct Output<'a> {
    sample: &'a mut PixelSample,
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
    /// The media that the ray is in; `None` if the scene has none, or they are not rendered.
    media: Option<Stack>,
    scratch: &'a mut Scratch,
    /// Seed of the streams of random numbers within media; set where there are any.
    seed: u32,
}

impl Output<'_> {
    /// Adds a shadow ray with its light. `surface`: from which it starts, to either side.
    #[inline(always)]
    fn cast(&mut self, ray: Ray, path: &Path, value: Vec3, surface: Option<&Surface<'_>>) {
        self.shadows.push(ray, path, value);
        if let Some(stack) = self.media {
            let mut passing = Passing::new(stack, self.seed);
            if let Some(surface) = surface.filter(|s| s.geometric.dot(Vec3::from(ray.d)) < 0.0) {
                passing.stack.cross(surface.medium_behind(), surface.inside);
            }
            self.shadows.push_media(passing);
        }
    }

    /// Crosses a surface into or out of its object.
    #[inline(always)]
    fn cross(&mut self, surface: &Surface<'_>) {
        if let Some(stack) = &mut self.media {
            stack.cross(surface.medium_behind(), surface.inside);
        }
    }
}

/// Shading of one sample, compiled for a set of features.
struct Shader<'a, const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool> {
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

impl<'a, const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>
    Shader<'a, LIGHTS, GLOSSY, GLASS, SMOOTH>
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
        out: &mut Output<'_>,
    ) -> Option<Ray> {
        let (scene, features) = (self.scene, self.features);
        // The direction has unit length.
        let d = Vec3::from(ray.d);
        // Traverse the media on the way. Add the light of lamps in front of the hit, and of the background.
        if out.media.is_some() {
            match volume::cross(self.context, self.sample, ray, hit, path, out) {
                Crossed::Reached => {}
                Crossed::Scattered(next) => return Some(next),
                Crossed::Ended => return None,
            }
        } else if LIGHTS && features.lights_hittable {
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
        // Pass the boundaries of volumes.
        if out.media.is_some() && surface.material.boundary {
            out.cross(&surface);
            return path
                .pass_invisible(hit.t)
                .then(|| surface.continued(ray, hit));
        }
        self.run_program(&mut surface, d, hit.t, path, out);
        // Add the emission of the surface.
        let material = surface.material;
        let unscattered = material.unscattered(out.registers);
        if features.emission && !self.is(Integrator::Ambient) && unscattered.emission != Vec3::ZERO
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
        let pass = unscattered.pass_probability();
        if features.transparency && opacity < pass {
            path.throughput = path.throughput * unscattered.transparent * (1.0 / pass);
            out.cross(&surface);
            return path.pass(hit.t).then(|| surface.continued(ray, hit));
        }
        if path.camera {
            self.write_first_surface(hit, &surface, out.sample);
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
        out: &mut Output<'_>,
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
    fn write_first_surface(&self, hit: &Hit, surface: &Surface<'_>, sample: &mut PixelSample) {
        let (scene, camera) = (self.scene, self.context.camera);
        // The first surface that is not passed makes the pixel opaque.
        sample.alpha = 1.0;
        sample.depth = camera.depth(surface.point);
        sample.distance = camera.distance(surface.point);
        sample.normal = surface.shading.array();
        sample.position = surface.point.array();
        let triangle = hit.triangle as usize;
        let material = scene.attributes.at(hit.triangle).material();
        (sample.object, sample.material) = scene.indices.of(triangle, material as u32);
        sample.uv = scene.indices.uv(triangle, hit.u, hit.v);
    }
}

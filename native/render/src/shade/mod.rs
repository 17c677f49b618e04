// SPDX-License-Identifier: GPL-3.0-or-later
//! Shading of a wavefront's hits: adds emission, collects shadow rays, and replaces the rays by those of the next
//! bounce.

use crate::bsdf::Bsdf;
use crate::features::Features;
use crate::film::PixelSample;
use crate::integrator::{Context, Wavefront};
use crate::lights::Receiver;
use crate::path::Path;
use crate::place::RayKind;
use crate::program::Value;
use crate::scene::RenderScene;
use crate::settings::{Integrator, Pass, Settings};
use crate::shadow_rays::ShadowRays;
use crate::surface::Surface;
use crate::vector::{Frame, Vec3};
use crate::work::Work;
use halfspace_ray::{Hit, Ray};

mod asked;
mod found;

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
        let mut out = Out {
            sample: &mut samples[path.slot as usize],
            shadows: &mut *shadows,
            registers: &mut *registers,
            light_registers: &mut *light_registers,
            work: &mut *work,
        };
        if let Some(next) = shader.follow(&rays[i], &hits[i], &mut path, &mut out) {
            rays[kept] = next;
            paths[kept] = path;
            kept += 1;
        }
    }
    rays.truncate(kept);
    paths.truncate(kept);
}

/// The outputs of shading.
struct Out<'a> {
    sample: &'a mut PixelSample,
    shadows: &'a mut ShadowRays,
    /// Registers of a material's program, reused from point to point.
    registers: &'a mut Vec<Value>,
    /// Registers of the programs of emitters.
    light_registers: &'a mut Vec<Value>,
    work: &'a mut Work,
}

/// Shading of one sample, compiled for a set of features.
struct Shader<'a, const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool> {
    context: &'a Context<'a>,
    scene: &'a RenderScene,
    settings: &'a Settings,
    features: Features,
    sample: u32,
    /// Whether camera rays can see lamps.
    lamps_seen: bool,
    /// Whether the ray after the last bounce can still find light.
    last_ray_counts: bool,
}

impl<'a, const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>
    Shader<'a, LIGHTS, GLOSSY, GLASS, SMOOTH>
{
    /// Looks up what is the same for all hits.
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
            lamps_seen: scene.lights.any_seen(),
            last_ray_counts: features.lights_met || features.emission || !scene.world.is_black(),
        }
    }

    /// Shades one hit. Returns the next ray if the path continues.
    #[inline(always)]
    fn follow(&self, ray: &Ray, hit: &Hit, path: &mut Path, out: &mut Out<'_>) -> Option<Ray> {
        let (scene, features) = (self.scene, self.features);
        // The direction has unit length.
        let d = Vec3::from(ray.d);
        // Add the light of lamps in front of the hit, and of the background.
        if LIGHTS && features.lights_met {
            self.meet_lights(d, hit, path, out);
        }
        if !hit.is_hit() {
            self.leave_scene(d, path, out);
            return None;
        }
        // Find the surface; rays to which it is invisible pass through it.
        let mut surface = Surface::at::<SMOOTH>(scene, hit, d);
        out.work.normals_fetched += u64::from(SMOOTH);
        let material = surface.material;
        if features.hidden && !material.visible.to(path.kind) {
            return path.pass_unseen(hit.t).then(|| surface.beyond(ray, hit));
        }
        // Run the material's program, which may also give a normal.
        if !material.program.is_empty() {
            let place = surface.place(scene, d, path.kind);
            material.program.run(&scene.images, &place, out.registers);
            out.work.shaded_textures += 1;
            if let Some(normal) = material.normal(out.registers) {
                surface.bend(normal, d);
            }
        }
        // Add the emission of the surface.
        let look = material.look_here(out.registers);
        if features.emission && !self.is(Integrator::Ambient) && look.emission != Vec3::ZERO {
            let emission = material.dimmed_here(look.emission, out.registers, || surface.cosine(d));
            self.add_emission(emission, (hit, &surface, d), path, out);
        }
        // Draw the random numbers of this vertex.
        let random = path.at_vertex(self.sample);
        let [roulette, opacity] = if path.bounce > 0 || features.transparency {
            random.fate()
        } else {
            [0.0; 2]
        };

        // Pass through in proportion to the transparent part; the other branch gets the rest of the throughput.
        let passing = look.transparent.mean();
        let pass = if passing > 0.0 {
            passing / (passing + look.solid)
        } else {
            0.0
        };
        if features.transparency && opacity < pass {
            path.throughput = path.throughput * look.transparent * (1.0 / pass);
            return path.pass(hit.t).then(|| surface.beyond(ray, hit));
        }
        if path.camera {
            self.describe(hit, &surface, out.sample);
        }
        if pass > 0.0 {
            path.throughput *= 1.0 / (1.0 - pass);
        }
        // End the path by length or by Russian roulette.
        if u32::from(path.bounce) > self.settings.max_bounces || !path.survives(roulette) {
            return None;
        }
        // Assemble the BSDF in the shading frame.
        let frame = surface.frame();
        if self.is(Integrator::Ambient) {
            self.look_around(&surface, &frame, random, path, out);
            return None;
        }
        let mut wi = frame.to_local(-d);
        wi.z = wi.z.max(1e-4);
        let normals = surface.normals(&frame);
        let bsdf = Bsdf::new(
            &material.closures,
            out.registers,
            wi,
            normals,
            surface.inside,
        );
        out.work.shaded_glossy += u64::from(bsdf.reflects());
        out.work.shaded_glass += u64::from(bsdf.transmits());
        // Light from behind reaches a surface only if it transmits.
        let normal = if bsdf.transmits() {
            Vec3::ZERO
        } else {
            surface.geometric
        };
        path.receiver = Receiver {
            point: surface.point,
            normal,
        };
        // Sample a light, then the next direction.
        let [choose_light, choose_lobe] = random.choices();
        if LIGHTS && bsdf.has_density() {
            let random = (choose_light, random.light());
            self.sample_light(&surface, (&frame, &bsdf), random, path, out);
        }
        let random = (choose_lobe, random.direction());
        self.scatter(&surface, (&frame, &bsdf), random, path, out)
    }

    #[inline(always)]
    fn is(&self, integrator: Integrator) -> bool {
        self.settings.integrator == integrator
    }

    /// Writes the first surface's data for passes.
    #[inline(always)]
    fn describe(&self, hit: &Hit, surface: &Surface<'_>, sample: &mut PixelSample) {
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

    /// Samples the next direction. Returns the next ray if the path continues.
    #[inline(always)]
    fn scatter(
        &self,
        surface: &Surface<'_>,
        (frame, bsdf): (&Frame, &Bsdf<GLOSSY, GLASS>),
        (choice, u): (f32, [f32; 2]),
        path: &mut Path,
        out: &mut Out<'_>,
    ) -> Option<Ray> {
        // The expected weight of a sampled direction is the albedo.
        if path.camera
            && self.context.film.wants(Pass::Albedo)
            && let Some(scatter) = bsdf.sample(choice, u)
        {
            out.sample.albedo = scatter.weight.array();
        }
        // Without light to be found, the ray after the last bounce is not needed.
        if u32::from(path.bounce) == self.settings.max_bounces && !self.last_ray_counts {
            return None;
        }
        // Sample the BSDF and transform to scene space.
        let scatter = bsdf.sample(choice, u)?;
        let direction = frame.to_world(scatter.wo).normalized_or(surface.geometric);
        // Drop directions where shading and geometric normal disagree about the side.
        let across = direction.dot(surface.geometric) < 0.0;
        if across != (scatter.kind == RayKind::Transmission) {
            return None;
        }
        // Whitted's rays follow mirrors and clear glass only.
        if self.is(Integrator::Whitted) && scatter.pdf.is_finite() {
            self.meet_even_world(surface, direction, &scatter, path, out);
            return None;
        }
        path.throughput = path.throughput * scatter.weight;
        if path.throughput.max_component() <= 0.0 || !path.throughput.is_finite() {
            return None;
        }
        // Start the next segment.
        path.pdf = scatter.pdf;
        path.passed = 0.0;
        path.camera = false;
        path.kind = scatter.kind;
        path.bounce += 1;
        Some(Ray {
            o: surface.leave(direction).array(),
            d: direction.array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        })
    }
}

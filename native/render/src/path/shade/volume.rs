// SPDX-License-Identifier: GPL-3.0-or-later
//! Paths through media: lamps seen through them, emission, and scattering.

use crate::film::Shares;
use crate::light::{Lit, Reach};
use crate::math::sampler::Stream;
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::media::{Passage, Through};
use crate::path::random::VertexSamples;
use crate::path::shade::output::Output;
use crate::path::shade::volume_light::{light_segment, receive, receiver};
use crate::path::shadow_rays::add_to_group;
use crate::path::state::Path;
use crate::path::wavefront::Context;
use crate::scene::RenderScene;
use crate::scene::media::MediumRay;
use crate::settings::{LightPass, Pass};
use crate::values::view::Turn;
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

/// How a path leaves a segment between two surfaces.
pub(super) enum Crossed {
    /// It reaches the hit.
    Reached,
    /// It scatters and continues with this ray.
    Scattered(Ray),
    /// It ends.
    Ended,
}

/// Traverses the media on the way to a hit: adds the light of lamps before it and of the media, and may scatter.
/// Not generic, so that it is compiled once; never inlined, because most scenes have no media.
#[cold]
#[inline(never)]
pub(super) fn cross<const EXTRA: bool>(
    context: &Context<'_>,
    ray: &Ray,
    hit: &Hit,
    path: &mut Path,
    out: &mut Output<'_, EXTRA>,
) -> Crossed {
    let Some(stack) = out.media else {
        return Crossed::Reached;
    };
    out.seed = path.stream();
    let settings = context.settings;
    let through = Through {
        scene: context.scene,
        stack: &stack,
        ray: MediumRay {
            origin: Vec3::from(ray.o),
            direction: Vec3::from(ray.d),
            kind: path.kind,
            view: Some(context.camera.view()),
            probes: 0,
        },
    };
    add_lamps(context, &through, ray, hit, path, out);
    if stack.is_empty() {
        // Media on the way here may have absorbed some light.
        if path.camera && !hit.is_hit() {
            out.sample.alpha = opacity(path);
        }
        return Crossed::Reached;
    }
    // Sample the next event; paths beyond their limits are only attenuated.
    let random = path.next_vertex();
    let ([_, channel], [_, distance]) = (random.survival(), random.choices());
    let scatters = !path.is_at_limit(settings);
    let end = if hit.is_hit() { hit.t } else { ray.t_max };
    out.scratch.stream = Stream::new(Stream::new(out.seed).fork(2));
    let Passage {
        event,
        emitted,
        uniform,
    } = through.sample(
        [ray.t_min, end],
        path.throughput,
        scatters,
        [channel, distance],
        out.scratch,
    );
    if emitted != Vec3::ZERO {
        let light = settings.clamped(path.throughput * emitted, path.bounce > 1);
        let group = || group_of(context.scene, &stack);
        out.add_met(light, path, LightPass::Emission, group);
    }
    if uniform && scatters {
        light_segment(context, &through.ray, [ray.t_min, end], random, path, out);
    }
    path.throughput = path.throughput * event.weight;
    if !(path.throughput.max_abs() > 0.0 && path.throughput.is_finite()) {
        // An opaque medium hides the background.
        if path.camera {
            out.sample.alpha = 1.0;
        }
        return Crossed::Ended;
    }
    let Some(at) = event.distance else {
        // The film shows as much of what lies behind as the media transmit.
        if path.camera && !hit.is_hit() {
            out.sample.alpha = opacity(path);
        }
        return Crossed::Reached;
    };
    // Uniform media have got their light along the whole segment.
    let d = through.ray.direction;
    let at = through.ray.origin + d * at;
    scatter_at(context, [at, d], !uniform, random, path, out)
}

/// Scatters at a point. `lit`: whether light is sampled there; `d`: direction before.
fn scatter_at<const EXTRA: bool>(
    context: &Context<'_>,
    [at, d]: [Vec3; 2],
    lit: bool,
    random: VertexSamples,
    path: &mut Path,
    out: &mut Output<'_, EXTRA>,
) -> Crossed {
    if path.camera {
        out.sample.alpha = 1.0;
        if context.film.fills(Pass::Albedo) {
            out.sample.albedo = out.scratch.mixture.albedo().array();
        }
    }
    let [roulette, _] = random.survival();
    if !path.survives(roulette) {
        return Crossed::Ended;
    }
    path.receiver = receiver(at, path);
    if lit {
        let [choice, _] = random.choices();
        let lights = &context.scene.lights;
        let light = lights.sample(path.receiver, choice, random.light());
        receive(context, d, light, path, out);
    }
    scatter(d, random, path, out)
}

/// Returns the opacity of the media that a camera ray has passed.
pub(super) fn opacity(path: &Path) -> f32 {
    1.0 - path.throughput.mean().clamp(0.0, 1.0)
}

/// Adds the light of lamps that the ray hits before the surface, dimmed by the media in front of them.
fn add_lamps<const EXTRA: bool>(
    context: &Context<'_>,
    through: &Through<'_>,
    ray: &Ray,
    hit: &Hit,
    path: &Path,
    out: &mut Output<'_, EXTRA>,
) {
    let (scene, settings) = (context.scene, context.settings);
    let path = &path.before_catcher();
    let hidden = !scene.lights.any_camera_visible()
        || context.points.is_some()
        || (settings.film_transparent && !hit.is_hit());
    if !scene.features().lights_hittable || (path.camera && hidden) {
        return;
    }
    out.work.lights_tested += 1;
    let span = [path.passed.max(0.0), path.passed + hit.t];
    let reach = Reach {
        receiver: path.receiver,
        direction: through.ray.direction,
        span,
    };
    let (seed, lights) = (out.seed, &scene.lights);
    let (scratch, registers) = (&mut *out.scratch, &mut *out.light_registers);
    let mut lamps = |group| {
        let lit = &mut Lit {
            images: &scene.images,
            varying: &scene.varying,
            history: path.history(-path.passed),
            registers: &mut *registers,
        };
        let light = lights.radiance_through(reach, path.pdf, path.kind, group, lit, |distance| {
            // Each lamp starts the stream anew, so that the light of the groups adds up to that of all lamps.
            scratch.stream = Stream::new(Stream::new(seed).fork(3));
            // Lamps are measured from the last scattering point, media from the ray's origin.
            let span = [ray.t_min, (distance - path.passed).max(ray.t_min)];
            through.transmittance(span, scratch)
        });
        path.throughput * light
    };
    let all = lamps(None);
    let light = settings.clamped(all, path.bounce > 1);
    // The limit applies to all lamps together.
    if let Some(extra) = &mut out.extra {
        let kept = light.max_abs() / all.max_abs();
        for group in (1..).take(extra.groups.len()).filter(|_| kept > 0.0) {
            add_to_group(extra.groups, group, lamps(Some(group)) * kept);
        }
    }
    out.add_met(light, path, LightPass::Emission, || 0);
}

/// Returns the light group of the glow of these media; 0 = none, or several.
fn group_of(scene: &RenderScene, stack: &Stack) -> u8 {
    let mut groups = stack.media().iter().map(|medium| {
        if medium.is_world() {
            scene.world.group
        } else {
            scene.indices.group(medium.triangle as usize)
        }
    });
    let first = groups.next().unwrap_or(0);
    if groups.all(|group| group == first) {
        first
    } else {
        0
    }
}

/// Samples the direction after scattering. `d`: direction before.
fn scatter<const EXTRA: bool>(
    d: Vec3,
    random: VertexSamples,
    path: &mut Path,
    out: &mut Output<'_, EXTRA>,
) -> Crossed {
    // The stream's number chooses among the lobes, of which most media have one.
    let choice = Stream::new(Stream::new(out.seed).fork(4)).number();
    let mixture = &out.scratch.mixture;
    let direction = mixture.sample(d, choice, random.direction());
    let (f, pdf) = mixture.phase(d.dot(direction));
    path.throughput = path.throughput * f * (1.0 / pdf);
    if !(path.throughput.max_abs() > 0.0 && path.throughput.is_finite()) {
        return Crossed::Ended;
    }
    if let Some(extra) = &mut out.extra
        && path.bounce == 0
    {
        extra.shares = Shares::VOLUME;
    }
    path.pdf = pdf;
    path.min_pdf = path.min_pdf.min(pdf);
    path.passed = 0.0;
    path.camera = false;
    path.scatter(RayKind::Volume, Turn::default());
    Crossed::Scattered(Ray {
        o: path.receiver.point.array(),
        d: direction.array(),
        t_min: 0.0,
        t_max: f32::INFINITY,
    })
}
